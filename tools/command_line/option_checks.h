// SPDX-License-Identifier: Apache-2.0
// Checks of option values.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "physics/spelling.h"

namespace stickslip::command_line {

/// A finite number that satisfies `condition`; `expected` completes "expected ...".
template <typename Condition>
CLI::Validator number_that(Condition condition, const std::string& expected) {
  return CLI::Validator(
      [condition, expected](std::string& text) {
        char* end = nullptr;
        const double value = std::strtod(text.c_str(), &end);
        const bool number = end != text.c_str() && *end == '\0' && std::isfinite(value);
        return number && condition(value) ? std::string()
                                          : "expected " + expected + ", found " + text;
      },
      "");
}

inline CLI::Validator finite_number() {
  return number_that([](double) { return true; }, "a finite number");
}
inline CLI::Validator positive_number() {
  return number_that([](double v) { return v > 0.0; }, "a finite number above 0");
}
inline CLI::Validator not_negative_number() {
  return number_that([](double v) { return v >= 0.0; }, "a finite number, 0 or more");
}
/// A probability below 1, and no smaller than a diagnosis accepts (diagnosis::invalid).
inline CLI::Validator probability() {
  return number_that([](double v) { return v >= 1.0e-9 && v < 1.0; },
                     "a number from 1e-9 to below 1");
}
/// One of these names; a misspelt one is answered with the one that was meant.
inline CLI::Validator one_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ",") + name;
  return CLI::Validator(
      [names, list](std::string& text) {
        if (std::find(names.begin(), names.end(), text) != names.end()) return std::string();
        const std::string meant = physics::nearest(text, names);
        return "expected one of " + list + ", found " + text +
               (meant.empty() ? "" : ": did you mean " + meant + "?");
      },
      "{" + list + "}");
}
/// Limits included.
inline CLI::Validator whole_number(double low, double high) {
  const auto text = [](double v) { return std::to_string(static_cast<long long>(v)); };
  return number_that([=](double v) { return v >= low && v <= high && v == std::floor(v); },
                     "a whole number from " + text(low) + " to " + text(high));
}
/// 0 (one per core) to 1024.
inline CLI::Validator number_of_threads() { return whole_number(0, 1024); }
/// Seed of a random sequence: 0 to 2^53.
inline CLI::Validator seed_number() { return whole_number(0, 9007199254740992.0); }

}  // namespace stickslip::command_line
