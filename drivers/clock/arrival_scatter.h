// SPDX-License-Identifier: Apache-2.0
// Uncertainty of the times of a device that transmits periodically, by itself, without a time.
#pragma once

#include <cstdint>

namespace stickslip::drivers {

/// A message is stamped with its arrival. How much later than evenly it arrives, with varying
/// delays of device, bus and host, is seen in the intervals: their scatter about multiples of the
/// period is that of two arrivals. A delay that is the same for all messages is not seen.
class ArrivalScatter {
 public:
  /// `nominal_ns`: period; the estimate stays within a quarter of it.
  explicit ArrivalScatter(std::int64_t nominal_ns)
      : nominal_ns_(static_cast<double>(nominal_ns)), period_ns_(nominal_ns_) {}

  /// The arrival of the latest message. Times do not decrease.
  void add(std::int64_t arrival_ns);
  /// Standard deviation of the arrivals over some 20 messages [ns]; 0 before the second.
  std::int64_t sigma_ns() const;

 private:
  double nominal_ns_;
  double period_ns_;
  std::int64_t last_ns_ = -1;
  double variance_ = 0.0;  // of an arrival [ns^2]
  int intervals_ = 0;
};

}  // namespace stickslip::drivers
