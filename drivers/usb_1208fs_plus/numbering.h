// SPDX-License-Identifier: Apache-2.0
// Sequence numbers for the scans of a board that does not number them.
#pragma once

#include <cstdint>
#include <optional>

namespace stickslip::drivers::usb_1208fs_plus {

/// Consecutive scans have consecutive numbers. After a restart of the scan, the number of periods
/// between the two start commands follows from the host's clock, corrected for the drift of the
/// board's crystal, which is estimated from the minimum lateness of scans in each second. The
/// remaining error is the jitter of commands: less than a millisecond on a host that is not busy.
class Numbering {
 public:
  explicit Numbering(double period_s) : period_ns_(period_s * 1e9) {}

  /// The start command was sent at that time on the host's clock. Numbers begin with 0; a restart
  /// leaves a gap of at least one scan.
  void begin(std::int64_t host_ns);

  /// Number of the next scan, received or known to be lost.
  std::uint64_t take() { return next_++; }

  /// All scans numbered so far had arrived by that time.
  void arrived(std::int64_t host_ns);

 private:
  /// Increase of the lateness of scans since the start [ns].
  double drift_ns() const;

  double period_ns_;
  bool started_ = false;
  std::uint64_t next_ = 0;
  std::uint64_t first_ = 0;                    // number of the first scan since the start command
  double first_exact_ = 0.0;                   // the same, not rounded
  std::int64_t start_ns_ = 0;                  // time of the start command
  std::int64_t window_ns_ = 0;                 // start of the current second
  double min_lateness_ns_ = 0.0;               // in the current second
  std::optional<double> initial_lateness_ns_;  // minimum of the first second
  double last_lateness_ns_ = 0.0;              // minimum of the last complete second
};

}  // namespace stickslip::drivers::usb_1208fs_plus
