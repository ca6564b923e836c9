// SPDX-License-Identifier: Apache-2.0
// A bench as it is now against its acceptance.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "config/rig.h"
#include "physics/frame.h"
#include "tools/commissioning/record.h"

namespace stickslip::commissioning {

/// Settings that are others than those of the acceptance: "inputs.velocity.from is ... and was
/// ...".
std::vector<std::string> changed_settings(const Record& record, const config::Rig& rig);

/// Sentences about changed settings and about steps that were not passed. Empty: the acceptance is
/// whole, and of this bench.
std::vector<std::string> reservations(const Record& record, const config::Rig& rig);

/// A channel at rest, read now.
struct AtRest {
  Channel channel = Channel::displacement;
  double mean = 0.0;       ///< raw
  double deviation = 0.0;  ///< of single readings, raw
  std::size_t readings = 0;
};

/// Sentences about a zero that has moved by more than five standard deviations of a reading, and
/// about noise that has tripled.
std::vector<std::string> drifts(const Record& record, const AtRest& now);

}  // namespace stickslip::commissioning
