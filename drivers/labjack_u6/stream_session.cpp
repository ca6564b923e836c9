// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/stream_session.h"

#include <algorithm>
#include <system_error>
#include <utility>

namespace stickslip::drivers::labjack_u6 {

namespace {

constexpr std::size_t reply_transfers = 4;

}  // namespace

StreamSession::StreamSession(libusb_context* context, libusb_device_handle* handle, StreamPlan plan,
                             Lines& lines, StreamCounts& counts)
    : context_(context),
      handle_(handle),
      plan_(std::move(plan)),
      decoder_(static_cast<int>(plan_.scan.size()), plan_.samples_per_packet),
      frames_(labjack::frame_capacity(plan_.clock.rate_hz())),
      lines_(lines),
      counts_(counts) {}

bool StreamSession::allocate() {
  const auto add = [this](std::vector<Incoming>& to, std::uint8_t endpoint, std::size_t bytes,
                          libusb_transfer_cb_fn callback) {
    Incoming incoming{Transfer(libusb_alloc_transfer(0)), std::vector<std::uint8_t>(bytes)};
    if (!incoming.transfer) return false;
    libusb_fill_bulk_transfer(incoming.transfer.get(), handle_, endpoint, incoming.bytes.data(),
                              static_cast<int>(bytes), callback, this, 0);
    to.push_back(std::move(incoming));
    return true;
  };
  const auto packets = static_cast<std::size_t>(plan_.packets_per_transfer);
  for (int i = 0; i < plan_.transfers; ++i) {
    if (!add(stream_, stream_endpoint, packets * largest_packet, samples_received)) return false;
  }
  for (std::size_t i = 0; i < reply_transfers; ++i) {
    if (!add(replies_, reply_endpoint, largest_packet, reply_received)) return false;
  }
  for (Outgoing& outgoing : outgoing_) {
    outgoing.session = this;
    outgoing.transfer.reset(libusb_alloc_transfer(0));
    if (!outgoing.transfer) return false;
  }
  return true;
}

bool StreamSession::begin() {
  bool submitted = allocate();
  for (auto* const kind : {&replies_, &stream_}) {
    for (Incoming& incoming : *kind) submitted = submitted && submit(incoming.transfer.get());
  }
  if (submitted) {
    try {
      thread_ = std::thread([this] { run(); });
      return true;
    } catch (const std::system_error&) {
    }
  }
  finishing_ = true;
  reap();
  return false;
}

bool StreamSession::end() noexcept {
  finishing_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  if (in_flight_.load() == 0) return true;
  for (auto* const kind : {&replies_, &stream_}) {
    for (Incoming& incoming : *kind) static_cast<void>(incoming.transfer.release());
  }
  for (Outgoing& outgoing : outgoing_) static_cast<void>(outgoing.transfer.release());
  return false;
}

void StreamSession::run() {
  int failures = 0;
  while (!finishing_.load(std::memory_order_acquire)) {
    failures = events_.handle(context_, std::chrono::milliseconds(50)) ? 0 : failures + 1;
    if (failures == 100) finish(StreamEnd::usb_error);
  }
  reap();
}

/// Only while no other thread handles events, so that no callback resubmits a cancelled transfer.
void StreamSession::reap() noexcept {
  for (auto* const kind : {&stream_, &replies_}) {
    for (Incoming& incoming : *kind) {
      if (incoming.transfer) libusb_cancel_transfer(incoming.transfer.get());
    }
  }
  for (Outgoing& outgoing : outgoing_) {
    if (outgoing.leaving) libusb_cancel_transfer(outgoing.transfer.get());
  }
  for (int round = 0; round < 200 && in_flight_.load() > 0; ++round) {
    static_cast<void>(events_.handle(context_, std::chrono::milliseconds(10)));
  }
}

bool StreamSession::submit(libusb_transfer* transfer) {
  in_flight_.fetch_add(1);
  const int error = libusb_submit_transfer(transfer);
  if (error == LIBUSB_SUCCESS) return true;
  in_flight_.fetch_sub(1);
  finish(error == LIBUSB_ERROR_NO_DEVICE ? StreamEnd::unplugged : StreamEnd::usb_error);
  return false;
}

void StreamSession::finish(StreamEnd reason) {
  StreamEnd expected = StreamEnd::not_ended;
  if (end_.compare_exchange_strong(expected, reason)) frames_.close();
}

/// True if the received data may be used and the transfer resubmitted.
bool StreamSession::usable(libusb_transfer_status status) {
  switch (status) {
    case LIBUSB_TRANSFER_COMPLETED:
    case LIBUSB_TRANSFER_TIMED_OUT:
      return !finishing_.load(std::memory_order_acquire);
    case LIBUSB_TRANSFER_CANCELLED:
      return false;
    case LIBUSB_TRANSFER_NO_DEVICE:
      finish(StreamEnd::unplugged);
      return false;
    default:
      finish(StreamEnd::usb_error);
      return false;
  }
}

void LIBUSB_CALL StreamSession::samples_received(libusb_transfer* transfer) {
  auto& self = *static_cast<StreamSession*>(transfer->user_data);
  self.events_.note_callback();
  if (self.usable(transfer->status) && self.ended() == StreamEnd::not_ended) {
    self.decode({transfer->buffer, static_cast<std::size_t>(transfer->actual_length)});
    if (self.ended() == StreamEnd::not_ended) self.submit(transfer);
  }
  self.in_flight_.fetch_sub(1);
}

void LIBUSB_CALL StreamSession::reply_received(libusb_transfer* transfer) {
  auto& self = *static_cast<StreamSession*>(transfer->user_data);
  self.events_.note_callback();
  if (self.usable(transfer->status)) {
    self.dispatch({transfer->buffer, static_cast<std::size_t>(transfer->actual_length)});
    self.submit(transfer);
  }
  self.in_flight_.fetch_sub(1);
}

void LIBUSB_CALL StreamSession::command_sent(libusb_transfer* transfer) {
  auto& outgoing = *static_cast<Outgoing*>(transfer->user_data);
  StreamSession& self = *outgoing.session;
  self.events_.note_callback();
  if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) self.finish(StreamEnd::unplugged);
  if (transfer->status != LIBUSB_TRANSFER_COMPLETED) {
    self.settle(outgoing, {Verdict::Kind::length});
  }
  outgoing.leaving.store(false, std::memory_order_release);
  self.in_flight_.fetch_sub(1);
}

void StreamSession::decode(std::span<const std::uint8_t> bytes) {
  const std::size_t packet = decoder_.packet_bytes();
  while (!bytes.empty()) {
    const std::size_t size = std::min(packet, bytes.size());
    const StreamDecoder::Outcome outcome = decoder_.take(bytes.first(size));
    update_counts();
    switch (outcome) {
      case StreamDecoder::Outcome::ok:
        for (const Scan& scan : decoder_.scans()) put(scan);
        break;
      case StreamDecoder::Outcome::error:
        board_error_.store(decoder_.error(), std::memory_order_relaxed);
        finish(StreamEnd::board_error);
        return;
      case StreamDecoder::Outcome::uncountable:
        finish(StreamEnd::uncountable);
        return;
      case StreamDecoder::Outcome::damaged:
      case StreamDecoder::Outcome::repeated:
        break;
    }
    bytes = bytes.subspan(size);
  }
}

void StreamSession::update_counts() {
  const StreamDecoder::Counts& now = decoder_.counts();
  const auto add = [](std::atomic<std::uint64_t>& to, std::uint64_t count, std::uint64_t counted) {
    if (count != counted) to.fetch_add(count - counted, std::memory_order_relaxed);
  };
  add(counts_.packets_lost, now.packets_lost, counted_.packets_lost);
  add(counts_.packets_damaged, now.damaged, counted_.damaged);
  add(counts_.overflows, now.overflows, counted_.overflows);
  add(counts_.scans_thrown_away, now.overflow_losses, counted_.overflow_losses);
  add(counts_.scans_lost, now.scans_lost, counted_.scans_lost);
  counted_ = now;
  if (decoder_.backlog() > counts_.fullest_backlog.load(std::memory_order_relaxed)) {
    counts_.fullest_backlog.store(decoder_.backlog(), std::memory_order_relaxed);
  }
}

void StreamSession::put(const Scan& scan) {
  Frame frame;
  frame.sequence = scan.index;
  frame.time_ns = plan_.clock.time_ns(scan.index);
  OutputReadings outputs;
  plan_.convert(plan_.calibration, scan.counts, frame, outputs);
  frames_.put(frame, outputs);
}

void StreamSession::dispatch(std::span<const std::uint8_t> reply) {
  FeedbackReply feedback;
  const Verdict verdict = parse_feedback(reply, true, feedback);
  if (verdict || verdict.kind == Verdict::Kind::error) {
    for (const Slot slot : {Slot::set_point, Slot::off, Slot::lines}) {
      if (!at(slot).slot.waits_for(feedback.echo)) continue;
      if (verdict) lines_.update(feedback.lines, at(slot).slot.sent_ns());
      settle(at(slot), verdict);
    }
    return;  // without a slot: its command timed out, and its levels are old
  }
  // The reply cannot be attributed. All pending commands are repeated, which is harmless.
  settle_all(verdict);
}

void StreamSession::settle(Outgoing& outgoing, const Verdict& verdict) {
  outgoing.slot.settle(static_cast<bool>(verdict), packed(verdict));
}

void StreamSession::settle_all(const Verdict& verdict) {
  for (Outgoing& outgoing : outgoing_) settle(outgoing, verdict);
}

bool StreamSession::free(Slot slot) const {
  const Outgoing& outgoing = at(slot);
  return outgoing.slot.idle() && !outgoing.leaving.load(std::memory_order_acquire);
}

bool StreamSession::send(Slot slot, const Command& command, std::uint8_t echo,
                         std::int64_t now_ns) {
  Outgoing& outgoing = at(slot);
  outgoing.command = command;
  libusb_fill_bulk_transfer(outgoing.transfer.get(), handle_, command_endpoint,
                            outgoing.command.bytes.data(), static_cast<int>(command.size),
                            command_sent, &outgoing, send_timeout_ms);
  outgoing.slot.begin(echo, now_ns);
  outgoing.leaving.store(true, std::memory_order_release);
  if (submit(outgoing.transfer.get())) return true;
  outgoing.leaving.store(false, std::memory_order_release);
  outgoing.slot.withdraw();
  return false;
}

}  // namespace stickslip::drivers::labjack_u6
