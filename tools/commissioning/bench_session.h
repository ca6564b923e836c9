// SPDX-License-Identifier: Apache-2.0
// The devices of a bench while it is accepted: open between the steps, and read only during one.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "config/rig.h"
#include "drivers/driver.h"
#include "physics/frame.h"

namespace stickslip::commissioning {

/// A read of the bench.
struct Moment {
  double time_s = 0.0;  ///< on the host's monotonic clock, since the run began
  /// Raw, without readings that were made before the run; none if nothing arrived.
  std::optional<Frame> frame{};
  drivers::Signals signals{};
  drivers::OutputReadings outputs{};
  std::array<std::int32_t, channel_count> age_sigma_us{};  ///< of the frame
};

/// The command after a read; nothing: no write at all, which a watchdog notices.
using Command = std::function<std::optional<drivers::Actuation>(double time_s)>;

/// Amplifier off, output at rest.
std::optional<drivers::Actuation> off(double time_s);

/// Why a run ended.
struct RunEnd {
  drivers::Outcome outcome = drivers::Outcome::ok;  ///< of the devices
  std::string message;  ///< unless that is ok; which device, and what to do
};

/// However a run ends, also by an exception, the amplifier is off and the bench stopped.
class BenchSession {
 public:
  /// `driver` is that of the rig, not open.
  BenchSession(std::unique_ptr<drivers::Driver> driver, const config::Rig& rig,
               std::stop_token stop);
  ~BenchSession();
  BenchSession(const BenchSession&) = delete;
  BenchSession& operator=(const BenchSession&) = delete;

  /// Opens the devices unless they are open. Empty, or the message of the one that fails.
  std::string open();
  void close();

  /// Reads and writes until `each` returns false, at most `longest_s`. Throws
  /// diagnosis::Interrupted on a request to stop.
  RunEnd run(double longest_s, const std::function<bool(const Moment&)>& each,
             const Command& command = off);

  /// Throws diagnosis::Interrupted on a request to stop.
  void wait(double seconds) const;

  const drivers::Description& description() const { return driver_->description(); }
  const config::Rig& rig() const { return rig_; }
  bool measures(Channel channel) const {
    return (description().channels >> index_of(channel) & 1U) != 0;
  }
  /// State of the amplifier's enable contact, by the input that reads it back; none if none does.
  std::optional<bool> contact_on(const drivers::OutputReadings& outputs) const;
  /// A raw value in SI, without crosstalk.
  double si(Channel channel, double raw) const;
  /// Readings, packets and scans that all devices have lost so far.
  std::uint64_t losses() const;
  /// A message if the last "off" was not confirmed; else empty.
  std::string left_on() const;

 private:
  std::unique_ptr<drivers::Driver> driver_;
  config::Rig rig_;
  std::stop_token stop_;
  bool open_ = false;
};

}  // namespace stickslip::commissioning
