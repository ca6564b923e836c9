// SPDX-License-Identifier: Apache-2.0
// A command line as a manual page.
#include "tools/terminal/manual_page.h"

#include <gtest/gtest.h>

#include "tools/terminal/roff.h"

namespace stickslip::terminal {
namespace {

const Heading heading{"stickslip", 1, "1.2.3", "2026-01-02"};

struct Program {
  CLI::App app{"Tools for a rig.", "stickslip"};
  std::string text;
  std::vector<std::string> files;
  double number = 0.5;
  CLI::App* command = nullptr;

  Program() {
    app.footer("Exit status: 0 done; 2 bad arguments.");
    command = app.add_subcommand("log", "Check and repair recordings");
    command->add_option("files", files, "Logs")->required()->type_name("FILE...");
    command->add_option("-s,--speed", number, "Speed")->capture_default_str();
    command->add_option("--format", text, "Format")->check(CLI::IsMember({"csv", "lcm"}));
    command->add_option("--secret", text, "Internal")->group("");
    command->footer(".hidden files are taken, too. Exit status: 0 intact; 1 damaged.");
  }
};

std::string page_of_command() {
  Program program;
  Notes notes;
  notes.examples = {{"Check a log", "stickslip log -- a\\b.log"}};
  notes.environment = {{"NO_COLOR", "No colours"}};
  notes.files = {{"*.log", "Recordings"}};
  notes.see_also = {"stickslip(1)", "stickslipd(8)"};
  return page(*program.command, heading, notes, "of the program");
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(Roff, EscapesSpecialCharacters) {
  EXPECT_EQ(escaped("a-b \\ '~^`"), "a\\-b \\e \\(aq\\(ti\\(ha\\(ga");
  EXPECT_EQ(paragraph(".TH is no request\n.nor here"), "\\&.TH is no request\n\\&.nor here\n");
  EXPECT_EQ(paragraph("'quoted"), "\\(aqquoted\n");
}

TEST(Page, HasAllSectionsInTheirOrder) {
  const std::string text = page_of_command();
  std::size_t before = 0;
  for (const char* section : {".TH STICKSLIP\\-LOG 1 2026-01-02 \"stickslip 1.2.3\"", ".SH NAME",
                              ".SH SYNOPSIS", ".SH DESCRIPTION", ".SH OPTIONS", ".SH EXIT STATUS",
                              ".SH FILES", ".SH ENVIRONMENT", ".SH EXAMPLES", ".SH SEE ALSO"}) {
    const std::size_t at = text.find(section);
    ASSERT_NE(at, std::string::npos) << section << "\n" << text;
    EXPECT_GT(at, before) << section;
    before = at;
  }
  EXPECT_TRUE(contains(text, "stickslip\\-log \\- check and repair recordings\n")) << text;
}

TEST(Page, ListsOptionsWithValueAndDefault) {
  const std::string text = page_of_command();
  EXPECT_TRUE(
      contains(text, "\\fB\\-s\\fR, \\fB\\-\\-speed\\fR \\fINUMBER\\fR\nSpeed (default: 0.5).\n"))
      << text;
  EXPECT_TRUE(contains(text, "\\fB\\-\\-format\\fR \\fIcsv|lcm\\fR")) << text;
  EXPECT_TRUE(contains(text, "\\fBstickslip log\\fR [\\fIOPTIONS\\fR] \\fIFILE\\fR...\n")) << text;
  EXPECT_FALSE(contains(text, "secret"));
}

TEST(Page, MovesTheExitStatusFromTheFooterToItsOwnSection) {
  const std::string text = page_of_command();
  EXPECT_TRUE(
      contains(text,
               ".SH EXIT STATUS\n0 intact; 1 damaged.\n.PP\nOtherwise, as for all commands: of "
               "the program\n"))
      << text;
  EXPECT_TRUE(contains(text, "\\&.hidden files are taken, too.")) << text;
}

TEST(Page, OfTheProgramNamesItsCommands) {
  Program program;
  const std::string text = page(program.app, heading, {}, exit_status_of(program.app));
  EXPECT_TRUE(contains(text,
                       ".SH COMMANDS\n.TP\n\\fBlog\\fR\nCheck and repair recordings.\nSee "
                       "\\fBstickslip\\-log\\fR(1).\n"))
      << text;
  EXPECT_TRUE(contains(text, ".SH EXIT STATUS\n0 done; 2 bad arguments.\n")) << text;
}

TEST(Page, OfACommandContainsItsSubcommands) {
  Program program;
  CLI::App* below = program.command->add_subcommand("check", "Check every event");
  bool json = false;
  below->add_flag("--json", json, "As JSON");
  const std::string text = page(*program.command, heading, {}, "");
  EXPECT_TRUE(contains(text, ".SS check\n\\fBstickslip log check\\fR [\\fIOPTIONS\\fR]\n")) << text;
  EXPECT_TRUE(contains(text, "\\fB\\-\\-json\\fR\nAs JSON.\n")) << text;
  // The inherited footer and --help occur once.
  EXPECT_EQ(text.find("0 intact; 1 damaged"), text.rfind("0 intact; 1 damaged"));
  EXPECT_EQ(text.find("\\-\\-help"), text.rfind("\\-\\-help"));
}

TEST(Page, ShowsExamplesVerbatim) {
  EXPECT_TRUE(contains(page_of_command(), ".EX\n$ stickslip log \\-\\- a\\eb.log\n.EE\n"));
}

}  // namespace
}  // namespace stickslip::terminal
