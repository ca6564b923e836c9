// Points of a calibration as a table.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.h"

namespace stickslip::calibration {

/// Reads CSV with a header of the columns raw and reference_si and, where they are known, raw_std
/// and reference_sigma, in any order; lines that start with '#' are comments. Throws InputError,
/// naming `name` and the line, for what is wrong.
std::vector<config::CalibrationPoint> parse_points(std::string_view text, const std::string& name);

}  // namespace stickslip::calibration
