// Calibrations and fits as a person reads them.
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

/// The points one a line, the line with its uncertainties, and what was looked for; ends with what
/// speaks against it, if anything does.
std::string fit_text(const LineFit& fit, std::span<const Point> points, Channel channel,
                     const std::string& raw_unit);

/// What changes: offset, gain and the largest difference over the points, with uncertainties;
/// `before` absent: there was none.
std::string change_text(const std::optional<config::ChannelCalibration>& before,
                        const config::ChannelCalibration& after, Channel channel);

/// A calibration of a channel in a few lines.
std::string calibration_words(const config::ChannelCalibration& calibration, Channel channel);

}  // namespace stickslip::calibration
