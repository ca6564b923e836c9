// Stream packets of a LabJack U6 in, scans out. Pure: no USB, no clock.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace stickslip::drivers::labjack_u6 {

inline constexpr int most_channels = 25;
inline constexpr int most_samples_per_packet = 25;

/// One whole scan.
struct Scan {
  std::uint64_t index = 0;  ///< from the start of the stream; those that were lost count
  std::array<std::uint16_t, most_channels> counts{};  ///< by place in the scan list
};

/// Samples straddle packets, packets get lost or damaged, and a board whose buffer overflows says
/// only afterwards how much it threw away. Every scan that comes out is whole and made of samples
/// that arrived undamaged, and its index is exact: what the packet counter (modulo 256) and the
/// board's own report can tell is counted. Where neither can, nothing comes out any more.
///
/// What it cannot see is a loss of a multiple of 256 packets in one piece: one less than that
/// multiple is counted, or the next packet is taken for a repetition.
class StreamDecoder {
 public:
  enum class Outcome : std::uint8_t {
    ok,           ///< its scans, if any was completed, are in scans()
    damaged,      ///< not a sound packet; counts as lost
    repeated,     ///< the packet before once more; dropped
    error,        ///< the board put an error in it (see error()); its samples are not used
    uncountable,  ///< scans were lost and nobody knows how many: the stream must be started again
  };

  struct Counts {
    std::uint64_t packets = 0;  ///< sound ones, repetitions not counted
    std::uint64_t damaged = 0;
    std::uint64_t repeated = 0;
    std::uint64_t packets_lost = 0;     ///< by the counter; damaged ones are among them
    std::uint64_t overflows = 0;        ///< of the board's buffer
    std::uint64_t overflow_losses = 0;  ///< scans that the board itself threw away
    std::uint64_t scans = 0;            ///< that came out
    std::uint64_t scans_lost = 0;       ///< before the last that came out, for whatever reason
  };

  /// 1 to 25 each; samples_per_packet as StreamConfig was told.
  StreamDecoder(int channels, int samples_per_packet);

  /// Of every packet of this stream.
  std::size_t packet_bytes() const { return 14 + 2 * samples_per_packet_; }

  /// Decodes one packet. Does not allocate.
  Outcome take(std::span<const std::uint8_t> packet);
  /// What the latest take completed, oldest first; valid until the next.
  std::span<const Scan> scans() const { return {scans_.data(), scan_count_}; }
  /// The board's error code in the latest sound packet.
  std::uint8_t error() const { return error_; }
  /// How full the board's buffer was after the latest sound packet; 256 would be full.
  std::uint8_t backlog() const { return backlog_; }
  const Counts& counts() const { return counts_; }

 private:
  using Samples = std::span<const std::uint8_t>;
  /// Samples of a packet that may be the dummy scan, from `first` to before `end`; `end` may lie
  /// beyond the packet.
  struct Dummies {
    std::size_t first = 0;
    std::size_t end = 0;  // equal to first: none
    bool whole = false;   // one of them lies in this packet with all its samples
  };

  bool sound(std::span<const std::uint8_t> packet) const;
  Outcome take_samples(Samples samples, std::uint16_t scans_thrown_away);
  Outcome take_recovery(Samples samples, std::uint16_t scans_thrown_away);
  Dummies find_dummies(Samples samples) const;
  bool all_ones(Samples samples, std::size_t first, std::size_t end) const;
  std::uint16_t sample(Samples samples, std::size_t at) const;
  void skip(std::uint64_t samples);
  void put(std::uint16_t count);
  void emit();
  Outcome give_up();

  std::size_t channels_;
  std::size_t samples_per_packet_;
  std::array<Scan, most_samples_per_packet + 1> scans_{};
  std::size_t scan_count_ = 0;
  Scan partial_;
  bool partial_whole_ = true;     // all of it so far has come
  std::size_t channel_ = 0;       // whose sample is next
  std::uint64_t index_ = 0;       // of the scan that it belongs to
  std::uint64_t next_index_ = 0;  // behind the last that came out
  std::size_t dummy_rest_ = 0;    // samples of the dummy scan that are still to come
  bool dummy_seen_ = false;       // that scan is not the only one that may be it
  std::uint8_t next_counter_ = 0;
  bool begun_ = false;
  bool overflowing_ = false;
  bool uncountable_ = false;
  std::uint8_t error_ = 0;
  std::uint8_t backlog_ = 0;
  Counts counts_;
};

}  // namespace stickslip::drivers::labjack_u6
