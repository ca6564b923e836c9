// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/live_feed.h"

#include <algorithm>
#include <utility>

#include "config/model_file.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"

namespace stickslip::scope {

namespace {

constexpr auto silence = std::chrono::seconds(1);
constexpr auto heartbeat = std::chrono::milliseconds(250);
constexpr std::size_t most_notes = 100;  // for new pages
constexpr std::int64_t restart_ns = 1'000'000'000;

bool is_verdict(const event_t& event) {
  return event.code == "model_broken" || event.code == "model_follows" ||
         event.code == "model_explained" || event.code == "model_unexplained";
}

}  // namespace

LiveFeed::LiveFeed(FeedSettings settings, Send send)
    : settings_(std::move(settings)),
      send_(std::move(send)),
      hello_(shared_message(encode_hello(
          {settings_.version, settings_.history_s, settings_.url, settings_.notes, false}))),
      history_(settings_.history_s, settings_.history_max_bytes),
      alive_at_(Clock::now()),
      began_(alive_at_) {
  if (!settings_.marks.empty()) model_ = shared_message(encode_model("", settings_.marks));
}

void LiveFeed::take(std::string_view channel, std::span<const std::uint8_t> bytes,
                    double received_unix_ms, Clock::time_point now) {
  if (channel == protocol::frames_channel) return take_block(bytes, received_unix_ms, now);
  if (channel == protocol::excitation_channel) return take_excitation(bytes);
  if (channel == protocol::event_channel) return take_event(bytes);
  if (channel == protocol::recording_channel) return take_description(bytes);
  const auto take_as = [&]<class Type>(Type message, Message (*encode)(const Type&),
                                       SharedMessage& latest) {
    if (!protocol::decode(bytes, message)) {
      ++undecoded_;
      return;
    }
    latest = shared_message(encode(message));
    send(latest);
  };
  if (channel == protocol::estimate_channel) {
    take_as(friction_estimate_t{}, encode_estimate, estimate_);
  } else if (channel == protocol::status_channel) {
    const std::uint64_t before = undecoded_;
    take_as(status_t{}, encode_status, status_);
    if (undecoded_ == before) status_at_ = now;
  } else if (channel == protocol::timing_channel) {
    take_as(timing_t{}, encode_timing, timing_);
  } else if (channel == protocol::recorder_channel) {
    take_as(recorder_t{}, encode_recorder, recorder_);
  }
}

void LiveFeed::take_block(std::span<const std::uint8_t> bytes, double received_unix_ms,
                          Clock::time_point now) {
  frame_block_t block{};
  frames_.clear();
  if (!protocol::decode(bytes, block) || !protocol::from_block(block, frames_)) {
    ++undecoded_;
    return;
  }
  if (is_restart(frames_.front())) reset_run();
  const double silent_s = silence_s(now);
  last_block_at_ = now;
  if (!connected_) {
    connected_ = true;
    send(shared_message(encode_source(true, silent_s)));
  }
  last_ = frames_.back();
  frames_taken_ += frames_.size();
  for (const Frame& frame : frames_) times_.add(frame);
  const bool degraded = (block.flags & 1) != 0;
  send(shared_message(encode_frames(frames_, {degraded, false, received_unix_ms})));
  history_.add(frames_, degraded, received_unix_ms);
}

bool LiveFeed::is_restart(const Frame& next) const {
  if (!last_) return false;
  return next.sequence <= last_->sequence ||
         (next.time_ns<last_->time_ns&& static_cast<std::uint64_t>(last_->time_ns) -
                       static_cast<std::uint64_t>(next.time_ns)>
              restart_ns);
}

void LiveFeed::reset_run() {
  history_.clear();
  times_.clear();
  estimate_.reset();
  timing_.reset();
  recorder_.reset();
  verdicts_.clear();
  notes_.clear();
  send(shared_message(encode_restart()));
}

void LiveFeed::take_excitation(std::span<const std::uint8_t> bytes) {
  excitation_t message{};
  if (!protocol::decode(bytes, message)) {
    ++undecoded_;
    return;
  }
  const auto sequence = static_cast<std::uint64_t>(message.sequence);
  std::vector<std::optional<std::int64_t>> times;
  times.reserve(message.earlier_by.size());
  for (const std::int32_t by : message.earlier_by) {
    times.push_back(
        times_.time_ns(sequence - static_cast<std::uint64_t>(by), sequence, message.time_ns));
  }
  send(shared_message(encode_excitation(message, times)));
}

void LiveFeed::take_event(std::span<const std::uint8_t> bytes) {
  event_t message{};
  if (!protocol::decode(bytes, message)) {
    ++undecoded_;
    return;
  }
  const SharedMessage event = shared_message(encode_event(message));
  if (is_verdict(message)) {
    std::erase_if(verdicts_, [&](const Verdict& one) { return one.code == message.code; });
    verdicts_.push_back({message.code, event});
  }
  if (message.code == "note") {
    notes_.push_back(event);
    if (notes_.size() > most_notes) notes_.pop_front();
  }
  send(event);
}

void LiveFeed::take_description(std::span<const std::uint8_t> bytes) {
  recording_info_t message{};
  if (!protocol::decode(bytes, message)) {
    ++undecoded_;
    return;
  }
  std::vector<Mark> marks = settings_.marks;
  if (marks.empty() && !message.model.empty()) {
    try {
      marks = marks_of(config::parse_model(message.model, "the model on LCM"));
    } catch (const InputError&) {
      ++undecoded_;  // perhaps of a later version; the rig's name is still published
    }
  }
  rig_ = message.rig;
  SharedMessage model = shared_message(encode_model(message.rig, marks));
  // The daemon repeats its description.
  if (model_ && std::ranges::equal(model_->payload(), model->payload())) return;
  model_ = std::move(model);
  send(model_);
}

void LiveFeed::tick(Clock::time_point now) {
  if (connected_ && now - *last_block_at_ >= silence) {
    connected_ = false;
    send(shared_message(encode_source(false, silence_s(now))));
  }
  if (now - alive_at_ < heartbeat) return;
  alive_at_ = now;
  send(alive(now));
}

SharedMessage LiveFeed::alive(Clock::time_point now) const {
  std::optional<double> status_s;
  if (status_at_) status_s = std::chrono::duration<double>(now - *status_at_).count();
  return shared_message(encode_alive(connected_, silence_s(now), status_s));
}

std::vector<SharedMessage> LiveFeed::greeting(Clock::time_point now) const {
  std::vector<SharedMessage> out = {hello_};
  const auto append = [&out](const SharedMessage& message) {
    if (message) out.push_back(message);
  };
  append(model_);
  append(shared_message(encode_source(connected_, connected_ ? 0.0 : silence_s(now))));
  for (const SharedMessage& message : history_.messages()) append(message);
  append(status_);
  append(timing_);
  append(recorder_);
  append(estimate_);
  for (const SharedMessage& note : notes_) append(note);
  for (const Verdict& verdict : verdicts_) append(verdict.event);
  append(alive(now));
  return out;
}

double LiveFeed::silence_s(Clock::time_point now) const {
  return std::chrono::duration<double>(now - last_block_at_.value_or(began_)).count();
}

void LiveFeed::send(SharedMessage message) { send_(message); }

}  // namespace stickslip::scope
