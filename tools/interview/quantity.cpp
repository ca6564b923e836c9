// SPDX-License-Identifier: Apache-2.0
#include "tools/interview/quantity.h"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "physics/number_text.h"

namespace stickslip::interview {

namespace {

/// A number and the text behind it.
struct Part {
  double value = 0.0;
  std::string_view unit;
};

std::optional<Part> part_in(std::string_view text) {
  text = trimmed(text);
  Part out;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out.value);
  if (error != std::errc() || !std::isfinite(out.value)) return std::nullopt;
  out.unit = trimmed(text.substr(static_cast<std::size_t>(end - text.data())));
  return out;
}

/// The texts before and behind "+-", "+/-" or the sign itself.
struct Halves {
  std::string_view value;
  std::optional<std::string_view> sigma;
};

Halves halves_of(std::string_view text) {
  for (const std::string_view sign : {"+-", "+/-", "\u00b1"}) {
    const std::size_t at = text.find(sign);
    if (at != std::string_view::npos) return {text.substr(0, at), text.substr(at + sign.size())};
  }
  return {text, std::nullopt};
}

const Unit* unit_named(std::string_view name, std::span<const Unit> units) {
  for (const Unit& unit : units) {
    if (unit.name == name) return &unit;
  }
  return nullptr;
}

std::string names_of(std::span<const Unit> units) {
  std::string out;
  for (const Unit& unit : units) {
    if (unit.name.empty()) continue;
    out.append(out.empty() ? "" : " or ").append(unit.name);
  }
  return out;
}

/// Without the last bits of a conversion: 0.06, not 0.060000000000000005.
double rounded(double value) {
  return std::strtod(physics::number_text(value, 12).c_str(), nullptr);
}

Quantity refused(const std::string& expected, std::string_view found) {
  Quantity out;
  out.problem.append(expected).append(", found \"").append(found).append("\"");
  return out;
}

/// Standard deviation in SI; none if its text is no number of that unit.
std::optional<double> sigma_in(std::string_view text, const Part& value, const Unit& unit,
                               std::span<const Unit> units) {
  const std::optional<Part> part = part_in(text);
  if (!part || part->value < 0.0) return std::nullopt;
  if (part->unit == "%") return rounded(std::abs(value.value) * unit.factor * part->value / 100.0);
  const Unit* own = part->unit.empty() ? &unit : unit_named(part->unit, units);
  if (own == nullptr || own->kind != unit.kind) return std::nullopt;
  return rounded(part->value * own->factor);
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blank = " \t\r";
  const std::size_t first = text.find_first_not_of(blank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blank) - first + 1);
}

Quantity quantity_in(std::string_view text, std::span<const Unit> units) {
  const Halves halves = halves_of(text);
  const std::optional<Part> value = part_in(halves.value);
  if (!value) return refused("a number", trimmed(text));
  std::string_view name = value->unit;
  if (name.empty() && halves.sigma) {
    const std::optional<Part> sigma = part_in(*halves.sigma);
    if (sigma && sigma->unit != "%") name = sigma->unit;
  }
  const Unit* unit = unit_named(name, units);
  if (unit == nullptr) return refused("a number in " + names_of(units), trimmed(text));
  Quantity out;
  out.kind = unit->kind;
  out.parameter.value = rounded(value->value * unit->factor);
  if (!halves.sigma) {
    out.parameter.sigma =
        rounded(std::abs(out.parameter.value) * unit->usual_sigma_percent / 100.0);
    return out;
  }
  const std::optional<double> sigma = sigma_in(*halves.sigma, *value, *unit, units);
  if (!sigma) return refused("a standard deviation behind +-, 0 or more", trimmed(text));
  out.parameter.sigma = *sigma;
  return out;
}

}  // namespace stickslip::interview
