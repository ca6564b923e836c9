// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/board.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <utility>

namespace stickslip::drivers::usb_1208fs_plus {

namespace {

constexpr std::int64_t read_timeout_ns = 20'000'000;
constexpr std::size_t input_transfers = 16;
constexpr std::size_t output_transfers = 16;
constexpr std::size_t output_transfer_bytes = 2048;
constexpr int rest_attempts = 2;
constexpr std::int64_t status_period_ns = 200'000'000;
/// For cancelled transfers: one that has not returned by then never will.
constexpr std::chrono::seconds cancel_timeout(2);

std::int64_t to_ns(double seconds) { return std::llround(seconds * 1e9); }

timespec monotonic_in(std::int64_t ns) {
  timespec due{};
  clock_gettime(CLOCK_MONOTONIC, &due);
  const std::int64_t fine_ns = due.tv_nsec + ns;
  due.tv_sec += fine_ns / 1'000'000'000;
  due.tv_nsec = fine_ns % 1'000'000'000;
  return due;
}

}  // namespace

Board::Board(Session session, const ScanPlan& plan, const Calibration& calibration, int output,
             double output_ahead_s, double rest_v, HostClock& clock,
             std::atomic<std::uint64_t>& overruns, std::atomic<std::uint64_t>& underruns)
    : session_(std::move(session)),
      plan_(plan),
      calibration_(calibration),
      output_(output),
      ahead_(static_cast<std::size_t>(std::max(1.0, std::round(output_ahead_s / plan.period_s)))),
      clock_(clock),
      decoder_(plan.channels.size()),
      numbering_(plan.period_s),
      overruns_(overruns),
      underruns_(underruns),
      rest_(output_counts(rest_v)) {
  sem_init(&available_, 0, 0);
  for (std::size_t i = 0; i < input_transfers; ++i) {
    add(inputs_, input_endpoint, plan.transfer_bytes);
  }
  for (std::size_t i = 0; i < output_transfers; ++i) {
    add(outputs_, output_endpoint, output_transfer_bytes);
  }
}

Board::~Board() {
  stop();
  sem_destroy(&available_);
}

bool Board::drive(std::uint16_t counts, std::size_t copies) {
  for (std::size_t i = 0; i < copies; ++i) {
    if (!values_.try_enqueue(counts)) return false;
  }
  driving_.store(true, std::memory_order_release);
  return true;
}

void Board::rest(std::uint16_t counts) {
  rest_.store(counts, std::memory_order_relaxed);
  driving_.store(false, std::memory_order_release);
}

void Board::add(Transfers& transfers, std::uint8_t endpoint, std::size_t bytes) {
  auto one = std::make_unique<Transfer>();
  one->board = this;
  one->buffer.resize(bytes);
  one->transfer.reset(libusb_alloc_transfer(0));
  libusb_fill_bulk_transfer(one->transfer.get(), session_.handle(), endpoint, one->buffer.data(),
                            static_cast<int>(bytes), &Board::transfer_ended, one.get(), 0);
  transfers.push_back(std::move(one));
}

int Board::start() {
  stopping_ = false;
  // An earlier program or run may have left scans running.
  session_.send(Request::output_scan_stop);
  session_.send(Request::input_scan_stop);
  decoder_.restart();
  const int set = session_.send(Request::input_config, input_ranges(plan_));
  if (set < 0) return set;
  thread_ = std::thread([this] { run(); });
  return 0;
}

void Board::stop() {
  if (!running()) return;
  stopping_ = true;
  thread_.join();
  while (frames_.peek() != nullptr) frames_.pop();
  while (sem_trywait(&available_) == 0) {
  }
}

/// Monotonic: the wall clock may be set meanwhile.
bool Board::next(Frame& frame, OutputReadings& outputs) {
  if (sem_trywait(&available_) != 0) {
    const timespec due = monotonic_in(read_timeout_ns);
    int waited = 0;
    do {
      waited = sem_clockwait(&available_, CLOCK_MONOTONIC, &due);
    } while (waited != 0 && errno == EINTR);
    if (waited != 0) return false;
  }
  const Received* oldest = frames_.peek();
  if (oldest == nullptr) return false;
  frame = oldest->frame;
  outputs = oldest->outputs;
  frames_.pop();
  return true;
}

bool Board::succeeded(int result) {
  if (result == LIBUSB_ERROR_NO_DEVICE) gone_ = true;
  return result >= 0;
}

void Board::run() {
  input_failed_ = output_failed_ = false;
  begin_input();
  poll_status_at_ns_ = clock_.now_ns() + status_period_ns;
  while (!stopping_ && !lost()) {
    handle_events(1);
    if (clock_.now_ns() >= poll_status_at_ns_) poll_status();
    if (input_failed_ && !lost()) restart_input();
    if (!lost()) serve_output();
  }
  // The output is set to rest even if the kernel keeps transfers.
  driving_ = false;
  for (int i = 0; i < rest_attempts && !at_rest(); ++i) serve_output();
  cancel(outputs_);
  cancel(inputs_);
  if (!gone()) session_.send(Request::input_scan_stop);
}

/// Detects what no endpoint signals: an underrun while no output transfer was in flight.
void Board::poll_status() {
  poll_status_at_ns_ = clock_.now_ns() + status_period_ns;
  std::array<std::uint8_t, 2> word{};
  const int got = session_.receive(Request::status, word);
  if (!succeeded(got) || got != static_cast<int>(word.size())) return;
  const Status status = status_of(static_cast<std::uint16_t>(word[0] | (word[1] << 8)));
  if (status.input_overrun || !status.input_running) input_failed_ = true;
  if (output_running_ && (status.output_underrun || !status.output_running)) output_failed_ = true;
}

void Board::handle_events(int milliseconds) {
  static_cast<void>(events_.handle(session_.context(), std::chrono::milliseconds(milliseconds)));
}

void Board::transfer_ended(libusb_transfer* transfer) {
  auto& one = *static_cast<Transfer*>(transfer->user_data);
  one.board->events_.note_callback();
  one.in_flight = false;
  if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) {
    one.board->gone_ = true;
  } else if (transfer->endpoint == input_endpoint) {
    one.board->input_ended(one);
  } else {
    one.board->output_ended(one);
  }
}

void Board::submit(Transfer& transfer, std::size_t bytes) {
  transfer.transfer->length = static_cast<int>(bytes);
  if (succeeded(libusb_submit_transfer(transfer.transfer.get()))) {
    transfer.in_flight = true;
  } else if (transfer.transfer->endpoint == input_endpoint) {
    input_failed_ = true;
  } else {
    output_failed_ = true;
  }
}

/// Cancels the transfers and waits for their return. False: some did not return.
bool Board::cancel(Transfers& transfers) {
  const auto any = [&transfers] {
    return std::any_of(transfers.begin(), transfers.end(),
                       [](const auto& one) { return one->in_flight; });
  };
  for (const auto& one : transfers) {
    if (one->in_flight) libusb_cancel_transfer(one->transfer.get());
  }
  // A kernel that has kept transfers is not waited for again.
  const auto now = std::chrono::steady_clock::now;
  const auto until = has_stuck_transfers() ? now() : now() + cancel_timeout;
  while (any() && now() < until) handle_events(10);
  if (any()) stuck_ = true;
  return !any();
}

// Inputs

void Board::input_ended(Transfer& transfer) {
  if (transfer.transfer->status == LIBUSB_TRANSFER_CANCELLED || input_failed_) return;
  const auto bytes = static_cast<std::size_t>(transfer.transfer->actual_length);
  if (transfer.transfer->status != LIBUSB_TRANSFER_COMPLETED) {
    input_failed_ = true;
    return;
  }
  if (is_complete(bytes)) decode({transfer.buffer.data(), bytes});
  if (!stopping_ && !input_failed_) submit(transfer, transfer.buffer.size());
}

/// In a continuous scan, packets are full or hold one scan each. Which samples of a short packet
/// are missing is unknown, and so is the start of the next scan, unless each scan has its own
/// packet.
bool Board::is_complete(std::size_t bytes) {
  if (plan_.immediate) {
    const bool whole = bytes == 2 * plan_.channels.size();
    if (!whole) numbering_.take();
    return whole;
  }
  if (bytes != plan_.transfer_bytes) input_failed_ = true;
  return !input_failed_;
}

bool Board::begin_scan() {
  libusb_clear_halt(session_.handle(), input_endpoint);
  if (!succeeded(session_.send(Request::input_clear_fifo))) return false;
  input_failed_ = false;
  decoder_.restart();
  for (const auto& one : inputs_) submit(*one, one->buffer.size());
  const std::int64_t start_ns = clock_.now_ns();
  if (!succeeded(session_.send(Request::input_scan_start, input_scan(plan_)))) return false;
  numbering_.begin(start_ns);
  return !input_failed_;
}

bool Board::begin_input() {
  input_failed_ = !begin_scan();
  refused_ = input_failed_ && !lost();
  return !input_failed_;
}

void Board::restart_input() {
  const auto wait = [this] {
    if (!lost()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  };
  if (!cancel(inputs_)) return;
  if (!succeeded(session_.send(Request::input_scan_stop))) {
    wait();
    return;
  }
  if (!begin_input()) {
    wait();
    return;
  }
  overruns_.fetch_add(1, std::memory_order_relaxed);
  overrun_.store(true, std::memory_order_release);
}

void Board::decode(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    if (const auto codes = decoder_.next(bytes)) publish(*codes);
  }
  numbering_.arrived(clock_.now_ns());
}

double Board::volts_of(const ScanChannel& channel, std::uint16_t code) const {
  const Correction correction = plan_.differential
                                    ? calibration_.differential[channel.range_code][channel.channel]
                                    : calibration_.single_ended[channel.channel];
  return input_volts(code, channel.range_v, correction);
}

void Board::publish(std::span<const std::uint16_t> codes) {
  std::size_t last = 0;
  for (std::size_t i = 0; i < codes.size(); ++i) {
    if (plan_.channels[i].frame_index) last = i;
  }
  Received received;
  Frame& frame = received.frame;
  frame.sequence = numbering_.take();
  frame.time_ns = to_ns(static_cast<double>(frame.sequence) * plan_.period_s +
                        static_cast<double>(last) * plan_.conversion_s());
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const ScanChannel& channel = plan_.channels[i];
    if (channel.output != nullptr) received.outputs.*channel.output = volts_of(channel, codes[i]);
    if (!channel.frame_index) continue;
    frame.set(all_channels[*channel.frame_index], volts_of(channel, codes[i]));
    frame.age_us[*channel.frame_index] = static_cast<std::int32_t>(
        std::lround(static_cast<double>(last - i) * plan_.conversion_s() * 1e6));
  }
  // If the loop does not keep up, the gap in the sequence shows it.
  if (frames_.try_enqueue(received)) sem_post(&available_);
}

// Output

void Board::output_ended(const Transfer& transfer) {
  if (transfer.transfer->status != LIBUSB_TRANSFER_COMPLETED &&
      transfer.transfer->status != LIBUSB_TRANSFER_CANCELLED) {
    output_failed_ = true;
  }
}

void Board::serve_output() {
  if (!driving_.load(std::memory_order_acquire)) {
    end_output();
    return;
  }
  if (output_running_ && output_failed_) {
    recover_output();
    if (lost()) return;
  }
  if (!output_running_) begin_output();
  send_values();
}

void Board::recover_output() {
  underruns_.fetch_add(1, std::memory_order_relaxed);
  underrun_.store(true, std::memory_order_release);
  cancel(outputs_);
  session_.send(Request::output_scan_stop);
  output_running_ = false;
  refill_.store(Refill::awaited, std::memory_order_release);
  discard_values();
}

/// Begins with the values written since the output last ran, without those that are too old, padded
/// in front with the first of them to the length that is queued ahead.
void Board::begin_output() {
  if (ran_dry() || values_.peek() == nullptr) return;
  output_failed_ = false;
  libusb_clear_halt(session_.handle(), output_endpoint);
  if (!succeeded(session_.send(Request::output_clear_fifo))) return;
  fill_.clear();
  std::uint16_t counts = 0;
  while (values_.try_dequeue(counts)) fill_.push_back(counts);
  if (fill_.size() > ahead_) {
    fill_.erase(fill_.begin(), fill_.end() - static_cast<std::ptrdiff_t>(ahead_));
  }
  fill_.insert(fill_.begin(), ahead_ - fill_.size(), fill_.front());
  submit_fill();
  if (succeeded(session_.send(Request::output_scan_start, output_scan(plan_, output_)))) {
    output_running_ = true;
    refill_.store(Refill::none, std::memory_order_release);
    resting_at_ = -1;
  } else {
    cancel(outputs_);
  }
}

void Board::submit_fill() {
  std::size_t at = 0;
  for (const auto& one : outputs_) {
    std::size_t bytes = 0;
    for (; at < fill_.size() && bytes < one->buffer.size(); ++at) {
      one->buffer[bytes++] = static_cast<std::uint8_t>(fill_[at]);
      one->buffer[bytes++] = static_cast<std::uint8_t>(fill_[at] >> 8U);
    }
    if (bytes == 0) break;
    submit(*one, bytes);
  }
}

void Board::end_output() {
  const std::uint16_t rest = rest_.load(std::memory_order_relaxed);
  if (!output_running_ && resting_at_ == rest) return;
  if (output_running_) {
    session_.send(Request::output_scan_stop);
    cancel(outputs_);
    output_running_ = false;
  }
  refill_.store(Refill::none, std::memory_order_release);
  discard_values();
  if (succeeded(session_.send(Request::output, {}, rest, static_cast<std::uint16_t>(output_)))) {
    resting_at_ = rest;
  }
}

void Board::discard_values() {
  std::uint16_t old = 0;
  while (values_.try_dequeue(old)) {
  }
}

void Board::send_values() {
  if (!output_running_) return;
  for (const auto& one : outputs_) {
    if (one->in_flight) continue;
    std::size_t bytes = 0;
    std::uint16_t counts = 0;
    while (bytes < one->buffer.size() && values_.try_dequeue(counts)) {
      one->buffer[bytes++] = static_cast<std::uint8_t>(counts);
      one->buffer[bytes++] = static_cast<std::uint8_t>(counts >> 8U);
    }
    if (bytes == 0) return;
    submit(*one, bytes);
  }
}

}  // namespace stickslip::drivers::usb_1208fs_plus
