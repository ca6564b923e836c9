// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/manual_page.h"

#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <string_view>

#include "tools/terminal/command_tree.h"
#include "tools/terminal/roff.h"

namespace stickslip::terminal {

namespace {

constexpr std::string_view exit_status_label = "Exit status: ";

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string first_lower(std::string text) {
  const bool word = text.size() > 1 && std::islower(static_cast<unsigned char>(text[1])) != 0;
  if (word) text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
  return text;
}

std::string without_stop(std::string text) {
  while (!text.empty() && (text.back() == '.' || text.back() == '\n')) text.pop_back();
  return text;
}

/// "stickslip log check"
std::string invocation_of(const CLI::App& command) {
  std::string out = command.get_name();
  for (const CLI::App* above = command.get_parent(); above != nullptr;
       above = above->get_parent()) {
    out = above->get_name() + " " + out;
  }
  return out;
}

/// Placeholder of a value: "NUMBER", "FILE", "csv|lcm".
std::string placeholder_of(const CLI::Option& option) {
  std::string choices;
  for (const std::string& each : choices_of(option)) choices += (choices.empty() ? "" : "|") + each;
  if (!choices.empty()) return choices;
  const std::string type = option.get_type_name();  // with the descriptions of its checks
  std::string word = type.substr(0, type.find(':'));
  if (word.ends_with("...")) word.resize(word.size() - 3);
  if (word == "FLOAT" || word == "INT" || word == "UINT") return "NUMBER";
  return word.empty() ? "TEXT" : word;
}

bool takes_many(const CLI::Option& option) {
  return option.get_items_expected_max() > 1000 || option.get_expected_max() > 1000;
}

/// Placeholder of a positional argument: its name if the type is not specific.
std::string positional_of(const CLI::Option& option) {
  const std::string type = placeholder_of(option);
  return type == "TEXT" || type == "NUMBER" ? upper(option.get_name()) : type;
}

std::string synopsis_of(const CLI::App& command) {
  std::string out = bold(invocation_of(command));
  if (!visible_options(command, false).empty()) out += " [" + italic("OPTIONS") + "]";
  for (const CLI::Option* option : visible_options(command, false)) {
    if (!option->get_required()) continue;
    out += " " + bold(option->get_name()) + " " + italic(placeholder_of(*option));
  }
  for (const CLI::Option* option : visible_options(command, true)) {
    const std::string place = italic(positional_of(*option)) + (takes_many(*option) ? "..." : "");
    out += option->get_required() ? " " + place : " [" + place + "]";
  }
  if (!visible_subcommands(command).empty()) out += " " + italic("COMMAND") + " ...";
  return out + "\n";
}

/// Names and placeholder of an option, or the placeholder of a positional argument.
std::string option_tag(const CLI::Option& option) {
  if (option.get_positional()) {
    return italic(positional_of(option)) + (takes_many(option) ? "..." : "");
  }
  std::string out;
  for (const std::string& each : option.get_snames()) {
    out += (out.empty() ? "" : ", ") + bold("-" + each);
  }
  for (const std::string& each : option.get_lnames()) {
    out += (out.empty() ? "" : ", ") + bold("--" + each);
  }
  if (!takes_value(option)) return out;
  out += " " + italic(placeholder_of(option));
  const bool several = option.get_items_expected_min() > 1 && option.get_items_expected_max() < 100;
  return out + (several ? " ..." : "");
}

std::string option_text(const CLI::Option& option) {
  std::string text = option.get_description();
  if (text.empty()) text = "See above";
  if (option.get_required() && !option.get_positional()) text += " (required)";
  if (!option.get_default_str().empty() && takes_value(option)) {
    text += " (default: " + option.get_default_str() + ")";
  }
  return ".TP\n" + option_tag(option) + "\n" + paragraph(without_stop(text) + ".");
}

enum class HelpOption : std::uint8_t { listed, omitted };

std::string options_text(const CLI::App& command, HelpOption help) {
  std::string out;
  for (const bool positional : {true, false}) {
    for (const CLI::Option* each : visible_options(command, positional)) {
      if (help == HelpOption::listed || each != command.get_help_ptr()) out += option_text(*each);
    }
  }
  return out;
}

/// CLI11 copies the footer of a command to its subcommands; that copy is not their own.
std::string own_footer(const CLI::App& command) {
  const CLI::App* above = command.get_parent();
  const std::string footer = command.get_footer();
  return above != nullptr && above->get_footer() == footer ? "" : footer;
}

/// The footer up to its exit status.
std::string footer_text(const CLI::App& command) {
  const std::string footer = own_footer(command);
  const std::string text = footer.substr(0, footer.find(exit_status_label));
  return text.empty() ? "" : ".PP\n" + paragraph(text);
}

std::string commands_text(const CLI::App& command, const Heading& heading) {
  const bool is_program = command.get_parent() == nullptr;
  std::string out = ".SH COMMANDS\n";
  for (const CLI::App* each : visible_subcommands(command)) {
    if (is_program) {
      out += ".TP\n" + bold(each->get_name()) + "\n" +
             paragraph(without_stop(each->get_description()) + ".") + "See " +
             bold(heading.program + "-" + each->get_name()) + "(1).\n";
      continue;
    }
    out += ".SS " + escaped(each->get_name()) + "\n" + synopsis_of(*each) + ".PP\n" +
           paragraph(without_stop(each->get_description()) + ".") + footer_text(*each) +
           options_text(*each, HelpOption::omitted);
    const std::string status = exit_status_of(*each);
    if (!status.empty()) out += ".PP\n" + paragraph("Exit status: " + status);
  }
  return out;
}

std::string entries_text(const char* section, const std::vector<Notes::Entry>& list) {
  std::string out = list.empty() ? "" : std::string(".SH ") + section + "\n";
  for (const auto& [name, meaning] : list) {
    out += ".TP\n" + bold(name) + "\n" + paragraph(without_stop(meaning) + ".");
  }
  return out;
}

std::string examples_text(const std::vector<Notes::Example>& examples) {
  std::string out = examples.empty() ? "" : ".SH EXAMPLES\n";
  for (const Notes::Example& each : examples) {
    if (&each != examples.data()) out += ".PP\n";
    out += paragraph(without_stop(each.purpose) + ":") + ".PP\n.RS 4\n.EX\n" +
           paragraph("$ " + each.command) + ".EE\n.RE\n";
  }
  return out;
}

std::string see_also_text(const std::vector<std::string>& pages) {
  std::string out = pages.empty() ? "" : ".SH SEE ALSO\n";
  for (const std::string& each : pages) {
    const auto open = each.find('(');
    out += bold(each.substr(0, open)) + each.substr(open) + (&each == &pages.back() ? "\n" : ",\n");
  }
  return out;
}

}  // namespace

std::string page_name(const CLI::App& command, const Heading& heading) {
  return command.get_parent() == nullptr ? heading.program
                                         : heading.program + "-" + command.get_name();
}

std::string exit_status_of(const CLI::App& command) {
  const std::string footer = own_footer(command);
  const auto at = footer.find(exit_status_label);
  return at == std::string::npos ? "" : footer.substr(at + exit_status_label.size());
}

std::string page(const CLI::App& command, const Heading& heading, const Notes& notes,
                 const std::string& exit_status) {
  const std::string name = page_name(command, heading);
  std::string out = ".\\\" Made from the command line of " + heading.program + "; do not edit.\n";
  out += ".TH " + upper(escaped(name)) + " " + std::to_string(heading.section) + " " +
         heading.date + " \"" + heading.program + " " + heading.version + "\"\n";
  out += ".SH NAME\n" + escaped(name) + " \\- " +
         escaped(first_lower(without_stop(command.get_description()))) + "\n";
  out += ".SH SYNOPSIS\n" + synopsis_of(command);
  out += ".SH DESCRIPTION\n" + paragraph(without_stop(command.get_description()) + ".");
  if (!notes.description.empty()) out += ".PP\n" + paragraph(notes.description);
  out += footer_text(command);
  const std::string options = options_text(command, HelpOption::listed);
  if (!options.empty()) out += ".SH OPTIONS\n" + options;
  if (!visible_subcommands(command).empty()) out += commands_text(command, heading);
  const std::string own = exit_status_of(command);
  if (!own.empty() || !exit_status.empty()) out += ".SH EXIT STATUS\n";
  if (!own.empty()) out += paragraph(own);
  const bool both = !own.empty() && command.get_parent() != nullptr && !exit_status.empty();
  if (both) out += ".PP\n" + paragraph("Otherwise, as for all commands: " + exit_status);
  if (own.empty()) out += paragraph(exit_status);
  out += entries_text("FILES", notes.files);
  out += entries_text("ENVIRONMENT", notes.environment);
  out += examples_text(notes.examples);
  return out + see_also_text(notes.see_also);
}

std::string build_date() {
  const char* epoch = std::getenv("SOURCE_DATE_EPOCH");
  const std::time_t when = epoch != nullptr ? std::strtoll(epoch, nullptr, 10) : std::time(nullptr);
  std::tm utc{};
  if (gmtime_r(&when, &utc) == nullptr) return "1970-01-01";
  char text[16];
  return {text, std::strftime(text, sizeof text, "%Y-%m-%d", &utc)};
}

}  // namespace stickslip::terminal
