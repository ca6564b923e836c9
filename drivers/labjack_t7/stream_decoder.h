// SPDX-License-Identifier: Apache-2.0
// Decoder of LabJack T7 stream packets into scans. Pure: no network, no clock.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/labjack_t7/protocol.h"

namespace stickslip::drivers::labjack_t7 {

inline constexpr int max_channels = 16;  ///< 14 inputs, and two that read the outputs back

/// One complete scan.
struct Scan {
  std::uint64_t index = 0;  ///< from the start of the stream, lost scans included
  std::array<std::uint16_t, max_channels> counts{};  ///< by position in the scan list
};

/// The connection loses nothing, but the board may: if its buffer is full it skips scans, and then
/// reports their number, and where they are missing by a scan of FFFF, which no analog input yields
/// otherwise. That scan is none. Packets are numbered modulo 65536; a gap counts as lost packets.
/// Every scan in the output is complete and has an exact index; once none can be given, there is no
/// further output.
class StreamDecoder {
 public:
  enum class Outcome : std::uint8_t {
    ok,           ///< completed scans, if any, are in scans()
    error,        ///< the packet holds an error (see status()); its samples are not used
    uncountable,  ///< an unknown number of scans was lost: the stream must be restarted
  };

  struct Counts {
    std::uint64_t packets = 0;
    std::uint64_t packets_lost = 0;     ///< by their numbers
    std::uint64_t overflows = 0;        ///< of the board's buffer
    std::uint64_t overflow_losses = 0;  ///< scans skipped by the board
    std::uint64_t scans = 0;            ///< decoded
    std::uint64_t scans_lost = 0;       ///< before the latest decoded one, for any reason
  };

  /// 1 to max_channels; `samples_per_packet` counts for lost packets.
  StreamDecoder(int channels, int samples_per_packet);

  /// Does not allocate.
  Outcome take(const StreamPacket& packet);
  /// Scans completed by the latest take, oldest first; valid until the next.
  std::span<const Scan> scans() const { return {scans_.data(), scan_count_}; }
  std::uint16_t status() const { return status_; }
  const Counts& counts() const { return counts_; }

 private:
  bool note_recovery(const StreamPacket& packet);
  void lose(std::uint64_t packets);
  bool put(std::uint16_t count);
  void complete();
  Outcome give_up();

  std::size_t channels_;
  std::size_t samples_per_packet_;
  std::vector<Scan> scans_;
  std::size_t scan_count_ = 0;
  Scan partial_;
  bool partial_whole_ = true;     // no sample of it was lost so far
  bool marker_ = false;           // it is a scan of FFFF
  std::size_t channel_ = 0;       // of the next sample
  std::uint64_t index_ = 0;       // of its scan
  std::uint64_t next_index_ = 0;  // after the latest decoded scan
  std::uint16_t next_packet_ = 0;
  bool overflowing_ = false;
  std::uint64_t skipped_ = 0;  // reported, and not yet marked
  bool uncountable_ = false;
  std::uint16_t status_ = 0;
  Counts counts_;
};

}  // namespace stickslip::drivers::labjack_t7
