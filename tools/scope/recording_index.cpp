// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/recording_index.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "config/model_file.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/recording_events.h"
#include "tools/scope/live_feed.h"

namespace stickslip::scope {

namespace {

using nlohmann::json;
using protocol::EventReader;
using protocol::LogEvent;

std::string text_of(const Message& message) {
  const auto payload = message.payload();
  return {payload.begin(), payload.end()};
}

std::ifstream opened(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (in) return in;
  throw InputError(
      Problem{file.string(), 0, 0, std::string("cannot be read: ") + std::strerror(errno)});
}

void require_log(std::istream& in, const std::filesystem::path& file) {
  std::array<char, 4> head{};
  in.read(head.data(), head.size());
  if (protocol::is_log({head.data(), static_cast<std::size_t>(in.gcount())})) {
    in.clear();
    return;
  }
  throw InputError(Problem{file.string(), 0, 0,
                           "is not an LCM event log; of a CSV recording make one with stickslip "
                           "convert " +
                               file.string() + " OUT.log"});
}

void put_u32(std::string& out, std::uint32_t value) {
  for (unsigned i = 0; i < 4; ++i) out += static_cast<char>(value >> (8 * i) & 0xffU);
}

/// Whether a block begins after that time, which becomes that of its end.
bool is_later(std::span<const std::uint8_t> bytes, std::int64_t& last_ns) {
  frame_block_t message{};
  std::vector<Frame> frames;
  if (!protocol::decode(bytes, message) || !protocol::from_block(message, frames)) return false;
  if (frames.front().time_ns <= last_ns) return false;
  last_ns = frames.back().time_ns;
  return true;
}

json numbers(const Overview& overview, std::size_t channel, bool high) {
  json out = json::array();
  for (std::size_t i = 0; i < overview.size(); ++i) {
    const Overview::Span& span = overview[i];
    const bool known = span.low[channel] <= span.high[channel];
    // Not a number is null.
    out.push_back(known ? json((high ? span.high : span.low)[channel]) : json(nullptr));
  }
  return out;
}

}  // namespace

void Overview::add(const Frame& frame, std::int64_t time_ns) {
  while (time_ns / step_ns_ >= static_cast<std::int64_t>(most)) merge_neighbours();
  const auto at = static_cast<std::size_t>(time_ns / step_ns_);
  constexpr float infinity = std::numeric_limits<float>::infinity();
  Span none{};
  none.low.fill(infinity);
  none.high.fill(-infinity);
  if (at >= spans_.size()) spans_.resize(at + 1, none);
  Span& span = spans_[at];
  for (const Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    const std::size_t i = index_of(channel);
    const auto value = static_cast<float>(frame[channel]);
    span.low[i] = std::min(span.low[i], value);
    span.high[i] = std::max(span.high[i], value);
  }
}

void Overview::merge_neighbours() {
  step_ns_ *= 2;
  for (std::size_t i = 0; 2 * i < spans_.size(); ++i) {
    spans_[i] = spans_[2 * i];
    if (2 * i + 1 == spans_.size()) continue;
    const Span& next = spans_[2 * i + 1];
    for (std::size_t c = 0; c < channel_count; ++c) {
      spans_[i].low[c] = std::min(spans_[i].low[c], next.low[c]);
      spans_[i].high[c] = std::max(spans_[i].high[c], next.high[c]);
    }
  }
  spans_.resize((spans_.size() + 1) / 2);
}

RecordingIndex::RecordingIndex(std::filesystem::path file, std::vector<Mark> marks,
                               const protocol::ProgressCallback& done)
    : file_(std::move(file)), marks_(std::move(marks)) {
  std::ifstream in = opened(file_);
  require_log(in, file_);
  EventReader reader(in, file_.string(), done);
  LogEvent event;
  for (auto found = reader.next(event); found != EventReader::Found::end;
       found = reader.next(event)) {
    if (found == EventReader::Found::cut_off) {
      unshown_.cut_off_bytes = event.end - event.at;
      continue;
    }
    end_ = event.end;
    if (found == EventReader::Found::damage) {
      unshown_.damaged_bytes += event.end - event.at;
    } else if (event.channel == protocol::frames_channel) {
      take_block(event.data, event.at);
    } else if (event.channel == protocol::event_channel) {
      take_event(event.data);
    } else if (event.channel == protocol::recording_channel) {
      take_description(event.data);
    }
  }
  if (frames_ == 0) {
    throw InputError(
        Problem{file_.string(), 0, 0,
                std::string("has no frames: nothing was recorded on ") + protocol::frames_channel});
  }
}

void RecordingIndex::take_block(std::span<const std::uint8_t> bytes, std::int64_t at) {
  frame_block_t message{};
  block_.clear();
  if (!protocol::decode(bytes, message) || !protocol::from_block(message, block_) ||
      (frames_ > 0 && block_.front().time_ns <= last_ns_)) {
    ++unshown_.undecoded;
    return;
  }
  if (pieces_.empty()) {
    pieces_.push_back({0, block_.front().time_ns});  // with what stands before the first frame
  } else if (frames_in_piece_ >= piece_frames || at - pieces_.back().at >= piece_bytes) {
    pieces_.push_back({at, block_.front().time_ns});
    frames_in_piece_ = 0;
  }
  frames_in_piece_ += block_.size();
  frames_ += block_.size();
  last_ns_ = block_.back().time_ns;
  for (const Frame& frame : block_) overview_.add(frame, frame.time_ns - pieces_.front().first_ns);
}

void RecordingIndex::take_event(std::span<const std::uint8_t> bytes) {
  event_t message{};
  if (!protocol::decode(bytes, message)) {
    ++unshown_.undecoded;
  } else if (events_.size() >= most_events) {
    ++unshown_.events;
  } else {
    events_.push_back({message.time_ns, text_of(encode_event(message))});
  }
}

void RecordingIndex::take_description(std::span<const std::uint8_t> bytes) {
  LiveFeed feed({.history_s = 0.0, .marks = marks_}, [this](const SharedMessage& message) {
    models_.push_back({last_ns_, text_of(*message)});
  });
  feed.take(protocol::recording_channel, bytes, 0.0, {});
}

std::string RecordingIndex::summary() const {
  const std::int64_t first_ns = pieces_.front().first_ns;
  json out = {{"file", file_.filename().string()},
              {"first_ns", std::to_string(first_ns)},
              {"length_ns", last_ns_ - first_ns},
              {"frames", frames_},
              {"unshown",
               {{"damaged_bytes", unshown_.damaged_bytes},
                {"undecoded", unshown_.undecoded},
                {"events", unshown_.events},
                {"cut_off_bytes", unshown_.cut_off_bytes}}},
              {"pieces", json::array()},
              {"events", json::array()},
              {"models", json::array()}};
  for (const Piece& piece : pieces_) out["pieces"].push_back(piece.first_ns - first_ns);
  for (const Dated& event : events_) out["events"].push_back(json::parse(event.json));
  for (const Dated& model : models_) {
    out["models"].push_back({{"time_ns", std::max<std::int64_t>(0, model.time_ns - first_ns)},
                             {"message", json::parse(model.json)}});
  }
  json& overview = out["overview"];
  overview["step_ns"] = overview_.step_ns();
  for (const Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    overview["low"].push_back(numbers(overview_, i, false));
    overview["high"].push_back(numbers(overview_, i, true));
  }
  return out.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string RecordingIndex::bytes_of(std::size_t number) const {
  const std::int64_t from = pieces_[number].at;
  const std::int64_t to = number + 1 < pieces_.size() ? pieces_[number + 1].at : end_;
  std::ifstream in = opened(file_);
  std::string out(static_cast<std::size_t>(to - from), '\0');
  in.seekg(from);
  in.read(out.data(), static_cast<std::streamsize>(out.size()));
  if (in.gcount() == to - from) return out;
  throw InputError(Problem{file_.string(), 0, 0, "is shorter than it was"});
}

std::string RecordingIndex::piece(std::size_t number) const {
  std::istringstream in(bytes_of(number));
  EventReader reader(in, file_.string());
  std::string out;
  LiveFeed feed({.history_s = 0.0, .marks = marks_}, [&out](const SharedMessage& message) {
    const auto payload = message->payload();
    put_u32(out, static_cast<std::uint32_t>(payload.size()));
    put_u32(out, message->binary() ? 1 : 0);
    out.append(payload.begin(), payload.end());
  });
  std::int64_t last_ns = std::numeric_limits<std::int64_t>::min();
  LogEvent event;
  for (auto found = reader.next(event); found != EventReader::Found::end;
       found = reader.next(event)) {
    if (found != EventReader::Found::event) continue;
    if (event.channel == protocol::frames_channel && !is_later(event.data, last_ns)) continue;
    feed.take(event.channel, event.data, static_cast<double>(event.time_us) * 1e-3, {});
  }
  return out;
}

}  // namespace stickslip::scope
