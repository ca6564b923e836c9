// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/stream_session.h"

#include <poll.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <system_error>
#include <utility>

namespace stickslip::drivers::labjack_t7 {

namespace {

constexpr int wait_ms = 50;
// A board without cable is silent. Packets come every 5 ms, or as configured.
constexpr std::int64_t longest_silence_ns = 1'000'000'000;
constexpr std::int64_t packets_of_silence = 4;
constexpr double highest_dac_v = 5.0;
constexpr std::size_t reply_bytes = 4;  // the lines

}  // namespace

labjack::SetPoint set_point_of(double volts) {
  const double wanted = std::isfinite(volts) ? volts : 0.0;
  return std::bit_cast<labjack::SetPoint>(
      static_cast<float>(std::clamp(wanted, 0.0, highest_dac_v)));
}

void add_output(Feedback& request, const config::LabjackT7& settings, labjack::SetPoint set_point,
                bool on) {
  const int dac = dac0 + 2 * settings.dac;
  if (on) request.write(dac, set_point);
  if (settings.enable_line) request.write_word(dio0 + *settings.enable_line, on ? 1 : 0);
  if (!on) request.write(dac, set_point);
}

labjack::OutputRules output_rules(const config::LabjackT7& settings) {
  labjack::OutputRules rules;
  rules.reads_lines = settings.amplifier_fault_line || settings.emergency_stop_line;
  rules.watchdog_s = settings.has_watchdog() ? settings.watchdog_s : 0;
  rules.max_transit_ns = std::int64_t{unacknowledged_ms} * 1'000'000;
  return rules;
}

StreamSession::StreamSession(BoardLink& link, const config::LabjackT7& settings, StreamPlan plan,
                             labjack::Lines& lines, StreamCounts& counts, HostClock& clock)
    : link_(link),
      settings_(settings),
      plan_(std::move(plan)),
      decoder_(static_cast<int>(plan_.scan.size()), plan_.samples_per_packet()),
      frames_(labjack::frame_capacity(plan_.rate_hz)),
      lines_(lines),
      counts_(counts),
      clock_(clock),
      last_packet_ns_(clock.now_ns()) {}

bool StreamSession::begin() {
  try {
    thread_ = std::thread([this] { run(); });
    return true;
  } catch (const std::system_error&) {
    return false;
  }
}

void StreamSession::end() noexcept {
  finishing_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

void StreamSession::finish(StreamEnd reason) {
  StreamEnd expected = StreamEnd::not_ended;
  if (end_.compare_exchange_strong(expected, reason)) frames_.close();
}

/// After the end of the stream, replies are still received: "off" must be confirmed.
void StreamSession::run() {
  const std::int64_t packet_ns = plan_.scans_per_packet * plan_.interval_ns;
  const std::int64_t silence_ns = std::max(longest_silence_ns, packets_of_silence * packet_ns);
  while (!finishing_.load(std::memory_order_acquire) && !(commands_ended_ && has_ended())) {
    pollfd files[2] = {{has_ended() ? -1 : link_.stream().file(), POLLIN, 0},
                       {commands_ended_ ? -1 : link_.commands().file(), POLLIN, 0}};
    if (::poll(files, 2, wait_ms) < 0) continue;  // interrupted
    if (files[0].revents != 0) receive_samples();
    if (files[1].revents != 0) receive_replies();
    if (clock_.now_ns() - last_packet_ns_ > silence_ns) finish(StreamEnd::silent);
  }
}

void StreamSession::receive_samples() {
  std::size_t received = 0;
  switch (link_.stream().receive(packets_.space(), received)) {
    case TcpConnection::Received::nothing:
      return;
    case TcpConnection::Received::ended:
      finish(StreamEnd::disconnected);
      return;
    case TcpConnection::Received::bytes:
      break;
  }
  packets_.received(received);
  std::span<const std::uint8_t> message;
  MessageReader::Next next = packets_.next(message);
  for (; next == MessageReader::Next::message && !has_ended(); next = packets_.next(message)) {
    take(message);
  }
  if (next == MessageReader::Next::garbled) finish(StreamEnd::garbled);
}

void StreamSession::take(std::span<const std::uint8_t> message) {
  const std::optional<StreamPacket> packet = parse_packet(message);
  if (!packet) {
    finish(StreamEnd::garbled);
    return;
  }
  last_packet_ns_ = clock_.now_ns();
  const StreamDecoder::Outcome outcome = decoder_.take(*packet);
  update_counts(*packet);
  switch (outcome) {
    case StreamDecoder::Outcome::ok:
      for (const Scan& scan : decoder_.scans()) put(scan);
      return;
    case StreamDecoder::Outcome::error:
      board_error_.store(decoder_.status(), std::memory_order_relaxed);
      finish(StreamEnd::board_error);
      return;
    case StreamDecoder::Outcome::uncountable:
      finish(StreamEnd::uncountable);
      return;
  }
}

void StreamSession::update_counts(const StreamPacket& packet) {
  const StreamDecoder::Counts& now = decoder_.counts();
  const auto add = [](std::atomic<std::uint64_t>& to, std::uint64_t count, std::uint64_t counted) {
    if (count != counted) to.fetch_add(count - counted, std::memory_order_relaxed);
  };
  add(counts_.packets_lost, now.packets_lost, counted_.packets_lost);
  add(counts_.overflows, now.overflows, counted_.overflows);
  add(counts_.scans_thrown_away, now.overflow_losses, counted_.overflow_losses);
  add(counts_.scans_lost, now.scans_lost, counted_.scans_lost);
  counted_ = now;
  if (packet.backlog_bytes > counts_.fullest_backlog.load(std::memory_order_relaxed)) {
    counts_.fullest_backlog.store(packet.backlog_bytes, std::memory_order_relaxed);
  }
}

void StreamSession::put(const Scan& scan) {
  Frame frame;
  frame.sequence = scan.index;
  frame.time_ns = static_cast<std::int64_t>(scan.index) * plan_.interval_ns;
  OutputReadings outputs;
  plan_.convert(plan_.calibration, scan.counts, frame, outputs);
  frames_.put(frame, outputs);
}

void StreamSession::receive_replies() {
  std::size_t received = 0;
  switch (link_.commands().receive(link_.reader().space(), received)) {
    case TcpConnection::Received::nothing:
      return;
    case TcpConnection::Received::ended:
      commands_ended_ = true;
      finish(StreamEnd::disconnected);
      return;
    case TcpConnection::Received::bytes:
      break;
  }
  link_.reader().received(received);
  std::span<const std::uint8_t> message;
  MessageReader::Next next = link_.reader().next(message);
  for (; next == MessageReader::Next::message; next = link_.reader().next(message)) {
    dispatch(message);
  }
  if (next != MessageReader::Next::garbled) return;
  commands_ended_ = true;
  finish(StreamEnd::garbled);
}

/// A reply without a slot: its command timed out, and its levels are old.
void StreamSession::dispatch(std::span<const std::uint8_t> message) {
  std::span<const std::uint8_t> data;
  const Verdict verdict = parse_reply(message, reply_bytes, data);
  for (labjack::CommandSlot& slot : slots_) {
    if (!slot.waits_for(transaction_of(message))) continue;
    if (verdict) lines_.update(double_word_at(data, 0), slot.sent_ns());
    slot.settle(static_cast<bool>(verdict), packed(verdict));
  }
}

bool StreamSession::send_output(labjack::Slot slot, labjack::SetPoint set_point, bool on,
                                std::int64_t now_ns) {
  Feedback request(link_.next_transaction());
  add_output(request, settings_, set_point, on);
  return send(slot, request, now_ns);
}

bool StreamSession::send_request_of_lines(std::int64_t now_ns) {
  Feedback request(link_.next_transaction());
  return send(labjack::Slot::lines, request, now_ns);
}

bool StreamSession::send(labjack::Slot slot, Feedback& request, std::int64_t now_ns) {
  if (settings_.has_watchdog()) request.write(watchdog_strict_clear, watchdog_key);
  request.read(dio_state, 2);
  at(slot).begin(request.transaction(), now_ns);
  const TcpConnection::Sent sent = link_.commands().send(request.bytes());
  if (sent == TcpConnection::Sent::all) return true;
  at(slot).withdraw();
  if (sent == TcpConnection::Sent::broken) finish(StreamEnd::disconnected);
  return false;
}

const char* StreamSession::reason(const labjack::Progress& failed) const {
  const Verdict verdict = unpacked(failed.verdict);
  if (verdict.kind == Verdict::Kind::exception) return exception_name(verdict.code);
  return "the reply has an unexpected format";
}

}  // namespace stickslip::drivers::labjack_t7
