// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/renewal.h"

#include "physics/failure.h"
#include "physics/problem.h"

namespace stickslip::calibration {

std::string renewed(const std::string& text, const std::string& name, Channel channel,
                    const config::ChannelCalibration& calibration) {
  config::CalibrationFile file;
  if (!text.empty()) file = config::parse_calibration(text, name);
  config::renew(file, channel, calibration, name);
  std::string out = config::calibration_text(file);
  constexpr std::size_t largest_file = 1U << 20U;  // limit of configuration files
  if (out.size() > largest_file) {
    throw InputError(
        Problem{name, 0, 0,
                "would be larger than 1 MiB: move the oldest [[history]] tables into another "
                "file"});
  }
  if (config::parse_calibration(out, name) != file) {
    throw Failure(name + ": does not read back identically");
  }
  return out;
}

}  // namespace stickslip::calibration
