// What a rig needs of its machine.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "config/rig.h"

namespace stickslip::doctor {

/// An LCM URL in its parts.
struct LcmUrl {
  std::string provider;  ///< "udpm"
  std::string address;   ///< "239.255.76.67"
  std::string port;
  int ttl = 0;                   ///< of udpm; LCM takes 0 where the URL does not say
  int receive_buffer_bytes = 0;  ///< 0: the machine's default
};

LcmUrl parse_lcm_url(const std::string& url);

struct Needs {
  std::string config_file;  ///< empty: no rig was named, and these are the defaults
  bool publishes = true;
  std::string lcm_url;
  double rate_hz = 1000.0;
  int frames_per_block = 10;
  bool real_time = true;  ///< the rig asks for real-time scheduling
  bool hardware = false;  ///< its channels come from devices
  bool records = false;
  std::filesystem::path recording_folder = "/var/lib/stickslip/recordings";
  std::filesystem::path control_socket = "/run/stickslip/control.sock";
  double latency_duration_s = 1.0;  ///< for how long wake-ups are measured

  double period_ns() const { return 1e9 / rate_hz; }
  /// Of a block of frames as LCM carries it.
  std::size_t block_bytes() const;
  /// Frames, estimate and excitation for each block.
  double messages_per_s() const { return 3.0 * rate_hz / frames_per_block; }
  double recorded_bytes_per_s() const;
};

/// Of a rig without a configuration, at the given LCM URL.
Needs needs_without_rig(const std::string& lcm_url);

Needs needs_of(const config::Rig& rig);

}  // namespace stickslip::doctor
