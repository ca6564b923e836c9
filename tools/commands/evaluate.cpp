// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "config/model_file.h"
#include "diagnosis/evaluation.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"
#include "physics/result_units.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/processing/evaluation_json.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::string recording;
  std::string model;
  std::string json;
  double horizon_s = 0.0;
  bool free_run = false;
  int jobs = 0;
};

int run(const Arguments& arguments, const Outputs& outputs) {
  using namespace diagnosis;
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording recording = recording_from(arguments.recording);
  EvaluationOptions options;
  if (arguments.horizon_s > 0.0) options.horizon_s = arguments.horizon_s;
  options.free_run = arguments.free_run;
  options.threads = parallel::threads_for(arguments.jobs);
  terminal::Progress progress("predicting");
  options.progress = [&progress](double share) { progress.at(share); };
  const Evaluation done = evaluate(recording, model, options);
  progress.finish();
  const Score& result = done.score;
  const physics::ResultUnits units(model);

  const nlohmann::ordered_json json = processing::evaluation_json(done, model);
  outputs.write(arguments.json, Form::json, protocol::json_text(json) + "\n");

  terminal::print("chi-squared per sample %s over %s of %s%s (1: noise only)\n",
                  physics::number_text(result.chi2_per_sample).c_str(),
                  physics::counted(done.windows, "window").c_str(),
                  physics::number_text(done.horizon_s).c_str(), units.after_number("s").c_str());
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!result.rmse[c]) continue;
    const std::string share =
        *result.nrmse[c] > 0.0
            ? physics::number_text(*result.nrmse[c]) + " of the channel's standard deviation"
            : "but the channel never changes: is it connected?";
    terminal::print("%s: RMS prediction error %s%s, %s\n",
                    std::string(channel_table[c].stem).c_str(),
                    physics::number_text(*result.rmse[c]).c_str(),
                    units.after_number(channel_table[c].unit).c_str(), share.c_str());
  }
  for (std::size_t c = 0; done.free_run && c < predicted_channels; ++c) {
    if (!done.free_run->rmse[c]) continue;
    terminal::print("%s: RMS error of a free run %s%s\n",
                    std::string(channel_table[c].stem).c_str(),
                    physics::number_text(*done.free_run->rmse[c]).c_str(),
                    units.after_number(channel_table[c].unit).c_str());
  }
  return 0;
}

}  // namespace

void add_evaluate(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("evaluate", "Score a model on a recording; no parameter is fitted");
  add_recording(*command, arguments->recording);
  add_model_option(*command, arguments->model);
  add_json_file_option(*command, arguments->json);
  add_horizon_option(*command, arguments->horizon_s);
  command->add_flag("--free-run", arguments->free_run,
                    "Also simulate the whole recording from its initial state");
  add_jobs_option(*command, arguments->jobs);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command, {.examples = {{"Score the predictions of a model on a recording",
                                    "stickslip evaluate run.log --model mended.toml"}},
                      .files = {recording_files, model_files},
                      .see_also = {"stickslip-diagnose(1)"}});
}

}  // namespace stickslip::commands
