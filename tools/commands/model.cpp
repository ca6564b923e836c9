// SPDX-License-Identifier: Apache-2.0
// `stickslip model new`: asks about a rig and writes its model.
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "physics/frame.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_import.h"
#include "tools/commands/commands.h"
#include "tools/interview/commented_model.h"
#include "tools/interview/interview.h"
#include "tools/interview/questions.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace command_line;

namespace {

struct Arguments {
  std::map<std::string, std::string> answers;  ///< by option
  std::string recording;
  ImportOptions columns;
  std::string out = "my-rig.toml";
};

interview::Measured channels_of(const protocol::Recording& recording) {
  interview::Measured out{};
  for (Channel channel : all_channels) {
    out[index_of(channel)] = (recording.channels >> index_of(channel) & 1U) != 0;
  }
  return out;
}

std::optional<std::string> answer_to(const std::string& text) {
  terminal::print_page(text);
  std::fputs("> ", stdout);
  std::fflush(stdout);
  std::string line;
  if (std::getline(std::cin, line)) return line;
  std::fputs("\n", stdout);
  return std::nullopt;
}

bool is_person() { return ::isatty(STDIN_FILENO) == 1 && ::isatty(STDOUT_FILENO) == 1; }

interview::Setup setup_of(const Arguments& arguments) {
  interview::Setup out;
  for (const auto& [option, answer] : arguments.answers) {
    if (!answer.empty()) out.answers.emplace(option, answer);
  }
  if (!arguments.recording.empty()) {
    out.recorded = channels_of(recording_from(arguments.recording, arguments.columns));
  }
  if (is_person()) out.ask = answer_to;
  return out;
}

int run(const Arguments& arguments, const files::Outputs& outputs) {
  outputs.check(arguments.out);
  const interview::Draft draft = interview::interviewed(setup_of(arguments));
  // The file is there to be edited: its text does not name the command, which would allow a second
  // run to replace what an editor saved as a new file.
  outputs.write(arguments.out, files::Form::plain, interview::commented_model(draft));
  if (arguments.out == "-" || arguments.out == "/dev/stdout") return 0;
  const std::string recording = arguments.recording.empty() ? "RECORDING" : arguments.recording;
  terminal::print("%s: written; each number has a comment. Next:\n", arguments.out.c_str());
  terminal::print("  $ stickslip diagnose %s --model %s\n", recording.c_str(),
                  arguments.out.c_str());
  return 0;
}

void add_new(CLI::App& parent, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = parent.add_subcommand(
      "new",
      "Ask eight questions about a rig, or take the answers as options, and write its model");
  add_output(*command, "--out", arguments->out, "Model to write (TOML)")->capture_default_str();
  add_input(*command, "--recording", arguments->recording,
            "Recording (LCM event log or CSV) whose channels are the sensors");
  add_import_options(*command, arguments->columns);
  for (const interview::Question& question : interview::questions()) {
    const std::string name(question.option);
    CLI::Option* option =
        command->add_option(name, arguments->answers[name], std::string(question.help));
    if (name == "--excitation") option->check(one_of({"base", "force", "imposed"}));
  }
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
}

}  // namespace

void add_model(CLI::App& app, Action& action) {
  CLI::App* command = app.add_subcommand("model", "Write the model of a rig of your own");
  command->require_subcommand(1);
  add_new(*command, action);
  describe(*command,
           {.examples = {{"Answer eight questions; the channels of the recording are the sensors",
                          "stickslip model new --recording data.csv --out my-rig.toml"},
                         {"Without questions: a carriage on a screw, its motor force recorded",
                          "stickslip model new --excitation force --mass \"95 kg +- 5 %\" --spring "
                          "none --damping \"300 N s/m +- 50 %\" --load none --friction none "
                          "--sensors \"displacement 1e-5, drive_force 0.2\""}},
            .files = {recording_files, model_files},
            .see_also = {"stickslip-diagnose(1)", "stickslip-check(1)"}});
}

}  // namespace stickslip::commands
