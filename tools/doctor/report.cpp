// SPDX-License-Identifier: Apache-2.0
#include "tools/doctor/report.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>

#include "physics/number_text.h"
#include "protocol/json_text.h"
#include "tools/doctor/examination.h"

namespace stickslip::doctor {

namespace {

using physics::counted;

terminal::Tone tone_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::ok:
      return terminal::Tone::good;
    case Verdict::note:
      return terminal::Tone::note;
    case Verdict::warn:
      return terminal::Tone::warning;
    case Verdict::fail:
      return terminal::Tone::bad;
  }
  return terminal::Tone::plain;
}

}  // namespace

std::string text(const std::vector<Finding>& findings, const terminal::Paint& paint) {
  std::size_t width = 0;
  for (const Finding& each : findings) width = std::max(width, each.check.size());
  std::array<std::size_t, 4> counts{};
  std::string out;
  for (const Finding& each : findings) {
    ++counts[static_cast<std::size_t>(each.verdict)];
    const std::string verdict(name_of(each.verdict));
    std::string check = each.check;
    check.resize(width + 2, ' ');
    out += paint(tone_of(each.verdict), verdict) + std::string(6 - verdict.size(), ' ') + check +
           each.found + '\n';
    if (!each.command.empty()) out += std::string(6 + width + 2, ' ') + "$ " + each.command + '\n';
  }
  return out + std::to_string(counts[0]) + " ok, " + counted(counts[1], "note") + ", " +
         counted(counts[2], "warning") + ", " + counted(counts[3], "failure") + '\n';
}

std::string json(const std::vector<Finding>& findings) {
  using Json = nlohmann::ordered_json;
  Json checks = Json::array();
  for (const Finding& each : findings) {
    checks.push_back({{"check", each.check},
                      {"verdict", name_of(each.verdict)},
                      {"found", each.found},
                      {"command", each.command.empty() ? Json() : Json(each.command)}});
  }
  const Json report = {
      {"schema", 1}, {"verdict", name_of(worst(findings))}, {"checks", std::move(checks)}};
  return protocol::json_text(report) + '\n';
}

}  // namespace stickslip::doctor
