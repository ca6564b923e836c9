// SPDX-License-Identifier: Apache-2.0
// The messages of the WebSocket, encoded from LCM messages. docs/scope.md lists them; fields have
// the names and units of protocol/lcm/.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stickslip/event_t.hpp>
#include <stickslip/excitation_t.hpp>
#include <stickslip/friction_estimate_t.hpp>
#include <stickslip/recorder_t.hpp>
#include <stickslip/status_t.hpp>
#include <stickslip/timing_t.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"
#include "physics/model.h"
#include "tools/scope/message.h"

namespace stickslip::scope {

/// Attributes of a block of frames.
struct BlockNotes {
  bool degraded = false;          ///< timing limits were violated during the block
  bool history = false;           ///< older than the connection of the page
  double received_unix_ms = 0.0;  ///< time of receipt [ms since 1970, UTC]
};

/// Bytes of an encoded block: a header, and 8 bytes for each number.
inline constexpr std::size_t block_header_bytes = 16;
inline constexpr std::size_t frame_bytes = 8 * (2 + channel_count);

/// A block of frames, binary, little-endian:
///   u8 1; u8 flags (bit 0 degraded, bit 1 history); u16 number of channels; u32 n;
///   f64 received_unix_ms; i64 time_ns[n]; i64 sequence[n]; f64 value[channels][n]
/// with NaN for values that were not measured.
Message encode_frames(std::span<const Frame> frames, const BlockNotes& notes);

/// The first message to each page: this server and its abilities.
struct Greeting {
  std::string version = {};
  double history_s = 0.0;  ///< length of the history that follows
  std::string url = {};    ///< of LCM
  bool notes = false;      ///< notes are taken
  bool recording = false;  ///< a recording is shown, which the page asks for
};
Message encode_hello(const Greeting& greeting);

/// The text of a note from a page, {"note": TEXT}; nothing if it is not one.
std::optional<std::string> decode_note(std::string_view text);
/// The answer to it. `refusal`: why it was not taken; empty if it was.
Message encode_note_answer(const std::string& refusal);

/// A known frequency of the rig, marked in spectra.
struct Mark {
  std::string name;
  double hz = 0.0;
  friend bool operator==(const Mark&, const Mark&) = default;
};

/// The declared frequencies of a model: oscillator, load cell, further modes.
std::vector<Mark> marks_of(const physics::Model& model);

Message encode_model(const std::string& rig, const std::vector<Mark>& marks);

Message encode_estimate(const friction_estimate_t& estimate);

/// `time_ns`: time of each frame of the message, oldest first, the last that of the message itself.
/// Frames of unknown time are omitted.
Message encode_excitation(const excitation_t& excitation,
                          std::span<const std::optional<std::int64_t>> time_ns);

Message encode_status(const status_t& status);
Message encode_timing(const timing_t& timing);
Message encode_recorder(const recorder_t& recorder);
Message encode_event(const event_t& event);

/// `connected`: frames are arriving. `silent_s`: time since the last one.
Message encode_source(bool connected, double silent_s);

/// Sent regularly, so that a page can distinguish a silent rig from a dead link. `status_s`: time
/// since the latest status.
Message encode_alive(bool connected, double silent_s, std::optional<double> status_s);

/// A rig that publishes, or did until a moment ago.
struct ListedSource {
  std::vector<std::string> ids;  ///< of its senders, one after another, at least one
  std::string rig;               ///< its name; may be unknown
  bool connected = false;
};

/// The rigs to choose from. `current`: the one that pages see that chose none.
Message encode_sources(const std::string& current, const std::vector<ListedSource>& sources);

/// Number of messages that a slow client has missed.
Message encode_dropped(std::uint64_t messages);

/// Time or sequence number restarted: earlier frames belong to another run.
Message encode_restart();

}  // namespace stickslip::scope
