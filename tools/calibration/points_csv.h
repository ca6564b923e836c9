// SPDX-License-Identifier: Apache-2.0
// Calibration points as CSV.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.h"

namespace stickslip::calibration {

/// Reads CSV with a header of the columns raw and reference_si and optionally raw_std
/// and reference_sigma, in any order; lines starting with '#' are comments. Throws InputError with
/// `name` and the line.
std::vector<config::CalibrationPoint> parse_points(std::string_view text, const std::string& name);

}  // namespace stickslip::calibration
