// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/page.h"

#include <string_view>
#include <vector>

#include "diagnosis/report/html.h"
#include "diagnosis/report/html_elements.h"
#include "physics/number_text.h"
#include "tools/commissioning/commissioning.h"

namespace stickslip::commissioning {

namespace {

using physics::number_text;
using report::code;
using report::escape_html;
using report::paragraph;

constexpr std::string_view delay_suffix = ".delay_s";

std::string verdict_of(const Record& record, const Step& step) {
  const StepRecord* found = record.find(step.id);
  return std::string(name_of(found == nullptr ? Verdict::not_done : found->verdict));
}

/// "2026-03-02T10:00:00Z" -> "2026-03-02 10:00".
std::string short_date(std::string date) {
  if (date.size() < 16) return date;
  date[10] = ' ';
  return date.substr(0, 16);
}

bool is_complete(const Record& record) {
  for (const Step& step : all_steps()) {
    const std::string verdict = verdict_of(record, step);
    if (verdict != "passed" && verdict != "not applicable") return false;
  }
  return true;
}

std::string first_of(const Record& record) {
  std::string out = "<h1>Acceptance of " + escape_html(record.rig) + "</h1>";
  out +=
      paragraph(is_complete(record) ? "Accepted: every step that applies to this bench is passed."
                                    : "Not accepted yet: steps below failed or are not done.");
  out += paragraph("Begun " + record.begun + " with stickslip " + record.program + ".");
  if (!record.devices.empty()) out += paragraph("Devices: " + record.devices + ".");
  for (const std::string& each : record.changes) out += paragraph(each);
  return out;
}

report::Section overview_of(const Record& record) {
  report::Section out("steps", "Steps");
  report::Table table("What was done, and what it found",
                      {"Step", "Result", "Date (UTC)", "Found", "What to do"});
  for (const Step& step : all_steps()) {
    const StepRecord* found = record.find(step.id);
    const std::string verdict = escape_html(verdict_of(record, step));
    const bool bad = verdict == "failed";
    table.row({escape_html(step.title), bad ? "<strong>" + verdict + "</strong>" : verdict,
               escape_html(found == nullptr ? "" : short_date(found->date)),
               escape_html(found == nullptr ? "" : found->text),
               escape_html(found == nullptr ? "" : found->remedy)});
  }
  out += table.html();
  return out;
}

report::Section measured_section(const Record& record) {
  report::Section out("measured", "Measured");
  for (const Step& step : all_steps()) {
    const StepRecord* found = record.find(step.id);
    if (found == nullptr || found->measured.empty()) continue;
    report::Table table(step.title, {"Quantity", "Value", "Standard uncertainty", "Unit"});
    for (const Measured& each : found->measured) {
      table.row({code(each.name), number_text(each.value, 5),
                 each.sigma ? number_text(*each.sigma, 2) : "", escape_html(each.unit)});
    }
    out += table.html();
  }
  return out;
}

report::Section settings_section(const Record& record) {
  report::Section out("settings", "Settings of the bench");
  report::Table table("Those of the acceptance", {"Key and value"});
  for (const auto& [key, value] : record.settings) table.row({code(key + " = " + value)});
  out += table.html();
  return out;
}

}  // namespace

std::string page_of(const Record& record) {
  std::vector<report::Section> sections = {overview_of(record), measured_section(record),
                                           settings_section(record)};
  std::erase_if(sections, [](const report::Section& each) { return each.empty(); });
  return report::html_page("Acceptance of " + record.rig, first_of(record), sections);
}

std::string delays_toml(const Record& record) {
  const StepRecord* found = record.find("delays");
  if (found == nullptr) return {};
  std::string out;
  for (const Measured& each : found->measured) {
    if (!each.name.ends_with(delay_suffix)) continue;
    const std::string stem = each.name.substr(0, each.name.size() - delay_suffix.size());
    out += "[sensors." + stem + "]\ndelay_s = { value = " + number_text(each.value, 4) +
           ", sigma = " + number_text(each.sigma.value_or(0.0), 3) + " }\n\n";
  }
  if (out.empty()) return {};
  return "# Delays of " + record.rig + " against its displacement, measured " + found->date +
         ".\n# Lines for its model; they are beyond the filters that it declares.\n\n" + out;
}

std::string summary_of(const Record& record) {
  std::string out;
  for (const Step& step : all_steps()) {
    std::string line = "  " + std::string(step.id);
    line.resize(20, ' ');
    out += line + verdict_of(record, step) + "\n";
  }
  return out;
}

}  // namespace stickslip::commissioning
