// SPDX-License-Identifier: Apache-2.0
// Calibration files on disk.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "config/calibration.h"
#include "physics/frame.h"

namespace stickslip::calibration {

/// The current calibration of the channel; none if the file or the channel does not exist. Throws
/// InputError for an invalid file.
std::optional<config::ChannelCalibration> calibration_before(const std::filesystem::path& file,
                                                             Channel channel);

/// Atomically replaces the file by one in which the channel has the new calibration and the former
/// one is part of its history. Throws InputError if the file is invalid or cannot be written.
void renew_calibration(const std::filesystem::path& file, Channel channel,
                       const config::ChannelCalibration& made);

}  // namespace stickslip::calibration
