// SPDX-License-Identifier: Apache-2.0
// `stickslip laws`: the laws of friction by name, compared on recordings.
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/laws.h"
#include "diagnosis/report/laws_page.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/checked_file.h"
#include "tools/commands/commands.h"
#include "tools/commands/diagnosis_options.h"
#include "tools/files/outputs.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

using Arguments = DiagnosisArguments;

report::Provenance provenance_of(const Arguments& arguments) {
  std::vector<report::Provenance::File> recordings;
  for (const std::string& path : arguments.recordings) recordings.push_back(checked_file(path));
  report::Provenance out =
      report::provenance_of(recordings, checked_file(arguments.model), arguments.seed, "laws");
  report::add_horizon(out, horizon_of(arguments));
  return out;
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  const std::vector<protocol::Recording> recordings =
      recordings_from(arguments.recordings, arguments.columns);
  terminal::Progress progress("comparing laws");
  const diagnosis::Options options = options_of(arguments, progress);
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
  CLI::App* command =
      app.add_subcommand("laws", "Compare the laws of friction by name on recordings of a rig");
  add_input(*command, "RECORDING", arguments->recordings,
            "Recordings of one rig (LCM event logs or CSV)")
      ->required();
  add_model_option(*command, arguments->model);
  add_diagnosis_options(*command, *arguments,
                        "Write the model with the preferred law, calibrated, with the uncertainty "
                        "of every fitted number");
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
