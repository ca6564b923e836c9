// SPDX-License-Identifier: Apache-2.0
// Calibrations and fits as text.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "config/calibration.h"
#include "physics/frame.h"
#include "tools/calibration/line_fit.h"

namespace stickslip::calibration {

/// A number with four significant digits.
std::string short_number(double value);

/// The points, one per line, the fitted line with its uncertainties, and the tests; ends with the
/// objections, if any.
std::string fit_text(const LineFit& fit, std::span<const Point> points, Channel channel,
                     const std::string& raw_unit);

/// The change: offset, gain and the largest difference over the points, with uncertainties.
std::string change_text(const std::optional<config::ChannelCalibration>& before,
                        const config::ChannelCalibration& after, Channel channel);

/// A calibration of a channel in a few lines.
std::string calibration_words(const config::ChannelCalibration& calibration, Channel channel);

}  // namespace stickslip::calibration
