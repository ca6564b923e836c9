#include "tools/doctor/report.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>

#include "tools/doctor/examination.h"

namespace stickslip::doctor {

std::string text(const std::vector<Finding>& findings) {
  std::size_t width = 0;
  for (const Finding& each : findings) width = std::max(width, each.check.size());
  std::array<std::size_t, 4> counts{};
  std::string out;
  for (const Finding& each : findings) {
    ++counts[static_cast<std::size_t>(each.verdict)];
    std::string line(name_of(each.verdict));
    line.resize(6, ' ');
    line += each.check;
    line.resize(6 + width + 2, ' ');
    out += line + each.found + '\n';
    if (!each.command.empty()) out += std::string(6 + width + 2, ' ') + "$ " + each.command + '\n';
  }
  return out + std::to_string(counts[0]) + " ok, " + std::to_string(counts[1]) + " notes, " +
         std::to_string(counts[2]) + " warnings, " + std::to_string(counts[3]) + " failures\n";
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
  // Paths and names of the machine may hold any bytes.
  return report.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace stickslip::doctor
