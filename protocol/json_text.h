// SPDX-License-Identifier: Apache-2.0
// JSON as text, for every report and message that a program writes once.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "physics/unsigned_zero.h"

namespace stickslip::protocol {

/// Removes the sign of every zero.
template <class Json>
void remove_signs_of_zeros(Json& value) {
  if (value.is_number_float()) {
    value = physics::unsigned_zero(value.template get<double>());
  } else if (value.is_structured()) {
    for (auto& each : value) remove_signs_of_zeros(each);
  }
}

/// The text of a value, indented by `indent` (-1: one line), without a newline at its end: a zero
/// has no sign, and bytes that are not UTF-8 are replaced.
template <class Json>
std::string json_text(Json value, int indent = 2) {
  remove_signs_of_zeros(value);
  return value.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace stickslip::protocol
