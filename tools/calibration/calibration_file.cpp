// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/calibration_file.h"

#include <system_error>

#include "config/document.h"
#include "tools/calibration/renewal.h"
#include "tools/files/write_file.h"

namespace stickslip::calibration {

using namespace files;
namespace {

std::string text_of(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return {};
  return config::read_text(file);
}

}  // namespace

std::optional<config::ChannelCalibration> calibration_before(const std::filesystem::path& file,
                                                             Channel channel) {
  const std::string text = text_of(file);
  if (text.empty()) return std::nullopt;
  return config::parse_calibration(text, file.string()).channel[index_of(channel)];
}

void renew_calibration(const std::filesystem::path& file, Channel channel,
                       const config::ChannelCalibration& made) {
  replace_file(file.string(), calibration::renewed(text_of(file), file.string(), channel, made));
}

}  // namespace stickslip::calibration
