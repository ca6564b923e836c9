// SPDX-License-Identifier: Apache-2.0
// The latest frames, for clients that join later, and their times of measurement.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "physics/frame.h"
#include "tools/scope/message.h"
#include "tools/scope/wire.h"

namespace stickslip::scope {

/// The frames of the last seconds of device time as messages. Full chunks are encoded once and
/// shared by all clients that join.
class FrameHistory {
 public:
  /// Frames in one message.
  static constexpr std::size_t chunk_frames = 1000;

  /// `length_s`: 0 or more. `max_bytes` bounds the size, whatever the times of the frames.
  FrameHistory(double length_s, std::size_t max_bytes);

  /// Appends frames, in order of time; gaps are kept as they are.
  void add(std::span<const Frame> frames, bool degraded, double received_unix_ms);
  void clear();

  /// All messages, oldest first, marked as history.
  std::vector<SharedMessage> messages() const;

  /// Present size in bytes; at most `max_bytes` and one chunk.
  std::size_t bytes() const { return bytes_ + open_.size() * frame_bytes; }

 private:
  struct Chunk {
    SharedMessage message;
    std::int64_t last_time_ns = 0;
  };

  void close_chunk();
  void forget_old();

  std::int64_t length_ns_;
  std::size_t max_bytes_;
  std::deque<Chunk> chunks_;
  std::vector<Frame> open_;  ///< not yet a chunk
  BlockNotes open_notes_;
  std::size_t bytes_ = 0;  ///< of the chunks
};

/// Times of measurement of the latest frames by sequence number.
class FrameTimes {
 public:
  FrameTimes();

  void add(const Frame& frame);
  void clear();

  /// Time [ns] of the frame with that number: exact if the frame was received, else extrapolated
  /// from the frame `reference` by the period of the latest two frames. None before two frames were
  /// received.
  std::optional<std::int64_t> time_ns(std::uint64_t sequence, std::uint64_t reference,
                                      std::int64_t reference_time_ns) const;

 private:
  struct Entry {
    std::uint64_t sequence = 0;
    std::int64_t time_ns = 0;
    bool known = false;
  };

  std::vector<Entry> entries_;  ///< by sequence number modulo their count
  std::optional<Entry> latest_;
  double period_ns_ = 0.0;  ///< 0: unknown
};

}  // namespace stickslip::scope
