// A calibration file with a new calibration in it.
#pragma once

#include <string>

#include "config/calibration.h"
#include "physics/frame.h"

namespace stickslip::calibration {

/// The text of the file `name` once the channel has the new calibration and the former one stands
/// in its history; `text` is what the file holds now, empty where there is none. What comes back
/// has been read again. Throws InputError where the old or the new text is no sound calibration
/// file.
std::string renewed(const std::string& text, const std::string& name, Channel channel,
                    const config::ChannelCalibration& calibration);

}  // namespace stickslip::calibration
