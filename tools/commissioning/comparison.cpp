// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/comparison.h"

#include <cmath>
#include <map>

#include "physics/number_text.h"
#include "tools/commissioning/commissioning.h"

namespace stickslip::commissioning {

namespace {

using physics::number_text;

constexpr double moved_deviations = 5.0;
constexpr double louder = 3.0;

void add_name(std::string& list, const char* name) {
  if (!list.empty()) list += ", ";
  list += name;
}

std::string shown(const std::string& value) { return value.empty() ? "absent" : value; }

}  // namespace

std::vector<std::string> changed_settings(const Record& record, const config::Rig& rig) {
  std::vector<std::string> out;
  std::map<std::string, std::pair<std::string, std::string>> values;
  for (const auto& [key, value] : record.settings) values[key].first = value;
  for (const auto& [key, value] : bench_settings(rig)) values[key].second = value;
  for (const auto& [key, each] : values) {
    if (each.first == each.second) continue;
    out.push_back(key + " is " + shown(each.second) + " and was " + shown(each.first));
  }
  return out;
}

std::vector<std::string> reservations(const Record& record, const config::Rig& rig) {
  std::vector<std::string> out;
  for (const std::string& each : changed_settings(record, rig)) {
    out.push_back(each + " when the bench was accepted: repeat the steps that it concerns");
  }
  std::string failed_steps;
  std::string missing;
  for (const Step& step : all_steps()) {
    const StepRecord* found = record.find(step.id);
    const Verdict verdict = found == nullptr ? Verdict::not_done : found->verdict;
    if (verdict == Verdict::failed) add_name(failed_steps, step.id);
    if (verdict == Verdict::not_done) add_name(missing, step.id);
  }
  if (!failed_steps.empty()) out.push_back("steps that failed: " + failed_steps);
  if (!missing.empty()) out.push_back("steps that are not done: " + missing);
  if (!failed_steps.empty() || !missing.empty()) {
    out.back() += "; stickslip commission takes the acceptance up again";
  }
  return out;
}

std::vector<std::string> drifts(const Record& record, const AtRest& now) {
  std::vector<std::string> out;
  const StepRecord* noise = record.find("noise");
  if (noise == nullptr || now.readings < 2) return out;
  const std::string stem(info(now.channel).stem);
  const auto zero = measured_of(*noise, stem + ".zero_raw");
  const auto before = measured_of(*noise, stem + ".noise_raw");
  if (!zero || !before) return out;
  const double deviation = before->value;
  if (std::abs(now.mean - zero->value) > moved_deviations * deviation) {
    out.push_back("the zero of " + stem + " is " + number_text(now.mean, 5) + " " + zero->unit +
                  " and was " + number_text(zero->value, 5) + " when the bench was accepted");
  }
  if (deviation > 0.0 && now.deviation > louder * deviation) {
    out.push_back("the noise of " + stem + " is " + number_text(now.deviation, 3) + " " +
                  zero->unit + " and was " + number_text(deviation, 3) +
                  " when the bench was accepted");
  }
  return out;
}

}  // namespace stickslip::commissioning
