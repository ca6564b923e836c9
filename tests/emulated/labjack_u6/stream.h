// SPDX-License-Identifier: Apache-2.0
// Stream of an emulated U6: a scan clock, a FIFO with overflow and recovery, and packets with
// faults.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

/// Faults of a packet of the stream.
enum class U6StreamFault : std::uint8_t {
  bad_checksum8,
  bad_checksum16,  ///< a sample is changed in transit
  short_packet,    ///< truncated after 40 bytes, or by 2 bytes if shorter
  lost,            ///< not sent, but counted by the packet counter
  repeated,        ///< sent twice
  stall,           ///< the endpoint stalls first; the packet follows clear_halt
};
inline constexpr std::size_t u6_stream_fault_kinds = 6;

struct U6StreamChannel {
  std::uint8_t channel = 0;
  bool differential = false;
  int gain_index = 0;
};

struct U6StreamConfig {
  std::vector<U6StreamChannel> channels;
  int resolution_index = 0;
  int samples_per_packet = 25;
  int settling = 0;
  double clock_hz = 4e6;  ///< nominal
  std::uint16_t interval = 1;
};

/// True values of a scan.
struct U6Scan {
  std::int64_t time_ns = 0;   ///< of its first channel, on the clock of the test
  std::vector<double> volts;  ///< at the inputs at their sampling times, without noise
  bool lost = false;          ///< FIFO overflow: not sent
};

/// A packet with a fault.
struct U6FaultyPacket {
  std::uint64_t packet = 0;  ///< counted from the start of the stream
  U6StreamFault fault = U6StreamFault::lost;
  std::uint64_t first_scan = 0;  ///< of its samples; a dummy scan counts as the next one
  std::uint64_t last_scan = 0;
};

class U6Stream {
 public:
  /// Counts of a channel at a time; sets `volts` to the input voltage.
  using Sampler =
      std::function<std::uint16_t(const U6StreamChannel&, std::int64_t time_ns, double& volts)>;

  static constexpr std::size_t fifo_samples = 984;

  U6Stream(Sampler sampler, std::uint64_t seed);

  void configure(const U6StreamConfig& config) { config_ = config; }
  bool configured() const { return config_.has_value(); }
  bool running() const { return running_; }
  /// `crystal_error`: relative; 1e-6 is fast by one part in a million.
  void start(std::int64_t now_ns, double crystal_error);
  void stop();
  void power_up();

  void sample_until(std::int64_t now_ns);
  /// The next complete packet. A scheduled stall sets `stalled`.
  std::optional<Bytes> next_packet();
  std::size_t samples_waiting() const { return fifo_.size(); }
  bool stalled() const { return stalled_; }
  void stall() { stalled_ = true; }
  void clear_halt() { stalled_ = false; }
  std::size_t packet_bytes() const;

  void schedule(U6StreamFault fault, std::uint64_t packet) { scheduled_[packet] = fault; }
  void chance(U6StreamFault fault, double probability) {
    chance_[static_cast<std::size_t>(fault)] = probability;
  }

  const std::vector<U6Scan>& scans() const { return scans_; }
  std::uint64_t scans_lost() const { return scans_lost_; }
  std::uint64_t recoveries() const { return recoveries_; }
  const std::vector<U6FaultyPacket>& faulty() const { return faulty_; }
  std::uint64_t packets() const { return packets_; }

 private:
  struct Sample {
    std::uint16_t counts = 0;
    std::uint64_t scan = 0;
    bool begins_dummy = false;
  };

  std::int64_t scan_time(std::uint64_t scan) const;
  void take_scan();
  void end_recovery();
  Bytes make_packet();
  std::optional<U6StreamFault> fault_of(std::uint64_t packet);
  bool apply(U6StreamFault fault, Bytes& packet);

  Sampler sampler_;
  std::mt19937_64 random_;
  std::optional<U6StreamConfig> config_;
  bool running_ = false;
  std::int64_t start_ns_ = 0;
  double interval_ns_ = 0.0;
  double sample_ns_ = 0.0;
  std::uint64_t next_scan_ = 0;
  std::deque<Sample> fifo_;
  bool recovering_ = false;
  std::uint64_t lost_now_ = 0;       // in the current recovery
  std::uint64_t lost_reported_ = 0;  // to be reported with the dummy scan
  std::uint8_t fatal_error_ = 0;     // reported once; then the stream ends
  bool stalled_ = false;
  std::uint64_t packets_ = 0;
  std::uint64_t first_of_packet_ = 0;
  std::uint64_t last_of_packet_ = 0;
  std::deque<Bytes> waiting_;  // packets to be sent
  std::map<std::uint64_t, U6StreamFault> scheduled_;
  double chance_[u6_stream_fault_kinds] = {};
  std::vector<U6Scan> scans_;
  std::uint64_t scans_lost_ = 0;
  std::uint64_t recoveries_ = 0;
  std::vector<U6FaultyPacket> faulty_;
};

}  // namespace stickslip::emulated
