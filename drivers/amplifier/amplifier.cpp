#include "drivers/amplifier/amplifier.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace stickslip::drivers {

namespace {

/// Levels are looked at so often, edges or not.
constexpr int look_every_ms = 50;
/// A chip that fails so often in a row is taken for gone.
constexpr int failures_of_a_lost_chip = 3;
/// The kernel numbers chips from 0 on and leaves gaps where one was unplugged.
constexpr int most_chips = 256;
constexpr std::size_t most_lines = 4;

bool is_gone(int error) {
  return error == ENODEV || error == ENXIO || error == EBADF || error == ESHUTDOWN;
}

std::string path_of(int number) { return "/dev/gpiochip" + std::to_string(number); }

constexpr const char* permission_cure =
    "70-stickslip.rules gives GPIO chips to the group stickslip: sudo usermod -aG stickslip $USER, "
    "and log in again; if that does not help: sudo udevadm control --reload; sudo udevadm trigger "
    "--subsystem-match=gpio";

/// What has been seen of the chips of this host.
struct Search {
  std::vector<gpio::Chip> chips;
  std::string forbidden;  ///< the path of one that may not be opened
};

Search look_for_chips() {
  Search search;
  for (int number = 0; number < most_chips; ++number) {
    int error = 0;
    if (auto chip = gpio::chip_at(path_of(number), error)) {
      search.chips.push_back(std::move(*chip));
    } else if (error == EACCES || error == EPERM) {
      search.forbidden = path_of(number);
    }
  }
  return search;
}

std::string listed(const std::vector<gpio::Chip>& chips) {
  std::string text;
  for (const gpio::Chip& chip : chips) {
    if (!text.empty()) text += ", ";
    text += chip.name;
    text += " [" + chip.label + "]";
  }
  return text.empty() ? "none" : text;
}

void wake(int event) {
  const std::uint64_t one = 1;
  // If this should fail, the thread looks for itself within 50 ms.
  static_cast<void>(!::write(event, &one, sizeof one));
}

/// Of a thread that has been told to stop.
void end(std::thread& thread, int& event) {
  if (thread.joinable()) {
    wake(event);
    thread.join();
  }
  if (event >= 0) ::close(event);
  event = -1;
}

}  // namespace

Amplifier::Amplifier(const config::Amplifier& settings, HostClock& clock)
    : settings_(settings),
      clock_(clock),
      heartbeat_period_ns_(
          std::max<std::int64_t>(std::llround(settings.heartbeat_period_s * 1.0e9), 1)),
      lost_message_("the GPIO chip " + settings.chip +
                    " of the amplifier is gone: plug it in again; gpiodetect lists what is there"),
      failed_message_("the GPIO chip " + settings.chip +
                      " of the amplifier did not do what it was told this time"),
      hangs_message_("the GPIO chip " + settings.chip +
                     " of the amplifier does not answer: pull it out and plug it in again, unless "
                     "this host was too busy to ask it"),
      emergency_stop_(settings.emergency_stop.has_value()),
      fault_(settings.fault.has_value()) {}

Amplifier::~Amplifier() { close(); }

std::uint64_t Amplifier::Order::word() const {
  return std::uint64_t{serial} << 32U | (enable ? 2U : 0U) | (heartbeat ? 1U : 0U);
}

Amplifier::Order Amplifier::Order::in(std::uint64_t word) {
  return {(word & 2U) != 0, (word & 1U) != 0, static_cast<std::uint32_t>(word >> 32U)};
}

Result Amplifier::open() {
  close();
  std::string path;
  if (const Result found = find_chip(path); !found) return found;
  gpio::Refusal refusal;
  if (!request_outputs(path, refusal) || !request_inputs(path, refusal)) {
    outputs_.reset();
    inputs_.reset();
    return refused(refusal);
  }
  lost_ = false;
  lost_because_ = lost_message_.c_str();
  failures_in_row_ = 0;
  order_ = Order();
  answered_ = 0;
  order_failed_ = false;
  given_ = 0;
  answer_ = 0;
  next_beat_ns_ = clock_.now_ns();
  open_ = true;
  stopping_ = false;
  if (enable_) {
    const int level = outputs_->get(*enable_);
    reads_back_ = level >= 0;
    if (level == 1) {
      close();
      return {Outcome::lost, failed_message_.c_str()};
    }
  }
  if (outputs_) {
    given_event_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    setter_ = std::thread([this] { carry_out_orders(); });
  }
  if (!inputs_) return {};
  std::array<bool, most_lines> none{};
  if (!look_at_inputs(none)) {
    close();
    return {Outcome::lost, lost_message_.c_str()};
  }
  wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  watcher_ = std::thread([this] { watch_inputs(); });
  return {};
}

Result Amplifier::find_chip(std::string& path) {
  if (settings_.chip.starts_with('/')) {
    path = settings_.chip;
    return {};
  }
  const Search search = look_for_chips();
  std::vector<gpio::Chip> fitting;
  for (const gpio::Chip& chip : search.chips) {
    if (chip.name == settings_.chip || chip.label == settings_.chip) fitting.push_back(chip);
  }
  if (fitting.size() == 1) {
    path = fitting.front().path;
    return {};
  }
  if (!fitting.empty()) {
    message_ = "more than one GPIO chip is called " + settings_.chip + " (" + listed(fitting) +
               "): say which by its path or name";
    return {Outcome::needs_attention, message_.c_str()};
  }
  if (!search.forbidden.empty()) {
    message_ = "the amplifier's GPIO chip " + settings_.chip + " was not found, and " +
               search.forbidden + " may not be opened: " + permission_cure;
    return {Outcome::needs_attention, message_.c_str()};
  }
  message_ = "there is no GPIO chip with the path, name or label " + settings_.chip +
             "; there is: " + listed(search.chips);
  return {Outcome::lost, message_.c_str()};
}

bool Amplifier::request_outputs(const std::string& path, gpio::Refusal& refusal) {
  std::vector<config::GpioLine> lines;
  enable_.reset();
  heartbeat_.reset();
  if (settings_.enable) {
    enable_ = lines.size();
    lines.push_back(*settings_.enable);
  }
  if (settings_.heartbeat) {
    heartbeat_ = lines.size();
    lines.push_back(*settings_.heartbeat);
  }
  if (lines.empty()) return true;
  outputs_ = gpio::Lines::request(path, gpio::Use::output, lines, refusal);
  return outputs_ != nullptr;
}

bool Amplifier::request_inputs(const std::string& path, gpio::Refusal& refusal) {
  std::vector<config::GpioLine> lines;
  watched_.clear();
  const auto add = [&](const std::optional<config::GpioLine>& line, std::atomic<bool>& told) {
    if (!line) return;
    lines.push_back(*line);
    watched_.push_back({gpio::Debounced(std::llround(line->debounce_s * 1.0e9)), &told});
  };
  add(settings_.fault, fault_);
  add(settings_.emergency_stop, emergency_stop_);
  if (lines.empty()) return true;
  inputs_ = gpio::Lines::request(path, gpio::Use::input, lines, refusal);
  return inputs_ != nullptr;
}

Result Amplifier::refused(const gpio::Refusal& refusal) {
  const std::string what =
      refusal.line.empty()
          ? "the amplifier's GPIO chip " + settings_.chip
          : "line " + refusal.line + " of the amplifier's GPIO chip " + settings_.chip;
  switch (refusal.error) {
    case EBUSY:
      message_ = what + " is used by " +
                 (refusal.consumer.empty() ? "somebody else" : "\"" + refusal.consumer + "\"") +
                 ": end that program, or take another line (gpioinfo " + settings_.chip + ")";
      return {Outcome::needs_attention, message_.c_str()};
    case EACCES:
    case EPERM:
      message_ = what + " may not be opened: " + permission_cure;
      return {Outcome::needs_attention, message_.c_str()};
    case ENOENT:
      if (!refusal.line.empty()) {
        message_ = what + " does not exist: gpioinfo " + settings_.chip + " lists its lines";
        return {Outcome::needs_attention, message_.c_str()};
      }
      break;
    case ENOTTY:
    case EINVAL:
      message_ = what + " refuses (" + std::strerror(refusal.error) +
                 "): it is no GPIO chip, or cannot do that bias or direction";
      return {Outcome::needs_attention, message_.c_str()};
    default:
      break;
  }
  message_ = what + " cannot be opened (" + std::strerror(refusal.error) +
             "): is it plugged in? gpiodetect lists what is there";
  return {Outcome::lost, message_.c_str()};
}

Result Amplifier::write(bool amplifier_on) {
  if (!open_) {
    // Off is what it is already.
    if (!amplifier_on) return {};
    return {Outcome::fatal, "write to an amplifier that is not open"};
  }
  const std::int64_t now = clock_.now_ns();
  const Result result = take_answer(now);
  const bool gone = lost_.load(std::memory_order_relaxed);
  Order order = order_;
  // Off is tried even where the chip seems to be gone.
  order.enable = enable_.has_value() && amplifier_on && !gone;
  // A beat is not turned back before it was one.
  const bool done = answered_ == order_.serial && !order_failed_;
  if (heartbeat_ && !gone && done && now >= next_beat_ns_) {
    order.heartbeat = !order.heartbeat;
    next_beat_ns_ += heartbeat_period_ns_;
    if (next_beat_ns_ <= now) next_beat_ns_ = now + heartbeat_period_ns_;
  }
  if (order_failed_ || order.enable != order_.enable || order.heartbeat != order_.heartbeat) {
    give(order, now);
  }
  return gone ? Result{Outcome::lost, lost_because_} : result;
}

Result Amplifier::switch_off() {
  Result result = write(false);
  if (!open_ || !enable_) return result;
  constexpr int patience_ms = static_cast<int>(believed_for_ns / 1'000'000);
  for (int waited_ms = 0; waited_ms < patience_ms; ++waited_ms) {
    if (answered_ == order_.serial && !order_failed_) return result;
    if (failures_in_row_ >= failures_of_a_lost_chip) break;
    ::poll(nullptr, 0, 1);
    result = write(false);
  }
  if (!result) return result;
  return {Outcome::lost, hangs_message_.c_str()};
}

void Amplifier::give(Order order, std::int64_t now_ns) {
  if (answered_ == order_.serial) waiting_since_ns_ = now_ns;
  order.serial = order_.serial + 1;
  order_ = order;
  order_failed_ = false;
  given_.store(order.word(), std::memory_order_release);
  wake(given_event_);
}

Result Amplifier::take_answer(std::int64_t now_ns) {
  const std::uint64_t answer = answer_.load(std::memory_order_acquire);
  const auto serial = static_cast<std::uint32_t>(answer >> 32U);
  if (serial != answered_) {
    answered_ = serial;
    waiting_since_ns_ = now_ns;
    const int error = static_cast<int>(answer & 0xFFFFU);
    failures_in_row_ = static_cast<int>(answer >> 16U & 0xFFFFU);
    order_failed_ = error != 0 && answered_ == order_.serial;
    if (error != 0) return failed(error);
  }
  if (answered_ == order_.serial || now_ns - waiting_since_ns_ <= believed_for_ns) return {};
  if (!lost_.exchange(true, std::memory_order_relaxed)) lost_because_ = hangs_message_.c_str();
  return {Outcome::lost, lost_because_};
}

Result Amplifier::failed(int error) {
  if (is_gone(error)) failures_in_row_ = failures_of_a_lost_chip;
  if (failures_in_row_ < failures_of_a_lost_chip && !lost_.load(std::memory_order_relaxed)) {
    return {Outcome::temporary, failed_message_.c_str()};
  }
  lost_.store(true, std::memory_order_relaxed);
  return {Outcome::lost, lost_because_};
}

/// What the line holds is read again: Debian 12's kernel (6.1), where a chip's driver cannot answer
/// a set, says that it was well even when the transfer at USB failed.
int Amplifier::set_enable(bool active) noexcept {
  const int error = outputs_->set(*enable_, active);
  if (error != 0 || !reads_back_) return error;
  const int level = outputs_->get(*enable_);
  if (level < 0) return -level;
  return (level == 1) == active ? 0 : EIO;
}

void Amplifier::carry_out_orders() {
  // As they were requested.
  bool enable_is = false;
  bool enable_is_known = true;
  bool heartbeat_is = false;
  std::uint32_t done = 0;
  std::uint32_t failures = 0;
  pollfd waited{given_event_, POLLIN, 0};
  for (;;) {
    ::poll(&waited, 1, look_every_ms);
    std::uint64_t count = 0;
    static_cast<void>(!::read(waited.fd, &count, sizeof count));
    if (stopping_.load(std::memory_order_relaxed)) return;
    const Order order = Order::in(given_.load(std::memory_order_acquire));
    if (order.serial == done) continue;
    int error = 0;
    if (enable_ && (!enable_is_known || enable_is != order.enable)) {
      error = set_enable(order.enable);
      // What the line holds after an error nobody knows.
      enable_is_known = error == 0;
      enable_is = order.enable;
    }
    if (error == 0 && heartbeat_ && heartbeat_is != order.heartbeat) {
      error = outputs_->set(*heartbeat_, order.heartbeat);
      if (error == 0) heartbeat_is = order.heartbeat;
    }
    done = order.serial;
    failures = error == 0 ? 0U : std::min(failures + 1U, 0xFFFFU);
    answer_.store(std::uint64_t{done} << 32U | failures << 16U | static_cast<std::uint32_t>(error),
                  std::memory_order_release);
  }
}

bool Amplifier::is_known() const noexcept {
  const std::int64_t looked_ns = looked_ns_.load(std::memory_order_acquire);
  return !lost_.load(std::memory_order_relaxed) && clock_.now_ns() - looked_ns <= believed_for_ns;
}

Signals Amplifier::signals() const noexcept {
  const bool unknown = !is_known();
  Signals signals;
  signals.emergency_stop = settings_.emergency_stop.has_value() &&
                           (unknown || emergency_stop_.load(std::memory_order_relaxed));
  signals.amplifier_fault =
      settings_.fault.has_value() && (unknown || fault_.load(std::memory_order_relaxed));
  return signals;
}

void Amplifier::say_unknown() noexcept {
  emergency_stop_.store(settings_.emergency_stop.has_value(), std::memory_order_relaxed);
  fault_.store(settings_.fault.has_value(), std::memory_order_relaxed);
}

/// False: the chip did not answer.
bool Amplifier::look_at_inputs(std::span<bool> went_active) {
  const std::int64_t begun_ns = clock_.now_ns();
  if (inputs_->take_edges(went_active) != 0) return false;
  for (std::size_t i = 0; i < watched_.size(); ++i) {
    const int level = inputs_->get(i);
    if (level < 0) return false;
    const std::int64_t now = clock_.now_ns();
    // It was active in between, however shortly.
    if (went_active[i]) watched_[i].state.update(true, now);
    watched_[i].told->store(watched_[i].state.update(level == 1, now), std::memory_order_relaxed);
  }
  looked_ns_.store(begun_ns, std::memory_order_release);
  return true;
}

void Amplifier::watch_inputs() {
  std::vector<pollfd> waited{{wake_, POLLIN, 0}};
  for (const int file : inputs_->edge_files()) waited.push_back({file, POLLIN, 0});
  int failures = 0;
  std::array<bool, most_lines> went_active{};
  for (;;) {
    ::poll(waited.data(), waited.size(), look_every_ms);
    if (stopping_.load(std::memory_order_relaxed)) return;
    // What went active is not forgotten where the chip fails before it was told.
    if (look_at_inputs(went_active)) {
      failures = 0;
      went_active.fill(false);
      continue;
    }
    if (++failures < failures_of_a_lost_chip) continue;
    lost_.store(true, std::memory_order_relaxed);
    say_unknown();
    return;
  }
}

void Amplifier::close() noexcept {
  stopping_.store(true, std::memory_order_relaxed);
  end(setter_, given_event_);
  if (outputs_ && enable_) outputs_->set(*enable_, false);
  end(watcher_, wake_);
  outputs_.reset();
  inputs_.reset();
  open_ = false;
  say_unknown();
}

std::vector<Attached> find_gpio_chips() {
  std::vector<Attached> found;
  for (int number = 0; number < most_chips; ++number) {
    int error = 0;
    const std::string path = path_of(number);
    if (const auto chip = gpio::chip_at(path, error)) {
      found.push_back({"gpio", chip->label + ", " + std::to_string(chip->lines) + " lines",
                       chip->name, path, ""});
    } else if (error == EACCES || error == EPERM) {
      found.push_back({"gpio", "GPIO chip", "", path, permission_cure});
    }
  }
  return found;
}

}  // namespace stickslip::drivers
