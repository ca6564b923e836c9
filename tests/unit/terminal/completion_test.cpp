// SPDX-License-Identifier: Apache-2.0
// Completion scripts of a small command line. tests/end_to_end/completion.py runs them in the
// shells.
#include "tools/terminal/completion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/terminal/command_tree.h"

namespace stickslip::terminal {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

struct Program {
  CLI::App app{"Tools for a rig.", "rigtool"};
  std::string text;
  double number = 0.0;
  bool flag = false;
  CLI::App* log = nullptr;

  Program() {
    log = app.add_subcommand("log", "Recordings: check [and] repair");
    log->add_option("file", text, "Log")->required();
    log->add_option("-f,--format", text, "Format")->check(CLI::IsMember({"csv", "lcm"}));
    log->add_option("--speed", number, "Factor");
    log->add_option("--key", text, "Key")->type_name("KEY");
    log->add_flag("--internal", flag, "Internal")->group("");
    CLI::App* check = log->add_subcommand("check", "Check it's intact");
    check->add_flag("--json", flag, "JSON");
    app.add_subcommand("secret", "Internal")->group("");
  }
  std::string script(Shell shell) const {
    return completion_script(shell, app, {{"KEY", {"loop.rate_hz", "loop.priority"}}});
  }
};

TEST(CommandTree, ExcludesHiddenCommandsAndOptions) {
  Program program;
  ASSERT_EQ(visible_subcommands(program.app).size(), 1U);
  EXPECT_EQ(visible_subcommands(program.app)[0], program.log);
  EXPECT_EQ(visible_options(*program.log, true).size(), 1U);
  for (const CLI::Option* option : visible_options(*program.log, false)) {
    EXPECT_NE(option->get_name(), "--internal");
  }
}

TEST(CommandTree, ListsTheChoicesOfAnOption) {
  Program program;
  EXPECT_THAT(choices_of(*program.log->get_option("--format")), ElementsAre("csv", "lcm"));
  EXPECT_THAT(choices_of(*program.log->get_option("--speed")), IsEmpty());
  EXPECT_TRUE(takes_value(*program.log->get_option("--speed")));
  EXPECT_FALSE(takes_value(*program.log->get_option("--internal")));
}

TEST(BashCompletion, OffersCommandsOptionsAndValues) {
  const std::string script = Program().script(Shell::bash);
  EXPECT_THAT(script, HasSubstr("_rigtool() {\n"));
  EXPECT_THAT(script, HasSubstr("complete -F _rigtool rigtool\n"));
  EXPECT_THAT(script, HasSubstr("' log' |\\\n      'log check')\n"));
  EXPECT_THAT(script, HasSubstr("    'log -f' | 'log --format') choices='csv lcm' ;;\n"));
  EXPECT_THAT(script, HasSubstr("    'log --speed') : ;;\n"));
  EXPECT_THAT(script, HasSubstr("    'log --key') choices='loop.rate_hz loop.priority' ;;\n"));
  EXPECT_THAT(script, HasSubstr("    'log') options='-h --help -f --format --speed --key' "
                                "choices='check' files=yes ;;\n"));
  EXPECT_THAT(script, Not(testing::ContainsRegex("@[A-Z]+@"))) << "unfilled placeholder";
  EXPECT_THAT(script, Not(HasSubstr("internal")));
}

TEST(ZshCompletion, HasOneFunctionPerCommand) {
  const std::string script = Program().script(Shell::zsh);
  EXPECT_THAT(script, HasSubstr("#compdef rigtool\n"));
  for (const char* name :
       {"\n_rigtool() {\n", "\n_rigtool_log() {\n", "\n_rigtool_log_check() {\n"}) {
    EXPECT_THAT(script, HasSubstr(name));
  }
  EXPECT_THAT(script, HasSubstr("'(-f --format)--format=[Format]:value:(csv lcm)'"));
  EXPECT_THAT(script, HasSubstr("'--speed=[Factor]:value: '"));
  EXPECT_THAT(script, HasSubstr("'log:Recordings\\: check \\[and\\] repair'")) << "escaped";
  EXPECT_THAT(script, HasSubstr("Check it'\\''s intact"));
}

TEST(FishCompletion, HasOneLinePerWord) {
  const std::string script = Program().script(Shell::fish);
  EXPECT_THAT(script, HasSubstr("complete -c rigtool -n '__fish_use_subcommand' -a 'log' -d "));
  EXPECT_THAT(script, HasSubstr("complete -c rigtool -n '__fish_seen_subcommand_from log; and not "
                                "__fish_seen_subcommand_from check' -F\n"));
  EXPECT_THAT(script, HasSubstr(" -s f -l format -x -a 'csv lcm' -d 'Format'\n"));
  EXPECT_THAT(script, HasSubstr("'__fish_seen_subcommand_from log; and __fish_seen_subcommand_from "
                                "check' -l json -d 'JSON'\n"));
}

}  // namespace
}  // namespace stickslip::terminal
