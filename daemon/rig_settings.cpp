// SPDX-License-Identifier: Apache-2.0
#include "daemon/rig_settings.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string_view>

namespace stickslip::daemon {
namespace {

std::int64_t ns_of(double seconds) { return std::llround(seconds * 1e9); }

InterlockSettings interlock_settings(const config::Rig& rig, const drivers::Description& device) {
  const config::Safety& safety = rig.safety;
  InterlockSettings out;
  // A recording may have gaps, a device may not. A rig whose time waits for the host misses nothing
  // while the host is late.
  const double silence_s = rig.driver == config::DriverKind::replay ? 0.0 : 0.1;
  const double overrun_s = device.stepped_time ? 0.0 : 0.05;
  out.longest_silence_ns = ns_of(safety.longest_silence_s.value_or(silence_s));
  out.longest_overrun_ns = ns_of(safety.longest_overrun_s.value_or(overrun_s));
  out.stale_after_ns = ns_of(safety.stale_after_s);
  out.dead_man_ns = ns_of(safety.dead_man_s);
  out.not_finite = safety.not_finite;
  out.observer_diverged = safety.observer_diverged;
  out.recorder_failing = safety.recorder_failing;
  for (std::size_t i = 0; i < channel_count; ++i) {
    out.range[i] = {safety.range[i].low, safety.range[i].high};
  }
  return out;
}

}  // namespace

StreamSettings stream_settings(const config::Rig& rig, Pacing pacing) {
  StreamSettings out;
  out.frames_per_block = static_cast<std::size_t>(std::max(1, rig.loop.frames_per_block));
  out.ring_frames =
      std::max<std::size_t>(16384, static_cast<std::size_t>(std::ceil(rig.loop.rate_hz * 10.0)));
  // Free running, a frame never waits long, and blocks are the same in every run.
  if (pacing == Pacing::free_running) out.longest_wait = std::chrono::hours(1);
  return out;
}

LoopSettings loop_settings(const config::Rig& rig, const drivers::Description& device,
                           Pacing pacing) {
  LoopSettings out;
  out.period_ns = std::llround(1e9 / rig.loop.rate_hz);
  out.pacing = pacing;
  if (rig.loop.duration_s) {
    out.frames = static_cast<std::uint64_t>(std::llround(*rig.loop.duration_s * rig.loop.rate_hz));
  }
  out.ramp_s = rig.excitation.enabled ? rig.excitation.ramp_s : 0.0;
  out.frames_per_estimate = static_cast<std::uint64_t>(std::max(1, rig.loop.frames_per_block));
  out.live = live_settings(rig, device);
  out.start_at_once = rig.control.start_at_once;
  out.end_on_fault = rig.safety.exit_on_fault;
  if (rig.loop.lateness_limit_s) out.lateness_limit_ns = ns_of(*rig.loop.lateness_limit_s);
  return out;
}

LiveSettings live_settings(const config::Rig& rig, const drivers::Description& device) {
  return {Calibration(rig.calibration), interlock_settings(rig, device)};
}

std::optional<Setting> setting_change(const config::Change& change, const config::Rig& now) {
  constexpr std::string_view table = "excitation.";
  if (!change.key.starts_with(table)) return std::nullopt;
  const auto tunable = tunable_named(std::string_view(change.key).substr(table.size()));
  if (!tunable) return std::nullopt;
  switch (*tunable) {
    case Tunable::carrier_hz:
      return Setting{*tunable, now.excitation.carrier_hz};
    case Tunable::amplitude:
      return Setting{*tunable, now.excitation.amplitude};
    case Tunable::modulation_hz:
      return Setting{*tunable, now.excitation.modulation_hz};
    case Tunable::modulation_depth:
      return Setting{*tunable, now.excitation.modulation_depth};
  }
  return std::nullopt;
}

std::filesystem::path control_socket(const config::Rig& rig) {
  if (!rig.control.socket.empty()) return rig.control.socket;
  const char* const folder = std::getenv("RUNTIME_DIRECTORY");  // set by systemd
  return folder == nullptr ? std::filesystem::path()
                           : std::filesystem::path(folder) / "control.sock";
}

}  // namespace stickslip::daemon
