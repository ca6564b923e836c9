// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "config/campaign.h"
#include "config/model_file.h"
#include "diagnosis/bootstrap.h"
#include "diagnosis/report/html.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/provenance.h"
#include "diagnosis/report/text.h"
#include "physics/problem.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
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

struct Arguments : DiagnosisArguments {
  std::string campaign;
  std::vector<std::string> hold_out;
  std::vector<std::string> conditions;  // "load_n=3.43"
  std::string candidates;
  double false_alarm_rate = diagnosis::Criteria{}.false_alarm_rate;
  std::size_t bootstrap = 0;
  terminal::Colours colours = terminal::Colours::automatic;
};

// The files of a diagnosis, read.
struct Work {
  physics::Model model;
  std::filesystem::path model_file;
  std::vector<std::filesystem::path> recordings;
  std::shared_ptr<const physics::Campaign> campaign;  ///< empty: recordings under one model
};

Work work_of(const Arguments& arguments) {
  if (arguments.campaign.empty()) {
    return {config::load_model(arguments.model),
            arguments.model,
            {arguments.recordings.begin(), arguments.recordings.end()},
            nullptr};
  }
  std::optional<std::filesystem::path> model;
  if (!arguments.model.empty()) model = arguments.model;
  config::LoadedCampaign loaded = config::load_campaign(arguments.campaign, model);
  for (const std::string& name : arguments.hold_out) {
    config::hold_out(loaded.campaign, name, arguments.campaign);
  }
  return {std::move(loaded.model), loaded.model_file, loaded.recordings,
          std::make_shared<physics::Campaign>(std::move(loaded.campaign))};
}

// Those for which the model is written. Each has to be one that the campaign's numbers follow.
std::map<std::string, double> conditions_of(const Arguments& arguments,
                                            const physics::Campaign& campaign) {
  std::map<std::string, double> out;
  const std::vector<std::string> varied = campaign.varied_conditions();
  for (const std::string& text : arguments.conditions) {
    const std::size_t equals = text.find('=');
    const std::string name = text.substr(0, equals);
    char* end = nullptr;
    const double value =
        equals == std::string::npos ? 0.0 : std::strtod(text.c_str() + equals + 1, &end);
    const bool is_number = end != nullptr && *end == '\0' && end != text.c_str() + equals + 1;
    const bool is_known = std::find(varied.begin(), varied.end(), name) != varied.end();
    if (!is_number || !is_known || !std::isfinite(value)) {
      std::string known;
      for (const std::string& each : varied) known += (known.empty() ? "" : ", ") + each;
      throw InputError(Problem{"--at", 0, 0,
                               "expected NAME=NUMBER with a condition in which the recordings of " +
                                   arguments.campaign + " differ (" + known + "), found " + text});
    }
    out[name] = value;
  }
  for (const std::string& name : varied) {
    if (!out.empty()) out.emplace(name, campaign.reference(name));
  }
  return out;
}

report::Provenance provenance_of(const Arguments& arguments, const Work& work) {
  std::vector<report::Provenance::File> recordings;
  for (const std::filesystem::path& path : work.recordings) {
    recordings.push_back(checked_file(path));
    // Files of a campaign may have one name in several folders.
    if (work.campaign) {
      recordings.back().name =
          work.campaign->runs[recordings.size() - 1].name + ": " + recordings.back().name;
    }
  }
  report::Provenance out =
      report::provenance_of(recordings, checked_file(work.model_file), arguments.seed);
  if (work.campaign) {
    const report::Provenance::File campaign = checked_file(arguments.campaign);
    out.command = "stickslip diagnose --campaign " + campaign.name;
    for (const std::string& name : arguments.hold_out)
      out.command += " --hold-out \"" + name + "\"";
    out.command += " --seed " + std::to_string(arguments.seed);
    out.files.push_back(campaign);
  }
  if (!arguments.candidates.empty()) {
    out.candidates = checked_file(arguments.candidates);
    out.command += " --candidates " + out.candidates->name;
  }
  report::add_horizon(out, horizon_of(arguments));
  report::add_false_alarm_rate(out, arguments.false_alarm_rate);
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
  Work work = work_of(arguments);
  physics::Model& model = work.model;
  if (!arguments.candidates.empty()) config::add_candidates(arguments.candidates, model);
  const std::vector<protocol::Recording> recordings =
      recordings_from(work.recordings, arguments.columns);
  terminal::Progress progress("diagnosing");
  diagnosis::Options options = options_of(arguments, progress);
  options.criteria.false_alarm_rate = arguments.false_alarm_rate;
  options.campaign = work.campaign;
  if (work.campaign) options.conditions = conditions_of(arguments, *work.campaign);
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
  if (!arguments.json.empty() || !arguments.html.empty())
    provenance = provenance_of(arguments, work);
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
            "Recordings of one rig (LCM event logs or CSV); or --campaign");
  add_model_option(*command, arguments->model);
  command->get_option("--model")->required(false);
  add_input(*command, "--campaign", arguments->campaign,
            "Recordings under different conditions, in place of RECORDING (TOML)")
      ->excludes("RECORDING");
  command
      ->add_option("--hold-out", arguments->hold_out,
                   "Recording of the campaign, by name, that nothing is fitted to: the result "
                   "predicts it")
      ->needs("--campaign");
  command
      ->add_option("--at", arguments->conditions,
                   "Condition for which --write-model writes the model, NAME=NUMBER, such as "
                   "load_n=3.43 (default: the mean over the campaign)")
      ->needs("--campaign");
  add_input(*command, "--candidates", arguments->candidates,
            "Formulas of your own to try beside the catalogue ([[candidate]] tables)");
  add_diagnosis_options(*command, *arguments,
                        "Write the augmented model: calibrated, with the physics found and the "
                        "uncertainty of every fitted number");
  add_false_alarm_rate_option(*command, arguments->false_alarm_rate);
  command
      ->add_option("--bootstrap", arguments->bootstrap,
                   "Also diagnose this number of synthetic recordings of the calibrated declared "
                   "model, under the same excitation and noise, and report the false alarms")
      ->check(whole_number(0, 10000))
      ->capture_default_str()
      ->excludes("--campaign");
  add_colour_option(*command, arguments->colours);
  command->callback([&action, arguments, command] {
    if (arguments->campaign.empty()) {
      if (arguments->recordings.empty()) throw CLI::RequiredError("RECORDING");
      if (arguments->model.empty()) throw CLI::RequiredError("--model");
    }
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(
      *command,
      {.examples = {{"Write the report as JSON and HTML, and the augmented model",
                     "stickslip diagnose run.log --model model.toml --json report.json --html "
                     "report.html --write-model mended.toml"},
                    {"Claim only what is almost certain",
                     "stickslip diagnose run.log --model model.toml --false-alarm-rate 0.0001"},
                    {"Estimate the rate of false findings",
                     "stickslip diagnose run.log --model model.toml --bootstrap 10"},
                    {"Compare recordings under different loads, and predict one of them",
                     "stickslip diagnose --campaign campaign.toml --hold-out \"450 g\""}},
       .files = {recording_files, model_files},
       .see_also = {"stickslip-evaluate(1)", "stickslip-examine(1)"}});
}

}  // namespace stickslip::commands
