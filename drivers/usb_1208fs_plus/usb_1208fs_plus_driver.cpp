#include "drivers/usb_1208fs_plus/usb_1208fs_plus_driver.h"

#include <readerwriterqueue/readerwriterqueue.h>
#include <semaphore.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <span>
#include <thread>
#include <utility>

#include "drivers/usb_1208fs_plus/numbering.h"
#include "drivers/usb_1208fs_plus/protocol.h"
#include "drivers/usb_1208fs_plus/session.h"
#include "drivers/usb_events.h"

namespace stickslip::drivers {

using namespace usb_1208fs_plus;

namespace {

constexpr std::int64_t patience_of_read_ns = 20'000'000;
constexpr std::size_t room_for_frames = 4096;
constexpr std::size_t input_transfers = 16;
constexpr std::size_t output_transfers = 16;
constexpr std::size_t output_transfer_bytes = 2048;
constexpr int attempts_to_rest = 2;
constexpr std::int64_t status_period_ns = 200'000'000;
/// For transfers that were called back. What has not come by then never will.
constexpr std::chrono::seconds patience_of_call_back(2);

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

/// The board at work. A thread of its own talks to it; read and write of the driver only touch the
/// two rings and what is atomic.
class Usb1208fsPlusDriver::Board {
 public:
  Board(Session session, const ScanPlan& plan, const Calibration& calibration, int output,
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
  /// Not where it keeps().
  ~Board() {
    stop();
    sem_destroy(&available_);
  }
  Board(const Board&) = delete;
  Board& operator=(const Board&) = delete;

  bool running() const { return thread_.joinable(); }
  bool lost() const { return gone() || keeps(); }
  /// The kernel did not give transfers back: it may still write into their memory, and this object
  /// must not be destroyed.
  bool keeps() const { return keeps_.load(std::memory_order_relaxed); }
  void release() const { session_.release(); }
  /// Once stopped: whether the board has taken the voltage of rest. One that is gone has no power.
  bool rests() const { return gone() || resting_at_ == rest_.load(std::memory_order_relaxed); }
  int start();
  void stop();

  // For the loop.
  bool next(Frame& frame);
  bool drive(std::uint16_t counts, std::size_t copies) {
    for (std::size_t i = 0; i < copies; ++i) {
      if (!values_.try_enqueue(counts)) return false;
    }
    driving_.store(true, std::memory_order_release);
    return true;
  }
  void rest(std::uint16_t counts) {
    rest_.store(counts, std::memory_order_relaxed);
    driving_.store(false, std::memory_order_release);
  }
  std::size_t ahead() const { return ahead_; }
  /// The loop has not read them yet: it is behind.
  bool frames_wait() const { return frames_.peek() != nullptr; }
  bool dry() const { return dryness_.load(std::memory_order_acquire) == Dryness::dry; }
  /// What is in the queue from now on is no old drive.
  void begin_again() { dryness_.store(Dryness::begin_again, std::memory_order_release); }

  std::uint64_t written_sequence = 0;
  std::uint64_t read_sequence = 0;
  bool was_driving = false;
  std::size_t held_back = 0;  // writes, since it ran dry

  std::atomic<bool> overrun_untold = false;
  std::atomic<bool> underrun_untold = false;
  std::atomic<bool> refused = false;  // a request that has to work failed

 private:
  struct TransferEnd {
    void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
  };
  struct Transfer {
    Board* board = nullptr;
    std::unique_ptr<libusb_transfer, TransferEnd> transfer;
    std::vector<std::uint8_t> buffer;
    bool in_flight = false;
  };
  using Transfers = std::vector<std::unique_ptr<Transfer>>;

  void add(Transfers& transfers, std::uint8_t endpoint, std::size_t bytes);
  static void LIBUSB_CALL ended(libusb_transfer* transfer);
  void input_ended(Transfer& transfer);
  void output_ended(const Transfer& transfer);
  void submit(Transfer& transfer, std::size_t bytes);
  void handle_events(int milliseconds);
  bool gone() const { return gone_.load(std::memory_order_relaxed); }
  bool call_back(Transfers& transfers);
  /// Notes that the board is gone; true where the request was done.
  bool worked(int result);

  void run();
  void ask_status();
  bool begin_input();
  bool begin_scan();
  void restart_input();
  void take(std::span<const std::uint8_t> bytes);
  bool complete(std::size_t bytes);
  void publish(std::span<const std::uint16_t> codes);

  void serve_output();
  void begin_output();
  void end_output();
  void send_values();
  void throw_values_away();

  Session session_;
  ScanPlan plan_;
  Calibration calibration_;
  int output_;
  std::size_t ahead_;  // values
  HostClock& clock_;
  ScanDecoder decoder_;
  Numbering numbering_;
  std::atomic<std::uint64_t>& overruns_;
  std::atomic<std::uint64_t>& underruns_;
  std::vector<std::uint16_t> fill_;  // what is queued ahead when the output begins
  Transfers inputs_;
  Transfers outputs_;
  UsbEvents events_;
  std::thread thread_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> gone_ = false;
  std::atomic<bool> keeps_ = false;

  moodycamel::ReaderWriterQueue<Frame> frames_{room_for_frames};
  sem_t available_{};  // as often as there are frames
  moodycamel::ReaderWriterQueue<std::uint16_t> values_{4096};
  std::atomic<std::uint16_t> rest_;
  std::atomic<bool> driving_ = false;
  /// An output that ran dry begins again with what the loop writes when it has caught up: whatever
  /// came before would stay in front of it for good.
  enum class Dryness : std::uint8_t { no, dry, begin_again };
  std::atomic<Dryness> dryness_ = Dryness::no;

  // Of the thread.
  bool input_failed_ = false;
  bool output_failed_ = false;
  bool output_running_ = false;
  std::int64_t ask_at_ns_ = 0;
  int resting_at_ = -1;  // counts, where the output rests
};

void Usb1208fsPlusDriver::Board::add(Transfers& transfers, std::uint8_t endpoint,
                                     std::size_t bytes) {
  auto one = std::make_unique<Transfer>();
  one->board = this;
  one->buffer.resize(bytes);
  one->transfer.reset(libusb_alloc_transfer(0));
  libusb_fill_bulk_transfer(one->transfer.get(), session_.handle(), endpoint, one->buffer.data(),
                            static_cast<int>(bytes), &Board::ended, one.get(), 0);
  transfers.push_back(std::move(one));
}

int Usb1208fsPlusDriver::Board::start() {
  stopping_ = false;
  // What an earlier program or run left behind.
  session_.send(Request::output_scan_stop);
  session_.send(Request::input_scan_stop);
  decoder_.restart();
  const int set = session_.send(Request::input_config, input_ranges(plan_));
  if (set < 0) return set;
  thread_ = std::thread([this] { run(); });
  return 0;
}

void Usb1208fsPlusDriver::Board::stop() {
  if (!running()) return;
  stopping_ = true;
  thread_.join();
  while (frames_.peek() != nullptr) frames_.pop();
  while (sem_trywait(&available_) == 0) {
  }
}

/// Whatever becomes of the wall clock meanwhile.
bool Usb1208fsPlusDriver::Board::next(Frame& frame) {
  if (sem_trywait(&available_) != 0) {
    const timespec due = monotonic_in(patience_of_read_ns);
    int waited = 0;
    do {
      waited = sem_clockwait(&available_, CLOCK_MONOTONIC, &due);
    } while (waited != 0 && errno == EINTR);
    if (waited != 0) return false;
  }
  const Frame* oldest = frames_.peek();
  if (oldest == nullptr) return false;
  frame = *oldest;
  frames_.pop();
  return true;
}

bool Usb1208fsPlusDriver::Board::worked(int result) {
  if (result == LIBUSB_ERROR_NO_DEVICE) gone_ = true;
  return result >= 0;
}

void Usb1208fsPlusDriver::Board::run() {
  input_failed_ = output_failed_ = false;
  begin_input();
  ask_at_ns_ = clock_.now_ns() + status_period_ns;
  while (!stopping_ && !lost()) {
    handle_events(1);
    if (clock_.now_ns() >= ask_at_ns_) ask_status();
    if (input_failed_ && !lost()) restart_input();
    if (!lost()) serve_output();
  }
  // The output comes to rest even where the kernel keeps transfers.
  driving_ = false;
  for (int i = 0; i < attempts_to_rest && !rests(); ++i) serve_output();
  call_back(outputs_);
  call_back(inputs_);
  if (!gone()) session_.send(Request::input_scan_stop);
}

/// For what no endpoint says: an output that ran dry while nothing was under way to it.
void Usb1208fsPlusDriver::Board::ask_status() {
  ask_at_ns_ = clock_.now_ns() + status_period_ns;
  std::array<std::uint8_t, 2> word{};
  const int got = session_.receive(Request::status, word);
  if (!worked(got) || got != static_cast<int>(word.size())) return;
  const Status status = status_of(static_cast<std::uint16_t>(word[0] | (word[1] << 8)));
  if (status.input_overrun || !status.input_running) input_failed_ = true;
  if (output_running_ && (status.output_underrun || !status.output_running)) output_failed_ = true;
}

void Usb1208fsPlusDriver::Board::handle_events(int milliseconds) {
  static_cast<void>(events_.handle(session_.context(), std::chrono::milliseconds(milliseconds)));
}

void Usb1208fsPlusDriver::Board::ended(libusb_transfer* transfer) {
  auto& one = *static_cast<Transfer*>(transfer->user_data);
  one.board->events_.heard();
  one.in_flight = false;
  if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) {
    one.board->gone_ = true;
  } else if (transfer->endpoint == input_endpoint) {
    one.board->input_ended(one);
  } else {
    one.board->output_ended(one);
  }
}

void Usb1208fsPlusDriver::Board::submit(Transfer& transfer, std::size_t bytes) {
  transfer.transfer->length = static_cast<int>(bytes);
  if (worked(libusb_submit_transfer(transfer.transfer.get()))) {
    transfer.in_flight = true;
  } else if (transfer.transfer->endpoint == input_endpoint) {
    input_failed_ = true;
  } else {
    output_failed_ = true;
  }
}

/// Cancels them and waits until they are back. False: they never came.
bool Usb1208fsPlusDriver::Board::call_back(Transfers& transfers) {
  const auto any = [&transfers] {
    return std::any_of(transfers.begin(), transfers.end(),
                       [](const auto& one) { return one->in_flight; });
  };
  for (const auto& one : transfers) {
    if (one->in_flight) libusb_cancel_transfer(one->transfer.get());
  }
  // A kernel that keeps some is not waited for again.
  const auto now = std::chrono::steady_clock::now;
  const auto until = keeps() ? now() : now() + patience_of_call_back;
  while (any() && now() < until) handle_events(10);
  if (any()) keeps_ = true;
  return !any();
}

// Inputs

void Usb1208fsPlusDriver::Board::input_ended(Transfer& transfer) {
  if (transfer.transfer->status == LIBUSB_TRANSFER_CANCELLED || input_failed_) return;
  const auto bytes = static_cast<std::size_t>(transfer.transfer->actual_length);
  if (transfer.transfer->status != LIBUSB_TRANSFER_COMPLETED) {
    input_failed_ = true;
    return;
  }
  if (complete(bytes)) take({transfer.buffer.data(), bytes});
  if (!stopping_ && !input_failed_) submit(transfer, transfer.buffer.size());
}

/// Without end, packets are full, or one for each scan. Of one that is not, nothing says which of
/// its samples are missing: where the next scan begins is not known either, unless it has a packet
/// of its own.
bool Usb1208fsPlusDriver::Board::complete(std::size_t bytes) {
  if (plan_.immediate) {
    const bool whole = bytes == 2 * plan_.channels.size();
    if (!whole) numbering_.take();
    return whole;
  }
  if (bytes != plan_.transfer_bytes) input_failed_ = true;
  return !input_failed_;
}

bool Usb1208fsPlusDriver::Board::begin_scan() {
  libusb_clear_halt(session_.handle(), input_endpoint);
  if (!worked(session_.send(Request::input_clear_fifo))) return false;
  input_failed_ = false;
  decoder_.restart();
  for (const auto& one : inputs_) submit(*one, one->buffer.size());
  const std::int64_t begun_ns = clock_.now_ns();
  if (!worked(session_.send(Request::input_scan_start, input_scan(plan_)))) return false;
  numbering_.begin(begun_ns);
  return !input_failed_;
}

bool Usb1208fsPlusDriver::Board::begin_input() {
  input_failed_ = !begin_scan();
  refused = input_failed_ && !lost();
  return !input_failed_;
}

void Usb1208fsPlusDriver::Board::restart_input() {
  const auto wait = [this] {
    if (!lost()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  };
  if (!call_back(inputs_)) return;
  if (!worked(session_.send(Request::input_scan_stop))) {
    wait();
    return;
  }
  if (!begin_input()) {
    wait();
    return;
  }
  overruns_.fetch_add(1, std::memory_order_relaxed);
  overrun_untold.store(true, std::memory_order_release);
}

void Usb1208fsPlusDriver::Board::take(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    if (const auto codes = decoder_.next(bytes)) publish(*codes);
  }
  numbering_.arrived(clock_.now_ns());
}

void Usb1208fsPlusDriver::Board::publish(std::span<const std::uint16_t> codes) {
  std::size_t last = 0;
  for (std::size_t i = 0; i < codes.size(); ++i) {
    if (plan_.channels[i].frame_index) last = i;
  }
  Frame frame;
  frame.sequence = numbering_.take();
  frame.time_ns = to_ns(static_cast<double>(frame.sequence) * plan_.period_s +
                        static_cast<double>(last) * plan_.conversion_s());
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const ScanChannel& channel = plan_.channels[i];
    if (!channel.frame_index) continue;
    const Correction correction =
        plan_.differential ? calibration_.differential[channel.range_code][channel.channel]
                           : calibration_.single_ended[channel.channel];
    frame.set(all_channels[*channel.frame_index],
              input_volts(codes[i], channel.range_v, correction));
    frame.age_us[*channel.frame_index] = static_cast<std::int32_t>(
        std::lround(static_cast<double>(last - i) * plan_.conversion_s() * 1e6));
  }
  // Where the loop does not keep up, the jump of the sequence says so.
  if (frames_.try_enqueue(frame)) sem_post(&available_);
}

// Output

void Usb1208fsPlusDriver::Board::output_ended(const Transfer& transfer) {
  if (transfer.transfer->status != LIBUSB_TRANSFER_COMPLETED &&
      transfer.transfer->status != LIBUSB_TRANSFER_CANCELLED) {
    output_failed_ = true;
  }
}

void Usb1208fsPlusDriver::Board::serve_output() {
  if (!driving_.load(std::memory_order_acquire)) {
    end_output();
    return;
  }
  if (output_running_ && output_failed_) {
    underruns_.fetch_add(1, std::memory_order_relaxed);
    underrun_untold.store(true, std::memory_order_release);
    call_back(outputs_);
    session_.send(Request::output_scan_stop);
    output_running_ = false;
    dryness_.store(Dryness::dry, std::memory_order_release);
    throw_values_away();
    if (lost()) return;
  }
  if (!output_running_) begin_output();
  send_values();
}

/// Begins with what was written since it last ran, in its order, as far as it is not too old; and
/// before that the first of it, over and over, until as much is queued as is to be.
void Usb1208fsPlusDriver::Board::begin_output() {
  if (dry() || values_.peek() == nullptr) return;
  output_failed_ = false;
  libusb_clear_halt(session_.handle(), output_endpoint);
  if (!worked(session_.send(Request::output_clear_fifo))) return;
  fill_.clear();
  std::uint16_t counts = 0;
  while (values_.try_dequeue(counts)) fill_.push_back(counts);
  if (fill_.size() > ahead_) {
    fill_.erase(fill_.begin(), fill_.end() - static_cast<std::ptrdiff_t>(ahead_));
  }
  fill_.insert(fill_.begin(), ahead_ - fill_.size(), fill_.front());
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
  if (worked(session_.send(Request::output_scan_start, output_scan(plan_, output_)))) {
    output_running_ = true;
    dryness_.store(Dryness::no, std::memory_order_release);
    resting_at_ = -1;
  } else {
    call_back(outputs_);
  }
}

void Usb1208fsPlusDriver::Board::end_output() {
  const std::uint16_t rest = rest_.load(std::memory_order_relaxed);
  if (!output_running_ && resting_at_ == rest) return;
  if (output_running_) {
    session_.send(Request::output_scan_stop);
    call_back(outputs_);
    output_running_ = false;
  }
  dryness_.store(Dryness::no, std::memory_order_release);
  throw_values_away();
  if (worked(session_.send(Request::output, {}, rest, static_cast<std::uint16_t>(output_)))) {
    resting_at_ = rest;
  }
}

void Usb1208fsPlusDriver::Board::throw_values_away() {
  std::uint16_t old = 0;
  while (values_.try_dequeue(old)) {
  }
}

void Usb1208fsPlusDriver::Board::send_values() {
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

// The driver

Usb1208fsPlusDriver::Usb1208fsPlusDriver(const config::Usb1208fsPlus& settings,
                                         const config::BenchInputs& inputs, double rate_hz,
                                         HostClock& clock)
    : settings_(settings), inputs_(inputs), rate_hz_(rate_hz), clock_(clock) {
  description_.name = "USB-1208FS-Plus";
  description_.paced = true;
  description_.can_drive = true;
  description_.own_clock = true;
  description_.unit.fill("V");
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    if (inputs_[i]) {
      description_.channels = static_cast<std::uint8_t>(description_.channels | (1U << i));
    }
  }
}

Usb1208fsPlusDriver::~Usb1208fsPlusDriver() { close(); }

Result Usb1208fsPlusDriver::open() {
  if (board_) return {};
  refusal_.clear();
  if (settings_.output != 0 && settings_.output != 1) {
    refusal_ = "usb_1208fs_plus.output is " + std::to_string(settings_.output) +
               "; the board has the outputs 0 and 1";
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  const auto plan = plan_scan(inputs_, rate_hz_, refusal_);
  if (!plan) return {Outcome::needs_attention, refusal_.c_str()};
  Session session;
  if (const Outcome opened = session.open(settings_.serial, refusal_); opened != Outcome::ok) {
    return {opened, refusal_.c_str()};
  }
  description_.name = "USB-1208FS-Plus #" + session.serial();
  std::array<std::uint8_t, calibration_bytes> memory{};
  constexpr std::size_t piece = 64;
  for (std::size_t at = 0; at < memory.size(); at += piece) {
    const int got =
        session.receive(Request::calibration_memory, std::span(memory).subspan(at, piece),
                        static_cast<std::uint16_t>(at));
    if (got == static_cast<int>(piece)) continue;
    refusal_ = description_.name + ": its calibration memory cannot be read" +
               (got < 0 ? std::string(": ") + libusb_error_name(got) : std::string());
    return {got == LIBUSB_ERROR_NO_DEVICE ? Outcome::lost : Outcome::temporary, refusal_.c_str()};
  }
  const auto calibration = parse_calibration(memory);
  if (!calibration) {
    refusal_ = description_.name +
               ": its calibration memory holds no constants; its volts cannot be believed. Have it "
               "calibrated by the vendor's program";
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  board_ = std::make_unique<Board>(std::move(session), *plan, *calibration, settings_.output,
                                   settings_.output_ahead_s, settings_.rest_v, clock_, overruns_,
                                   underruns_);
  left_on_.clear();
  return {};
}

Result Usb1208fsPlusDriver::start() {
  if (!board_) return {Outcome::fatal, "start of a USB-1208FS-Plus that is not open"};
  if (board_->running()) return {};
  if (board_->lost()) return {Outcome::lost, "the USB-1208FS-Plus is gone; plug it in again"};
  const int started = board_->start();
  if (started >= 0) return {};
  refusal_ = description_.name + " does not take its settings: " + libusb_error_name(started);
  return {started == LIBUSB_ERROR_NO_DEVICE ? Outcome::lost : Outcome::temporary, refusal_.c_str()};
}

Result Usb1208fsPlusDriver::read(Frame& frame) {
  if (!board_ || !board_->running()) {
    return {Outcome::fatal, "read of a USB-1208FS-Plus that is not started"};
  }
  if (board_->overrun_untold.exchange(false, std::memory_order_acq_rel)) {
    return {Outcome::temporary,
            "the USB-1208FS-Plus overran and lost scans; it was started again, and how many were "
            "lost is reckoned by the host's clock"};
  }
  Frame next;
  if (board_->next(next)) {
    board_->read_sequence = next.sequence;
    frame = next;
    return {};
  }
  if (board_->lost()) return {Outcome::lost, "the USB-1208FS-Plus is gone; plug it in again"};
  if (board_->refused) return {Outcome::temporary, "the USB-1208FS-Plus does not begin to scan"};
  return {Outcome::no_data, ""};
}

Result Usb1208fsPlusDriver::write(const Actuation& actuation) {
  const bool sound = std::isfinite(actuation.drive);
  if (!board_ || !board_->running()) {
    if (!actuation.amplifier_on) return {};
    return {Outcome::fatal, "write to a USB-1208FS-Plus that is not started"};
  }
  if (board_->lost()) return {Outcome::lost, "the USB-1208FS-Plus is gone; plug it in again"};
  if (!sound || !actuation.amplifier_on) {
    board_->was_driving = false;
    board_->rest(output_counts(sound ? actuation.drive : settings_.rest_v));
    return sound ? Result{} : Result{Outcome::fatal, "the commanded drive is not finite"};
  }
  // One value for each frame since the last write: what comes out stays as far behind.
  std::uint64_t copies = board_->read_sequence - board_->written_sequence;
  if (!board_->was_driving) copies = 1;
  board_->was_driving = true;
  board_->written_sequence = board_->read_sequence;
  const bool dry = board_->dry();
  // A loop that never catches up is not waited for without end.
  const bool behind = dry && board_->frames_wait() && ++board_->held_back < room_for_frames;
  if (!behind) {
    board_->held_back = 0;
    const auto limited = dry ? 1 : std::min<std::uint64_t>(copies, board_->ahead());
    if (!board_->drive(output_counts(actuation.drive), static_cast<std::size_t>(limited))) {
      return {Outcome::temporary,
              "the USB-1208FS-Plus does not take the drive as fast as it comes"};
    }
    if (dry) board_->begin_again();
  }
  if (board_->underrun_untold.exchange(false, std::memory_order_acq_rel)) {
    return {Outcome::temporary,
            "the output of the USB-1208FS-Plus ran dry and was started again; make "
            "usb_1208fs_plus.output_ahead_s larger if it happens again"};
  }
  return {};
}

void Usb1208fsPlusDriver::stop() noexcept {
  if (!board_ || !board_->running()) return;
  board_->stop();
  if (board_->rests()) return;
  try {
    left_on_ = description_.name +
               ": its output may not be at rest: press the emergency stop, then look at cable and "
               "board. It did not take its last value";
  } catch (...) {  // without memory for a sentence
  }
}

void Usb1208fsPlusDriver::close() noexcept {
  stop();
  if (board_ && board_->keeps()) {
    // The kernel still writes into this memory. Better lost than used twice.
    board_->release();
    static_cast<void>(board_.release());
  }
  board_.reset();
}

Counts Usb1208fsPlusDriver::counts() const noexcept {
  Counts all;
  all.add({"USB-1208FS-Plus", "overruns", overruns()});
  all.add({"USB-1208FS-Plus", "underruns", underruns()});
  return all;
}

std::vector<Attached> find_usb_1208fs_plus() { return usb_1208fs_plus::find_all(); }

}  // namespace stickslip::drivers
