// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/record.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "physics/problem.h"
#include "protocol/json_text.h"
#include "tools/files/read_file.h"

namespace stickslip::commissioning {

namespace {

using nlohmann::ordered_json;

constexpr int schema = 1;
constexpr const char* kind = "commissioned bench";
constexpr std::array all_verdicts = {Verdict::passed, Verdict::failed, Verdict::not_done,
                                     Verdict::not_applicable};

Verdict verdict_named(const std::string& name) {
  for (const Verdict each : all_verdicts) {
    if (name_of(each) == name) return each;
  }
  return Verdict::not_done;
}

ordered_json json_of(const StepRecord& step) {
  ordered_json measured = ordered_json::array();
  for (const Measured& each : step.measured) {
    ordered_json one = {{"name", each.name}, {"value", each.value}, {"unit", each.unit}};
    if (each.sigma) one["sigma"] = *each.sigma;
    measured.push_back(std::move(one));
  }
  return {{"step", step.step},     {"verdict", name_of(step.verdict)},
          {"date", step.date},     {"text", step.text},
          {"remedy", step.remedy}, {"measured", measured}};
}

StepRecord step_from(const ordered_json& in) {
  StepRecord out{in.at("step"), verdict_named(in.at("verdict")), in.at("date"),
                 in.at("text"), in.value("remedy", ""),          {}};
  for (const ordered_json& each : in.at("measured")) {
    Measured one{each.at("name"), each.at("value"), {}, each.value("unit", "")};
    if (each.contains("sigma")) one.sigma = each.at("sigma").get<double>();
    out.measured.push_back(std::move(one));
  }
  return out;
}

Record record_from(const ordered_json& in) {
  Record out;
  out.rig = in.at("rig");
  out.program = in.value("program", "");
  out.begun = in.value("begun", "");
  out.devices = in.value("devices", "");
  for (const auto& [key, value] : in.at("settings").items()) out.settings.emplace_back(key, value);
  for (const ordered_json& each : in.value("changes", ordered_json::array())) {
    out.changes.push_back(each.get<std::string>());
  }
  for (const ordered_json& each : in.at("steps")) out.steps.push_back(step_from(each));
  return out;
}

}  // namespace

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::passed:
      return "passed";
    case Verdict::failed:
      return "failed";
    case Verdict::not_done:
      return "not done";
    case Verdict::not_applicable:
      return "not applicable";
  }
  return "";
}

std::optional<Measured> measured_of(const StepRecord& step, std::string_view name) {
  for (const Measured& each : step.measured) {
    if (each.name == name) return each;
  }
  return std::nullopt;
}

const StepRecord* Record::find(std::string_view step) const {
  const auto at = std::find_if(steps.begin(), steps.end(),
                               [step](const StepRecord& each) { return each.step == step; });
  return at == steps.end() ? nullptr : &*at;
}

void Record::put(StepRecord step) {
  std::erase_if(steps, [&step](const StepRecord& each) { return each.step == step.step; });
  steps.push_back(std::move(step));
}

std::string json_of(const Record& record) {
  ordered_json settings = ordered_json::object();
  for (const auto& [key, value] : record.settings) settings[key] = value;
  ordered_json steps = ordered_json::array();
  for (const StepRecord& each : record.steps) steps.push_back(json_of(each));
  const ordered_json all = {{"kind", kind},          {"schema", schema},
                            {"rig", record.rig},     {"program", record.program},
                            {"begun", record.begun}, {"devices", record.devices},
                            {"settings", settings},  {"changes", record.changes},
                            {"steps", steps}};
  return protocol::json_text(all) + "\n";
}

Record parse_record(const std::string& text, const std::string& file) {
  const auto refuse = [&file](const std::string& why) {
    throw InputError(Problem{file, 0, 0,
                             why + ": expected a file that `stickslip commission` wrote; move it "
                                   "away to begin anew"});
  };
  try {
    const ordered_json all = ordered_json::parse(text);
    if (all.value("kind", "") != kind) refuse("is no record of an acceptance");
    if (all.value("schema", 0) != schema) refuse("has another schema than 1");
    return record_from(all);
  } catch (const nlohmann::json::exception& error) {
    refuse(std::string("cannot be read (") + error.what() + ")");
  }
  return {};
}

std::optional<Record> load_record(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return std::nullopt;
  return parse_record(files::content_of(file), file.string());
}

std::filesystem::path folder_beside(const std::filesystem::path& rig_file) {
  std::filesystem::path out = rig_file;
  return out.replace_extension(".commissioned");
}

}  // namespace stickslip::commissioning
