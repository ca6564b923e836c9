// SPDX-License-Identifier: Apache-2.0
// A recording for the page: an index of it in memory, and any piece of it as the messages of the
// stream.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "protocol/progress_callback.h"
#include "tools/scope/wire.h"

namespace stickslip::scope {

/// Least and greatest values of every channel over equal spans of time, whose number is bounded:
/// when the recording outgrows them, neighbours become one.
class Overview {
 public:
  static constexpr std::size_t most = 2048;

  /// In order of time [ns since the first frame].
  void add(const Frame& frame, std::int64_t time_ns);

  std::int64_t step_ns() const { return step_ns_; }
  std::size_t size() const { return spans_.size(); }
  struct Span {
    std::array<float, channel_count> low;
    std::array<float, channel_count> high;  ///< lower than `low`: no values
  };
  const Span& operator[](std::size_t i) const { return spans_[i]; }

 private:
  void merge_neighbours();

  std::int64_t step_ns_ = 1'000'000;
  std::vector<Span> spans_;
};

/// Parts of a log that cannot be shown.
struct Unshown {
  std::int64_t damaged_bytes = 0;
  std::uint64_t undecoded = 0;     ///< messages
  std::uint64_t events = 0;        ///< beyond those kept
  std::int64_t cut_off_bytes = 0;  ///< at the end
};

/// An LCM event log. The index takes about 16 bytes for every 5000 frames.
class RecordingIndex {
 public:
  static constexpr std::size_t piece_frames = 5000;
  static constexpr std::int64_t piece_bytes = std::int64_t{8} << 20;
  static constexpr std::size_t most_events = 5000;

  /// Reads the whole log once. `marks`: of a model given by option, instead of the recorded ones.
  /// Throws InputError for a file that is no log or has no frames.
  RecordingIndex(std::filesystem::path file, std::vector<Mark> marks,
                 const protocol::ProgressCallback& done = {});

  /// Description, events, overview and the times of the pieces, as JSON.
  std::string summary() const;

  std::size_t pieces() const { return pieces_.size(); }
  /// The messages of a piece as the stream would send them, one after another: u32 size, u32 1 for
  /// a binary message and 0 for text, content; little-endian. Throws InputError if the file cannot
  /// be read any more.
  std::string piece(std::size_t number) const;

  const Unshown& unshown() const { return unshown_; }

 private:
  struct Piece {
    std::int64_t at = 0;        ///< first byte in the file
    std::int64_t first_ns = 0;  ///< time of its first frame
  };
  struct Dated {
    std::int64_t time_ns = 0;  ///< of the latest frame before it
    std::string json;
  };

  void take_block(std::span<const std::uint8_t> bytes, std::int64_t at);
  void take_event(std::span<const std::uint8_t> bytes);
  void take_description(std::span<const std::uint8_t> bytes);
  std::string bytes_of(std::size_t number) const;

  std::filesystem::path file_;
  std::vector<Mark> marks_;
  std::vector<Piece> pieces_;
  std::size_t frames_in_piece_ = 0;  ///< the last one
  std::vector<Dated> events_;
  std::vector<Dated> models_;
  Overview overview_;
  Unshown unshown_;
  std::uint64_t frames_ = 0;
  std::int64_t last_ns_ = 0;
  std::int64_t end_ = 0;  ///< of the last complete event
  std::vector<Frame> block_;
};

}  // namespace stickslip::scope
