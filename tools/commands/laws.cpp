// SPDX-License-Identifier: Apache-2.0
// `stickslip laws`: the laws of friction by name, compared on recordings.
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/laws.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/report/laws_page.h"
#include "physics/number_text.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/recording_import.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/checked_file.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::vector<std::string> recordings;
  std::string model;
  ImportOptions columns;
  std::string json;
  std::string html;
  std::string write_model;
  std::uint64_t seed = 1;
  int jobs = 0;
  double horizon_s = 0.0;
};

report::Provenance provenance_of(const Arguments& arguments) {
  std::vector<report::Provenance::File> recordings;
  for (const std::string& path : arguments.recordings) recordings.push_back(checked_file(path));
  report::Provenance out =
      report::provenance_of(recordings, checked_file(arguments.model), arguments.seed, "laws");
  if (arguments.horizon_s > 0.0) {
    out.command += " --horizon " + physics::number_text(arguments.horizon_s);
  }
  return out;
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  std::vector<protocol::Recording> recordings;
  for (const std::string& path : arguments.recordings) {
    recordings.push_back(recording_from(path, arguments.columns, false,
                                        diagnosis::most_frames / arguments.recordings.size()));
  }
  diagnosis::Options options;
  options.seed = arguments.seed;
  options.threads = parallel::threads_for(arguments.jobs);
  if (arguments.horizon_s > 0.0) options.horizon_s = arguments.horizon_s;
  options.evidence = !arguments.html.empty();
  terminal::Progress progress("comparing laws");
  options.progress = [&progress](const std::string& what, double done) {
    progress.set_label(what);
    progress.at(done);
  };
  const diagnosis::LawComparison result = diagnosis::compare_laws(recordings, model, options);
  progress.finish();
  terminal::print_page(report::laws_text(result));
  report::Provenance provenance;
  if (!arguments.json.empty() || !arguments.html.empty()) provenance = provenance_of(arguments);
  if (!arguments.json.empty()) {
    outputs.write(arguments.json, Form::json,
                  protocol::json_text(report::laws_json(result, provenance)) + "\n");
  }
  if (!arguments.html.empty()) {
    outputs.write(arguments.html, Form::html, report::laws_html(result, provenance));
  }
  if (!arguments.write_model.empty()) {
    outputs.write(arguments.write_model, Form::toml, config::model_text(result.laws.front().model));
  }
  return 0;
}

}  // namespace

void add_laws(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "laws", "Compare the laws of friction by name: which one do recordings show");
  add_input(*command, "RECORDING", arguments->recordings,
            "Recordings of one rig (LCM event logs or CSV)")
      ->required();
  add_model_option(*command, arguments->model);
  add_import_options(*command, arguments->columns);
  add_json_file_option(*command, arguments->json);
  add_output(*command, "--html", arguments->html,
             "Write the report as one self-contained page with figures");
  add_output(*command, "--write-model", arguments->write_model,
             "Write the model with the preferred law, calibrated, with the uncertainty of every "
             "fitted number");
  add_seed_option(*command, arguments->seed);
  add_jobs_option(*command, arguments->jobs);
  add_horizon_option(*command, arguments->horizon_s);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(
      *command,
      {.examples = {{"Compare the laws, with pictures, and keep the preferred one",
                     "stickslip laws run.log --model model.toml --html laws.html --write-model "
                     "preferred.toml"}},
       .files = {recording_files, model_files},
       .see_also = {"stickslip-diagnose(1)", "stickslip-simulate(1)"}});
}

}  // namespace stickslip::commands
