// A calibration file on disk, renewed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "config/calibration.h"
#include "physics/frame.h"

namespace stickslip::calibration {

/// The calibration that holds for the channel in that file; nothing where there is no such file, or
/// no such channel in it. Throws InputError for a file that is not sound.
std::optional<config::ChannelCalibration> calibration_before(const std::filesystem::path& file,
                                                             Channel channel);

/// Replaces the file, in one step, by one in which the channel has the new calibration and the
/// former one stands in its history. Throws InputError where the file is not sound or cannot be
/// written.
void renew_calibration(const std::filesystem::path& file, Channel channel,
                       const config::ChannelCalibration& made);

/// Now, as calibration files have it: "2026-11-22T14:03:00Z".
std::string now_utc();

}  // namespace stickslip::calibration
