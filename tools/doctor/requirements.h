// SPDX-License-Identifier: Apache-2.0
// Requirements that a rig places on its host.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/lcm_url.h"
#include "config/rig.h"

namespace stickslip::doctor {

using config::LcmUrl;
using config::parse_lcm_url;

/// A serial line with Modbus units.
struct ModbusLine {
  std::string port;            ///< as configured: "/dev/ttyUSB0"
  double poll_period_s = 0.0;  ///< shortest of its units
};

/// A board on Ethernet.
struct NetworkBoard {
  std::string name;  ///< "LabJack T7"
  std::string host;
  int port = 0;
};

struct Requirements {
  std::string config_file;  ///< empty: no rig is given, and these are the defaults
  bool publishes = true;
  std::string lcm_url;
  double rate_hz = 1000.0;
  int frames_per_block = 10;
  bool real_time = true;  ///< the rig uses real-time scheduling
  bool hardware = false;  ///< its channels come from devices on buses of this host
  std::optional<NetworkBoard> network_board;
  bool records = false;
  std::filesystem::path recording_folder = "/var/lib/stickslip/recordings";
  std::vector<ModbusLine> modbus_lines;
  std::filesystem::path control_socket = "/run/stickslip/control.sock";
  double latency_duration_s = 1.0;  ///< duration of the wake-up measurement

  double period_ns() const { return 1e9 / rate_hz; }
  /// Size of a block of frames with the header of LCM.
  std::size_t block_bytes() const;
  /// Rate of messages: frames, estimate and excitation for each block.
  double messages_per_s() const { return 3.0 * rate_hz / frames_per_block; }
  double recorded_bytes_per_s() const;
};

/// Requirements without a rig file, at the given LCM URL.
Requirements default_requirements(const std::string& lcm_url);

Requirements requirements_of(const config::Rig& rig);

}  // namespace stickslip::doctor
