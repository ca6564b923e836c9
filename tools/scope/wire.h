// What the server tells a page: LCM's messages as the WebSocket carries them. docs/scope.md lists
// them; fields have the names and units of protocol/lcm/. Pure functions: the same message in, the
// same bytes out.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stickslip/event_t.hpp>
#include <stickslip/excitation_t.hpp>
#include <stickslip/friction_estimate_t.hpp>
#include <stickslip/status_t.hpp>
#include <stickslip/timing_t.hpp>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "physics/model.h"
#include "tools/scope/message.h"

namespace stickslip::scope {

/// What is said of a block of frames beside the frames.
struct BlockNotes {
  bool degraded = false;          ///< timing was out of its limits while it was taken
  bool history = false;           ///< it is from before the page joined
  double received_unix_ms = 0.0;  ///< when LCM handed it over [ms since 1970, UTC]
};

/// Bytes of an encoded block: a header, and 8 bytes for each number.
inline constexpr std::size_t block_header_bytes = 16;
inline constexpr std::size_t frame_bytes = 8 * (2 + channel_count);

/// A block of frames, binary, little-endian:
///   u8 1; u8 flags (bit 0 degraded, bit 1 history); u16 number of channels; u32 n;
///   f64 received_unix_ms; i64 time_ns[n]; i64 sequence[n]; f64 value[channels][n]
/// where a value that is no measurement is NaN.
Message encode_frames(std::span<const Frame> frames, const BlockNotes& notes);

/// The first message to each page. `history_s`: how far back the frames go that follow.
Message encode_hello(const std::string& version, double history_s, const std::string& url);

/// A known frequency of the rig, to be marked in a spectrum.
struct Mark {
  std::string name;
  double hz = 0.0;
  friend bool operator==(const Mark&, const Mark&) = default;
};

/// The frequencies that a model declares: that of the oscillator, of the load cell, of a bending
/// mode. Those that it does not declare are left out.
std::vector<Mark> marks_of(const physics::Model& model);

Message encode_model(const std::string& rig, const std::vector<Mark>& marks);

Message encode_estimate(const friction_estimate_t& estimate);

/// `time_ns` holds the time of each frame of the message, oldest first, the last of them that of
/// the message itself; a time that is not known is left out together with its frame.
Message encode_excitation(const excitation_t& excitation,
                          std::span<const std::optional<std::int64_t>> time_ns);

Message encode_status(const status_t& status);
Message encode_timing(const timing_t& timing);
Message encode_event(const event_t& event);

/// Whether frames are coming. `silent_s`: for how long none came.
Message encode_source(bool connected, double silent_s);

/// To one client: it missed so many messages because it was slow.
Message encode_dropped(std::uint64_t messages);

/// Time or sequence began anew: what a page has drawn is of an earlier run.
Message encode_restart();

}  // namespace stickslip::scope
