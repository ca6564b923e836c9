// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/history.h"

#include <algorithm>
#include <cmath>

namespace stickslip::scope {

namespace {

// More frames than any excitation message covers.
constexpr std::size_t remembered_times = 1U << 15U;

}  // namespace

FrameHistory::FrameHistory(double length_s, std::size_t max_bytes)
    : length_ns_(static_cast<std::int64_t>(length_s * 1e9)), max_bytes_(max_bytes) {}

void FrameHistory::add(std::span<const Frame> frames, bool degraded, double received_unix_ms) {
  if (length_ns_ == 0) return;
  if (!open_.empty() && open_notes_.degraded != degraded) close_chunk();
  for (const Frame& frame : frames) {
    open_notes_ = {degraded, true, received_unix_ms};
    open_.push_back(frame);
    if (open_.size() >= chunk_frames) close_chunk();
  }
  forget_old();
}

void FrameHistory::clear() {
  chunks_.clear();
  open_.clear();
  bytes_ = 0;
}

std::vector<SharedMessage> FrameHistory::messages() const {
  std::vector<SharedMessage> out;
  out.reserve(chunks_.size() + 1);
  for (const Chunk& chunk : chunks_) out.push_back(chunk.message);
  if (!open_.empty()) out.push_back(shared_message(encode_frames(open_, open_notes_)));
  return out;
}

void FrameHistory::close_chunk() {
  if (open_.empty()) return;
  chunks_.push_back({shared_message(encode_frames(open_, open_notes_)), open_.back().time_ns});
  bytes_ += chunks_.back().message->size();
  open_.clear();
}

void FrameHistory::forget_old() {
  if (chunks_.empty()) return;
  const std::int64_t latest = open_.empty() ? chunks_.back().last_time_ns : open_.back().time_ns;
  // Unsigned arithmetic: times may be anywhere in their range.
  const auto age_ns = [latest](const Chunk& chunk) {
    return chunk.last_time_ns > latest ? 0U
                                       : static_cast<std::uint64_t>(latest) -
                                             static_cast<std::uint64_t>(chunk.last_time_ns);
  };
  while (!chunks_.empty() && (bytes() > max_bytes_ ||
                              age_ns(chunks_.front()) > static_cast<std::uint64_t>(length_ns_))) {
    bytes_ -= chunks_.front().message->size();
    chunks_.pop_front();
  }
}

FrameTimes::FrameTimes() : entries_(remembered_times) {}

void FrameTimes::add(const Frame& frame) {
  const Entry entry{frame.sequence, frame.time_ns, true};
  if (latest_ && entry.sequence > latest_->sequence && entry.time_ns > latest_->time_ns) {
    period_ns_ = (static_cast<double>(entry.time_ns) - static_cast<double>(latest_->time_ns)) /
                 static_cast<double>(entry.sequence - latest_->sequence);
  }
  latest_ = entry;
  entries_[entry.sequence % entries_.size()] = entry;
}

void FrameTimes::clear() {
  std::fill(entries_.begin(), entries_.end(), Entry{});
  latest_.reset();
  period_ns_ = 0.0;
}

std::optional<std::int64_t> FrameTimes::time_ns(std::uint64_t sequence, std::uint64_t reference,
                                                std::int64_t reference_time_ns) const {
  const Entry& entry = entries_[sequence % entries_.size()];
  if (entry.known && entry.sequence == sequence) return entry.time_ns;
  if (!(period_ns_ > 0.0)) return std::nullopt;
  const double frames = static_cast<double>(sequence) - static_cast<double>(reference);
  const double offset_ns = frames * period_ns_;
  if (!(std::abs(offset_ns) < 1e15)) return std::nullopt;  // two weeks: implausible
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(reference_time_ns) +
                                   static_cast<std::uint64_t>(std::llround(offset_ns)));
}

}  // namespace stickslip::scope
