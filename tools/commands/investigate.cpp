// SPDX-License-Identifier: Apache-2.0
// `stickslip investigate`: runs that a rig needs to name what its model lacks, one after the other.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>

#include "config/model_file.h"
#include "config/rig.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/shooting.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/control_client/control_client.h"
#include "tools/files/read_file.h"
#include "tools/investigation/investigation.h"
#include "tools/rig_access/daemon_rig.h"
#include "tools/rig_access/simulated_rig.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/telemetry/stop_on_signal.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;

namespace {

using investigation::Study;

struct Arguments {
  std::string socket;
  std::string rig;
  std::string model;
  std::string out;
  std::string repeat;
  investigation::StudySettings settings;
  bool yes = false;
  int jobs = 0;
};

bool is_confirmed(const std::stop_token& stop) {
  std::printf("make this run? [y/N] ");
  std::fflush(stdout);
  const telemetry::TypedLine typed = telemetry::typed_line(stop);
  if (typed.kind == telemetry::TypedLine::Kind::stopped) throw diagnosis::Interrupted();
  const std::string& line = typed.text;
  return line == "y" || line == "Y" || line == "yes";
}

investigation::Dialogue dialogue_of(const Arguments& arguments, std::stop_token stop,
                                    std::unique_ptr<terminal::Progress>& progress) {
  investigation::Dialogue out;
  out.show = [&progress](const std::string& text) {
    if (progress) progress->finish();
    progress.reset();
    terminal::print_page(text);
    std::fflush(stdout);
  };
  out.confirm = [yes = arguments.yes, stop] { return yes || is_confirmed(stop); };
  out.progress = [&progress](const std::string& step, double done) {
    if (!progress) progress = std::make_unique<terminal::Progress>("investigating");
    progress->set_label(step);
    progress->at(done);
  };
  return out;
}

std::unique_ptr<investigation::Rig> rig_of(const Arguments& arguments) {
  if (!arguments.rig.empty()) {
    return std::make_unique<rig_access::SimulatedRig>(config::load_rig(arguments.rig));
  }
  return std::make_unique<rig_access::DaemonRig>(control_client::control_socket(arguments.socket));
}

int repeat(const Arguments& arguments, const investigation::InvestigationOptions& options) {
  std::unique_ptr<terminal::Progress> progress;
  const auto found = investigation::differences(
      arguments.repeat, dialogue_of(arguments, options.stop, progress), options);
  if (progress) progress->finish();
  for (const std::string& each : found) terminal::print_page(each + "\n");
  if (found.empty()) terminal::print("every number is that of study.json\n");
  return found.empty() ? 0 : 1;
}

void print_ending(const Study& study, const Arguments& arguments) {
  std::string text = "ended after " + physics::counted(study.steps.size(), "run") + " and " +
                     physics::number_text(study.rig_time_s(), 4) +
                     " s of rig time: " + study.ending_words + "\n";
  text += "  the study: " + arguments.out + "/study.html\n";
  if (!study.steps.empty() && !study.steps.back().findings.empty()) {
    text += "  its model, for the daemon: stickslip ctl model " + arguments.out + "/" +
            study.steps.back().name + "/mended.toml\n";
  }
  terminal::print_page(text);
}

int run(const Arguments& arguments) {
  const telemetry::StopSignals signals;
  const telemetry::StopOnSignal stop(signals);
  const investigation::InvestigationOptions options{parallel::threads_for(arguments.jobs),
                                                    stop.token()};
  try {
    if (!arguments.repeat.empty()) return repeat(arguments, options);
    config::load_model(arguments.model);  // its problems are reported before anything moves
    const auto rig = rig_of(arguments);
    Study study = investigation::opened(arguments.out, files::content_of(arguments.model),
                                        rig->facts(), arguments.settings);
    std::unique_ptr<terminal::Progress> progress;
    study = investigation::investigate(std::move(study), arguments.out, *rig,
                                       dialogue_of(arguments, options.stop, progress), options);
    if (progress) progress->finish();
    print_ending(study, arguments);
    return 0;
  } catch (const diagnosis::Interrupted&) {
    std::fprintf(stderr,
                 "stickslip: interrupted; the amplifier is off, and the same command takes the "
                 "study up again\n");
    return 1;
  }
}

void add_settings(CLI::App& command, investigation::StudySettings& settings) {
  command.add_option("--budget-s", settings.budget_s, "Rig time of all runs together [s]")
      ->check(positive_number())
      ->capture_default_str();
  command
      .add_option("--certain", settings.certain,
                  "Probability from which on a hypothesis counts as certain")
      ->check(number_that([](double v) { return v > 0.5 && v < 1.0; }, "above 0.5 and below 1"))
      ->capture_default_str();
  command
      .add_option("--least-gain", settings.least_gain,
                  "Share of the remaining uncertainty that a run has to be expected to resolve")
      ->check(number_that([](double v) { return v >= 0.0 && v < 1.0; }, "0 to below 1"))
      ->capture_default_str();
  command.add_option("--shortest-s", settings.shortest_s, "Shortest run [s]")
      ->check(number_that([](double v) { return v >= 6.0 && v <= 600.0; }, "6 to 600"))
      ->capture_default_str();
  command.add_option("--longest-s", settings.longest_s, "Longest run [s]")
      ->check(number_that([](double v) { return v >= 6.0 && v <= 600.0; }, "6 to 600"))
      ->capture_default_str();
  command
      .add_option("--evaluations", settings.evaluations,
                  "Runs that are simulated in the search for the best one")
      ->check(whole_number(10, 10000))
      ->capture_default_str();
}

}  // namespace

void add_investigate(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "investigate",
      "Design, make and diagnose the runs that name what a rig's model lacks, one by one");
  command
      ->add_option("--socket", arguments->socket,
                   "The daemon's control socket (default: $STICKSLIP_CONTROL, or "
                   "/run/stickslip/control.sock)")
      ->type_name("FILE");
  add_input(*command, "--rig", arguments->rig,
            "Configuration of a simulated rig, run without a daemon in simulated time (TOML)")
      ->excludes("--socket");
  add_model_option(*command, arguments->model);
  command->get_option("--model")->required(false);
  declare_files(*command, FileRole::updated,
                command->add_option("--out", arguments->out,
                                    "Folder of the study: new, or one that is taken up again"))
      ->type_name("DIR");
  CLI::Option* repeated =
      add_input(
          *command, "--repeat", arguments->repeat,
          "Diagnose and design everything again from the recordings of this study, and compare")
          ->type_name("DIR");
  for (const char* other : {"--socket", "--rig", "--model", "--out"}) repeated->excludes(other);
  command->add_flag("--yes", arguments->yes,
                    "Make every run without asking; a person still arms the rig once");
  add_settings(*command, arguments->settings);
  add_seed_option(*command, arguments->settings.seed);
  add_jobs_option(*command, arguments->jobs);
  command->callback([&action, arguments] {
    if (arguments->repeat.empty()) {
      if (arguments->model.empty()) throw CLI::RequiredError("--model");
      if (arguments->out.empty()) throw CLI::RequiredError("--out");
      if (arguments->settings.longest_s < arguments->settings.shortest_s) {
        throw CLI::ValidationError("--longest-s", "is less than --shortest-s");
      }
    }
    action = [arguments] { return run(*arguments); };
  });
  describe(*command,
           {.examples = {{"Investigate the rig of a daemon, and confirm every run",
                          "stickslip investigate --model believed.toml --out study"},
                         {"Investigate a simulated rig without a daemon",
                          "stickslip investigate --rig rig.toml --model model.toml --out study "
                          "--yes --budget-s 120"},
                         {"Get every number of a study again from its recordings",
                          "stickslip investigate --repeat study"}},
            .environment = {{"STICKSLIP_CONTROL",
                             "Control socket of the daemon if --socket is not given"}},
            .files = {recording_files, model_files},
            .see_also = {"stickslip-diagnose(1)", "stickslip-ctl(1)", "stickslipd(8)"}});
}

}  // namespace stickslip::commands
