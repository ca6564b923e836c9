// SPDX-License-Identifier: Apache-2.0
// Decoder of LabJack U6 stream packets into scans. Pure: no USB, no clock.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace stickslip::drivers::labjack_u6 {

inline constexpr int max_channels = 25;
inline constexpr int max_samples_per_packet = 25;

/// One complete scan.
struct Scan {
  std::uint64_t index = 0;  ///< from the start of the stream, lost scans included
  std::array<std::uint16_t, max_channels> counts{};  ///< by position in the scan list
};

/// Scans straddle packets, packets get lost or corrupted, and a board reports only after a buffer
/// overflow how much it discarded. Every scan in the output is complete, consists of uncorrupted
/// samples, and has an exact index: losses are counted by the packet counter (modulo 256) and the
/// board's own report. Once neither can, there is no further output.
///
/// A contiguous loss of a multiple of 256 packets cannot be detected: one less than that multiple
/// is counted, or the next packet is taken for a repetition.
class StreamDecoder {
 public:
  enum class Outcome : std::uint8_t {
    ok,           ///< completed scans, if any, are in scans()
    damaged,      ///< corrupted packet; counts as lost
    repeated,     ///< repetition of the previous packet; dropped
    error,        ///< the packet holds an error code (see error()); its samples are not used
    uncountable,  ///< an unknown number of scans was lost: the stream must be restarted
  };

  struct Counts {
    std::uint64_t packets = 0;  ///< valid packets, without repetitions
    std::uint64_t damaged = 0;
    std::uint64_t repeated = 0;
    std::uint64_t packets_lost = 0;     ///< by the counter, including corrupted ones
    std::uint64_t overflows = 0;        ///< of the board's buffer
    std::uint64_t overflow_losses = 0;  ///< scans discarded by the board
    std::uint64_t scans = 0;            ///< decoded
    std::uint64_t scans_lost = 0;       ///< before the latest decoded one, for any reason
  };

  /// 1 to 25 each; samples_per_packet as in StreamConfig.
  StreamDecoder(int channels, int samples_per_packet);

  /// Length of every packet of this stream.
  std::size_t packet_bytes() const { return 14 + 2 * samples_per_packet_; }

  /// Decodes one packet. Does not allocate.
  Outcome take(std::span<const std::uint8_t> packet);
  /// Scans completed by the latest take, oldest first; valid until the next.
  std::span<const Scan> scans() const { return {scans_.data(), scan_count_}; }
  /// Error code in the latest valid packet.
  std::uint8_t error() const { return error_; }
  /// Fill level of the board's buffer after the latest valid packet; 256 would be full.
  std::uint8_t backlog() const { return backlog_; }
  const Counts& counts() const { return counts_; }

 private:
  using Samples = std::span<const std::uint8_t>;
  /// Samples of a packet that may be the dummy scan, [first, end); `end` may lie beyond the packet.
  struct Dummies {
    std::size_t first = 0;
    std::size_t end = 0;  // equal to first: none
    bool whole = false;   // one candidate lies completely in this packet
  };

  bool is_valid(std::span<const std::uint8_t> packet) const;
  Outcome take_samples(Samples samples, std::uint16_t scans_thrown_away);
  Outcome take_recovery(Samples samples, std::uint16_t scans_thrown_away);
  Dummies find_dummies(Samples samples) const;
  bool all_ones(Samples samples, std::size_t first, std::size_t end) const;
  std::uint16_t sample(Samples samples, std::size_t at) const;
  void skip(std::uint64_t samples);
  void put(std::uint16_t count);
  void complete();
  Outcome give_up();

  std::size_t channels_;
  std::size_t samples_per_packet_;
  std::array<Scan, max_samples_per_packet + 1> scans_{};
  std::size_t scan_count_ = 0;
  Scan partial_;
  bool partial_whole_ = true;     // no sample of it was lost so far
  std::size_t channel_ = 0;       // of the next sample
  std::uint64_t index_ = 0;       // of its scan
  std::uint64_t next_index_ = 0;  // after the latest decoded scan
  std::size_t dummy_rest_ = 0;    // outstanding samples of the dummy scan
  bool dummy_seen_ = false;       // another candidate was complete
  std::uint8_t next_counter_ = 0;
  bool started_ = false;
  bool overflowing_ = false;
  bool uncountable_ = false;
  std::uint8_t error_ = 0;
  std::uint8_t backlog_ = 0;
  Counts counts_;
};

}  // namespace stickslip::drivers::labjack_u6
