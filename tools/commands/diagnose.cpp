// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/bootstrap.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/report/html.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/provenance.h"
#include "diagnosis/report/text.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "protocol/sha256.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_import.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/files/read_file.h"
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
  std::size_t bootstrap = 0;
  terminal::Colours colours = terminal::Colours::automatic;
};

report::Provenance::File checked_file(const std::filesystem::path& path) {
  return {path.filename().string(), protocol::sha256_of(content_of(path))};
}

report::Provenance provenance_of(const Arguments& arguments) {
  std::vector<report::Provenance::File> recordings;
  for (const std::string& path : arguments.recordings) recordings.push_back(checked_file(path));
  report::Provenance out =
      report::provenance_of(recordings, checked_file(arguments.model), arguments.seed);
  if (arguments.horizon_s > 0.0) {
    out.command += " --horizon " + physics::number_text(arguments.horizon_s);
  }
  if (arguments.bootstrap > 0) {
    out.command += " --bootstrap " + std::to_string(arguments.bootstrap);
  }
  return out;
}

terminal::Tone tone_of(diagnosis::Verdict verdict) {
  switch (verdict) {
    case diagnosis::Verdict::consistent:
      return terminal::Tone::good;
    case diagnosis::Verdict::missing_physics:
      return terminal::Tone::warning;
    case diagnosis::Verdict::unexplained:
      return terminal::Tone::bad;
  }
  return terminal::Tone::plain;
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
  terminal::Progress progress("diagnosing");
  options.progress = [&progress](const std::string& what, double done) {
    progress.set_label(what);
    progress.at(done);
  };
  diagnosis::Diagnosis result = diagnosis::diagnose(recordings, model, options);
  progress.finish();
  if (arguments.bootstrap > 0) {
    terminal::Progress bootstrapping("bootstrap: diagnosing synthetic recordings");
    options.progress = [&bootstrapping](const std::string&, double done) {
      bootstrapping.at(done);
    };
    result.false_alarms =
        diagnosis::false_alarms(recordings, model, result, arguments.bootstrap, options);
  }
  const std::string text = report::report_text(result);
  const std::size_t verdict = text.find(':');
  const terminal::Paint paint(terminal::wants_colour(arguments.colours, STDOUT_FILENO));
  terminal::print_page(paint(tone_of(result.verdict), text.substr(0, verdict)) +
                       text.substr(verdict));
  report::Provenance provenance;
  if (!arguments.json.empty() || !arguments.html.empty()) provenance = provenance_of(arguments);
  if (!arguments.json.empty()) {
    outputs.write(arguments.json, Form::json,
                  protocol::json_text(report::report_json(result, provenance)) + "\n");
  }
  if (!arguments.html.empty()) {
    provenance.augmented_model = config::model_text(result.model);
    outputs.write(arguments.html, Form::html, report::report_html(result, provenance));
  }
  if (!arguments.write_model.empty()) {
    outputs.write(arguments.write_model, Form::toml, config::model_text(result.model));
  }
  return 0;
}

}  // namespace

void add_diagnose(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "diagnose", "Find where a model fails to explain recordings, and which physics it lacks");
  add_input(*command, "RECORDING", arguments->recordings,
            "Recordings of one rig (LCM event logs or CSV)")
      ->required();
  add_model_option(*command, arguments->model);
  add_import_options(*command, arguments->columns);
  add_json_file_option(*command, arguments->json);
  add_output(*command, "--html", arguments->html,
             "Write the report as one self-contained page with figures");
  add_output(*command, "--write-model", arguments->write_model,
             "Write the augmented model: calibrated, with the physics found and the uncertainty of "
             "every fitted number");
  add_seed_option(*command, arguments->seed);
  add_jobs_option(*command, arguments->jobs);
  command
      ->add_option("--bootstrap", arguments->bootstrap,
                   "Also diagnose this number of synthetic recordings of the calibrated declared "
                   "model, under the same excitation and noise, and report the false alarms")
      ->check(whole_number(0, 10000))
      ->capture_default_str();
  add_horizon_option(*command, arguments->horizon_s);
  add_colour_option(*command, arguments->colours);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command,
           {.examples = {{"Write the report as JSON and HTML, and the amended model",
                          "stickslip diagnose run.log --model model.toml --json report.json --html "
                          "report.html --write-model amended.toml"},
                         {"Estimate the rate of false findings",
                          "stickslip diagnose run.log --model model.toml --bootstrap 10"}},
            .files = {recording_files, model_files},
            .see_also = {"stickslip-evaluate(1)", "stickslip-examine(1)"}});
}

}  // namespace stickslip::commands
