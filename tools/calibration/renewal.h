// SPDX-License-Identifier: Apache-2.0
// Insertion of a new calibration into a calibration file.
#pragma once

#include <string>

#include "config/calibration.h"
#include "physics/frame.h"

namespace stickslip::calibration {

/// The text of the file `name` with the new calibration of the channel, and the former one in its
/// history. `text` is the current content, empty if there is no file. The result has been parsed
/// again. Throws InputError if the old or the new text is not a valid calibration file.
std::string renewed(const std::string& text, const std::string& name, Channel channel,
                    const config::ChannelCalibration& calibration);

}  // namespace stickslip::calibration
