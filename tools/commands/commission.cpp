// SPDX-License-Identifier: Apache-2.0
// `stickslip commission`: the acceptance of a bench, step by step, with a person.
#include <algorithm>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <sstream>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "config/rig.h"
#include "diagnosis/shooting.h"
#include "drivers/factory/make_bench.h"
#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/commissioning/commissioning.h"
#include "tools/commissioning/comparison.h"
#include "tools/commissioning/page.h"
#include "tools/commissioning/record.h"
#include "tools/files/outputs.h"
#include "tools/files/read_file.h"
#include "tools/files/utc_now.h"
#include "tools/files/write_file.h"
#include "tools/telemetry/stop_on_signal.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace command_line;

namespace {

namespace fs = std::filesystem;
using commissioning::Record;

struct Arguments {
  std::string rig;
  std::string out;
  std::string answers;
  std::vector<std::string> steps;
  bool yes = false;
};

/// Lines of a file, in turn; those that begin with # are comments.
std::deque<std::string> answers_of(const std::string& file) {
  std::deque<std::string> out;
  std::istringstream in(files::content_of(file));
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with('#')) out.push_back(line);
  }
  return out;
}

void show(const std::string& text) {
  terminal::print_page(text);
  std::fflush(stdout);
}

commissioning::Person person_of(const Arguments& arguments, std::stop_token stop) {
  commissioning::Person out;
  out.show = show;
  if (arguments.yes) {
    out.ask = [](const std::string& question, const std::string& agreed) {
      show("  " + question + agreed + "\n");
      return std::optional<std::string>(agreed);
    };
    return out;
  }
  if (!arguments.answers.empty()) {
    auto lines = std::make_shared<std::deque<std::string>>(answers_of(arguments.answers));
    out.ask = [lines](const std::string& question, const std::string&) {
      std::optional<std::string> line;
      if (!lines->empty()) line = std::move(lines->front());
      if (line) lines->pop_front();
      show("  " + question + line.value_or("") + "\n");
      return line;
    };
    return out;
  }
  out.ask = [stop = std::move(stop)](const std::string& question, const std::string&) {
    std::printf("  %s", question.c_str());
    std::fflush(stdout);
    telemetry::TypedLine typed = telemetry::typed_line(stop);
    if (typed.kind == telemetry::TypedLine::Kind::stopped) throw diagnosis::Interrupted();
    const bool over = typed.kind == telemetry::TypedLine::Kind::end && typed.text.empty();
    return over ? std::nullopt : std::optional<std::string>(std::move(typed.text));
  };
  return out;
}

/// The files of an acceptance.
class Folder {
 public:
  /// Throws InputError if one of its files could not be written, or is not of this command.
  Folder(fs::path folder, const Arguments& arguments)
      : folder_(std::move(folder)), outputs_("stickslip commission", {arguments.rig}, false) {
    files::make_folder(folder_);
    for (const char* name : {commissioning::record_name, page_name, delays_name}) {
      outputs_.check((folder_ / name).string());
    }
  }

  fs::path record() const { return folder_ / commissioning::record_name; }
  fs::path page() const { return folder_ / page_name; }
  fs::path delays() const { return folder_ / delays_name; }

  void write(const Record& record) const {
    outputs_.write(this->record().string(), files::Form::json, commissioning::json_of(record));
    outputs_.write(page().string(), files::Form::html, commissioning::page_of(record));
    const std::string delays_text = commissioning::delays_toml(record);
    if (!delays_text.empty()) {
      outputs_.write(delays().string(), files::Form::toml, delays_text);
    }
  }

  /// Keeps an acceptance of the bench as it was under a name of its own.
  fs::path put_aside() const {
    for (int number = 1;; ++number) {
      const fs::path name = folder_ / ("commissioned-" + std::to_string(number) + ".json");
      if (fs::exists(name)) continue;
      fs::rename(record(), name);
      return name;
    }
  }

 private:
  static constexpr const char* page_name = "report.html";
  static constexpr const char* delays_name = "delays.toml";
  fs::path folder_;
  files::Outputs outputs_;
};

Record new_record(const config::Rig& rig) {
  Record out;
  out.rig = rig.name;
  out.program = STICKSLIP_VERSION;
  out.begun = files::utc_now();
  out.settings = commissioning::bench_settings(rig);
  return out;
}

/// An acceptance that is taken up again, or a new one.
Record opened(const Folder& folder, const config::Rig& rig, const commissioning::Person& person) {
  std::optional<Record> before = commissioning::load_record(folder.record());
  if (!before) return new_record(rig);
  show("taking up the acceptance of " + before->begun + "\n" + commissioning::summary_of(*before));
  const std::vector<std::string> changes = commissioning::changed_settings(*before, rig);
  if (changes.empty()) return *std::move(before);
  show("the configuration was changed since:\n");
  for (const std::string& each : changes) show("  " + each + "\n");
  const auto answer = person.ask(
      "k keeps the steps that are passed; [Enter] begins anew, and keeps the earlier file: ", "");
  if (!answer) throw commissioning::Ended();
  if (*answer != "k") {
    show("kept as " + folder.put_aside().string() + "\n");
    return new_record(rig);
  }
  before->settings = commissioning::bench_settings(rig);
  for (const std::string& each : changes) {
    before->changes.push_back(files::utc_now() + ": " + each + "; earlier steps were kept.");
  }
  return *std::move(before);
}

int run(const Arguments& arguments) {
  const config::Rig rig = config::load_rig(arguments.rig);
  if (rig.driver != config::DriverKind::bench) {
    throw InputError(
        Problem{arguments.rig, 0, 0, "has no devices to accept: expected driver.kind = \"bench\""});
  }
  const telemetry::StopSignals signals;
  const telemetry::StopOnSignal stop(signals);
  const Folder folder(
      arguments.out.empty() ? commissioning::folder_beside(arguments.rig) : fs::path(arguments.out),
      arguments);
  const commissioning::Person person = person_of(arguments, stop.token());
  bool complete = false;
  try {
    Record record = opened(folder, rig, person);
    commissioning::BenchSession session(drivers::make_bench(rig.bench, rig.loop.rate_hz), rig,
                                        stop.token());
    complete = commissioning::commission(session, person, record, {arguments.steps}, {},
                                         [&folder](const Record& now) { folder.write(now); });
    show("\n" + commissioning::summary_of(record));
  } catch (const commissioning::Ended&) {
    show("nothing was changed\n");
    return 1;
  } catch (const diagnosis::Interrupted&) {
    std::fprintf(stderr,
                 "\nstickslip: interrupted; the amplifier is off, and the same command takes the "
                 "acceptance up again\n");
    return 1;
  }
  show("  report: " + folder.page().string() + "\n");
  if (fs::exists(folder.delays())) {
    show("  delays, lines for the model: " + folder.delays().string() + "\n");
  }
  return complete ? 0 : 1;
}

}  // namespace

void add_commission(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "commission",
      "Accept a bench of real devices step by step, with a person, before its first run");
  add_input(*command, "RIG", arguments->rig, "Rig (TOML)")->required()->transform(shipped_file(""));
  declare_files(*command, FileRole::updated,
                command->add_option("--out", arguments->out,
                                    "Folder of the acceptance: new, or one that is taken up again "
                                    "(default: beside the rig, BENCH.commissioned)"))
      ->type_name("DIR");
  std::vector<std::string> names;
  for (const commissioning::Step& step : commissioning::all_steps()) names.emplace_back(step.id);
  command
      ->add_option("--step", arguments->steps,
                   "Make this step, also if it is passed; may be repeated (default: all that are "
                   "not passed)")
      ->check(one_of(names));
  CLI::Option* answers =
      add_input(*command, "--answers", arguments->answers,
                "Answers to the questions, a line each, instead of those of a person");
  command
      ->add_flag("--yes", arguments->yes,
                 "Agree to every question, the drive included: for a person with both hands at "
                 "the bench")
      ->excludes(answers);
  command->footer(
      "The amplifier is off but for the steps watchdog and drive, which say so. No daemon may use "
      "the devices. Exit status: 0 every step is passed; 1 one failed or is not done.");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command,
           {.examples = {{"Accept a bench, or take its acceptance up again",
                          "stickslip commission bench.toml"},
                         {"Repeat two steps",
                          "stickslip commission bench.toml --step polarity "
                          "--step drive"}},
            .files = {{"BENCH.commissioned/commissioned.json",
                       "What was found, which `stickslip check` compares with the bench"},
                      {"BENCH.commissioned/report.html", "The same as a page"},
                      {"BENCH.commissioned/delays.toml", "Measured delays, lines for the model"}},
            .see_also = {"stickslip-check(1)", "stickslip-doctor(1)", "stickslip-ctl(1)"}});
}

}  // namespace stickslip::commands
