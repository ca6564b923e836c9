// SPDX-License-Identifier: Apache-2.0
#include "daemon/recording_input.h"

#include <spdlog/spdlog.h>

namespace stickslip::daemon {

protocol::Recording recording_from(const std::filesystem::path& file) {
  protocol::Recording recording = protocol::read_recording(file);
  if (recording.cut_off_bytes > 0) spdlog::warn("{}", protocol::cut_off_warning(recording));
  return recording;
}

}  // namespace stickslip::daemon
