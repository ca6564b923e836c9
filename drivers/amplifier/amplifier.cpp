// SPDX-License-Identifier: Apache-2.0
#include "drivers/amplifier/amplifier.h"
#include "physics/number_text.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>

namespace stickslip::drivers {

namespace {

/// Period of sampling the levels, in addition to edges.
constexpr int sample_period_ms = 50;
/// Number of consecutive failures after which a chip counts as disconnected.
constexpr int max_failures = 3;
/// The kernel numbers chips from 0 and leaves gaps for unplugged ones.
constexpr int max_chips = 256;
constexpr std::size_t max_lines = 4;

bool is_disconnected(int error) {
  return error == ENODEV || error == ENXIO || error == EBADF || error == ESHUTDOWN;
}

std::string path_of(int number) { return "/dev/gpiochip" + std::to_string(number); }

constexpr const char* permission_remedy =
    "70-stickslip.rules gives GPIO chips to the group stickslip: sudo usermod -aG stickslip $USER, "
    "and log in again; if that does not help: sudo udevadm control --reload; sudo udevadm trigger "
    "--subsystem-match=gpio";

/// The chips of this host.
struct Search {
  std::vector<gpio::Chip> chips;
  std::string forbidden;  ///< path of a chip without permission to open
};

Search find_chips() {
  Search search;
  for (int number = 0; number < max_chips; ++number) {
    int error = 0;
    if (auto chip = gpio::chip_at(path_of(number), error)) {
      search.chips.push_back(std::move(*chip));
    } else if (error == EACCES || error == EPERM) {
      search.forbidden = path_of(number);
    }
  }
  return search;
}

/// True for a chip that may be unplugged. Linux 6.1 corrupts its memory when the edge events of a
/// chip are closed after the chip has gone: its interrupts no longer exist then.
bool is_on_usb(const std::string& path) {
  std::error_code error;
  const std::filesystem::path device = std::filesystem::canonical(path, error);
  if (error) return false;
  const std::filesystem::path place =
      std::filesystem::canonical("/sys/bus/gpio/devices" / device.filename(), error);
  return !error && place.string().find("/usb") != std::string::npos;
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
  // On failure, the thread wakes by itself within 50 ms.
  static_cast<void>(!::write(event, &one, sizeof one));
}

/// Joins a thread that was requested to stop.
void join(std::thread& thread, int& event) {
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
      lost_message_(
          "the GPIO chip " + settings.chip +
          " of the amplifier is disconnected: plug it in again; gpiodetect lists the chips"),
      set_failed_message_("the GPIO chip " + settings.chip +
                          " of the amplifier failed to set a line"),
      hung_message_("the GPIO chip " + settings.chip +
                    " of the amplifier does not respond: unplug it and plug it in again, unless "
                    "this host was too busy to access it"),
      emergency_stop_(settings.emergency_stop.has_value()),
      fault_(settings.fault.has_value()) {}

Amplifier::~Amplifier() { close(); }

std::uint64_t Amplifier::Command::word() const {
  return std::uint64_t{serial} << 32U | (enable ? 2U : 0U) | (heartbeat ? 1U : 0U);
}

Amplifier::Command Amplifier::Command::in(std::uint64_t word) {
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
  lost_reason_ = lost_message_.c_str();
  consecutive_failures_ = 0;
  command_ = Command();
  completed_ = 0;
  command_failed_ = false;
  command_word_ = 0;
  result_ = 0;
  next_heartbeat_ns_ = clock_.now_ns();
  open_ = true;
  stopping_ = false;
  if (enable_) {
    const int level = outputs_->get(*enable_);
    reads_back_ = level >= 0;
    if (level == 1) {
      close();
      return {Outcome::lost, set_failed_message_.c_str()};
    }
  }
  if (outputs_) {
    command_event_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    setter_ = std::thread([this] { execute_commands(); });
  }
  if (!inputs_) return {};
  std::array<bool, max_lines> none{};
  if (!sample_inputs(none)) {
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
  const Search search = find_chips();
  std::vector<gpio::Chip> matching;
  for (const gpio::Chip& chip : search.chips) {
    if (chip.name == settings_.chip || chip.label == settings_.chip) matching.push_back(chip);
  }
  if (matching.size() == 1) {
    path = matching.front().path;
    return {};
  }
  if (!matching.empty()) {
    message_ = "more than one GPIO chip is named " + settings_.chip + " (" + listed(matching) +
               "): select one by its path or name";
    return {Outcome::needs_attention, message_.c_str()};
  }
  if (!search.forbidden.empty()) {
    message_ = "the amplifier's GPIO chip " + settings_.chip + " was not found, and " +
               search.forbidden + " cannot be opened without permission: " + permission_remedy;
    return {Outcome::needs_attention, message_.c_str()};
  }
  message_ = "there is no GPIO chip with the path, name or label " + settings_.chip +
             "; present: " + listed(search.chips);
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
  const auto add = [&](const std::optional<config::GpioLine>& line, std::atomic<bool>& state) {
    if (!line) return;
    lines.push_back(*line);
    watched_.push_back({gpio::Debounced(std::llround(line->debounce_s * 1.0e9)), &state});
  };
  add(settings_.fault, fault_);
  add(settings_.emergency_stop, emergency_stop_);
  if (lines.empty()) return true;
  const gpio::Use use = is_on_usb(path) ? gpio::Use::sampled_input : gpio::Use::input;
  inputs_ = gpio::Lines::request(path, use, lines, refusal);
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
                 (refusal.consumer.empty() ? "another program" : "\"" + refusal.consumer + "\"") +
                 ": end that program, or use another line (gpioinfo " + settings_.chip + ")";
      return {Outcome::needs_attention, message_.c_str()};
    case EACCES:
    case EPERM:
      message_ = what + " cannot be opened without permission: " + permission_remedy;
      return {Outcome::needs_attention, message_.c_str()};
    case ENOENT:
      if (!refusal.line.empty()) {
        message_ = what + " does not exist: gpioinfo " + settings_.chip + " lists its lines";
        return {Outcome::needs_attention, message_.c_str()};
      }
      break;
    case ENOTTY:
    case EINVAL:
      message_ = what + " is rejected (" + std::strerror(refusal.error) +
                 "): it is not a GPIO chip, or does not support that bias or direction";
      return {Outcome::needs_attention, message_.c_str()};
    default:
      break;
  }
  message_ = what + " cannot be opened (" + std::strerror(refusal.error) +
             "): is it plugged in? gpiodetect lists the chips";
  return {Outcome::lost, message_.c_str()};
}

Result Amplifier::write(bool amplifier_on) {
  if (!open_) {
    // A closed amplifier is off.
    if (!amplifier_on) return {};
    return {Outcome::fatal, "write to an amplifier that is not open"};
  }
  const std::int64_t now = clock_.now_ns();
  const Result result = collect_result(now);
  const bool lost = lost_.load(std::memory_order_relaxed);
  Command command = command_;
  // "Off" is attempted even if the chip seems to be disconnected.
  command.enable = enable_.has_value() && amplifier_on && !lost;
  // A heartbeat edge follows only after the previous one was carried out.
  const bool done = completed_ == command_.serial && !command_failed_;
  if (heartbeat_ && !lost && done && now >= next_heartbeat_ns_) {
    command.heartbeat = !command.heartbeat;
    next_heartbeat_ns_ += heartbeat_period_ns_;
    if (next_heartbeat_ns_ <= now) next_heartbeat_ns_ = now + heartbeat_period_ns_;
  }
  if (command_failed_ || command.enable != command_.enable ||
      command.heartbeat != command_.heartbeat) {
    issue(command, now);
  }
  return lost ? Result{Outcome::lost, lost_reason_} : result;
}

Result Amplifier::switch_off() {
  Result result = write(false);
  if (!open_ || !enable_) return result;
  constexpr int timeout_ms = static_cast<int>(validity_ns / 1'000'000);
  for (int waited_ms = 0; waited_ms < timeout_ms; ++waited_ms) {
    if (completed_ == command_.serial && !command_failed_) return result;
    if (consecutive_failures_ >= max_failures) break;
    ::poll(nullptr, 0, 1);
    result = write(false);
  }
  if (!result) return result;
  return {Outcome::lost, hung_message_.c_str()};
}

void Amplifier::issue(Command command, std::int64_t now_ns) {
  if (completed_ == command_.serial) waiting_since_ns_ = now_ns;
  command.serial = command_.serial + 1;
  command_ = command;
  command_failed_ = false;
  command_word_.store(command.word(), std::memory_order_release);
  wake(command_event_);
}

Result Amplifier::collect_result(std::int64_t now_ns) {
  const std::uint64_t answer = result_.load(std::memory_order_acquire);
  const auto serial = static_cast<std::uint32_t>(answer >> 32U);
  if (serial != completed_) {
    completed_ = serial;
    waiting_since_ns_ = now_ns;
    const int error = static_cast<int>(answer & 0xFFFFU);
    consecutive_failures_ = static_cast<int>(answer >> 16U & 0xFFFFU);
    command_failed_ = error != 0 && completed_ == command_.serial;
    if (error != 0) return failed(error);
  }
  if (completed_ == command_.serial || now_ns - waiting_since_ns_ <= validity_ns) return {};
  if (!lost_.exchange(true, std::memory_order_relaxed)) lost_reason_ = hung_message_.c_str();
  return {Outcome::lost, lost_reason_};
}

Result Amplifier::failed(int error) {
  if (is_disconnected(error)) consecutive_failures_ = max_failures;
  if (consecutive_failures_ < max_failures && !lost_.load(std::memory_order_relaxed)) {
    return {Outcome::temporary, set_failed_message_.c_str()};
  }
  lost_.store(true, std::memory_order_relaxed);
  return {Outcome::lost, lost_reason_};
}

/// The line is read back: the kernel of Debian 12 (6.1) reports success for a failed USB transfer
/// if the chip's driver does not return a status of set.
int Amplifier::set_enable(bool active) noexcept {
  const int error = outputs_->set(*enable_, active);
  if (error != 0 || !reads_back_) return error;
  const int level = outputs_->get(*enable_);
  if (level < 0) return -level;
  return (level == 1) == active ? 0 : EIO;
}

void Amplifier::execute_commands() {
  // Initial levels as requested.
  bool enable_level = false;
  bool enable_level_known = true;
  bool heartbeat_level = false;
  std::uint32_t done = 0;
  std::uint32_t failures = 0;
  pollfd waited{command_event_, POLLIN, 0};
  for (;;) {
    ::poll(&waited, 1, sample_period_ms);
    std::uint64_t count = 0;
    static_cast<void>(!::read(waited.fd, &count, sizeof count));
    if (stopping_.load(std::memory_order_relaxed)) return;
    const Command command = Command::in(command_word_.load(std::memory_order_acquire));
    if (command.serial == done) continue;
    int error = 0;
    if (enable_ && (!enable_level_known || enable_level != command.enable)) {
      error = set_enable(command.enable);
      // After an error the level is unknown.
      enable_level_known = error == 0;
      enable_level = command.enable;
    }
    if (error == 0 && heartbeat_ && heartbeat_level != command.heartbeat) {
      error = outputs_->set(*heartbeat_, command.heartbeat);
      if (error == 0) heartbeat_level = command.heartbeat;
    }
    done = command.serial;
    failures = error == 0 ? 0U : std::min(failures + 1U, 0xFFFFU);
    result_.store(std::uint64_t{done} << 32U | failures << 16U | static_cast<std::uint32_t>(error),
                  std::memory_order_release);
  }
}

bool Amplifier::is_known() const noexcept {
  const std::int64_t sampled_ns = sampled_ns_.load(std::memory_order_acquire);
  return !lost_.load(std::memory_order_relaxed) && clock_.now_ns() - sampled_ns <= validity_ns;
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

void Amplifier::set_unknown() noexcept {
  emergency_stop_.store(settings_.emergency_stop.has_value(), std::memory_order_relaxed);
  fault_.store(settings_.fault.has_value(), std::memory_order_relaxed);
}

/// False: the chip did not respond.
bool Amplifier::sample_inputs(std::span<bool> went_active) {
  const std::int64_t start_ns = clock_.now_ns();
  if (inputs_->take_edges(went_active) != 0) return false;
  for (std::size_t i = 0; i < watched_.size(); ++i) {
    const int level = inputs_->get(i);
    if (level < 0) return false;
    const std::int64_t now = clock_.now_ns();
    // A pulse between two samples counts as active.
    if (went_active[i]) watched_[i].state.update(true, now);
    watched_[i].result->store(watched_[i].state.update(level == 1, now), std::memory_order_relaxed);
  }
  sampled_ns_.store(start_ns, std::memory_order_release);
  return true;
}

void Amplifier::watch_inputs() {
  std::vector<pollfd> waited{{wake_, POLLIN, 0}};
  for (const int file : inputs_->edge_files()) waited.push_back({file, POLLIN, 0});
  int failures = 0;
  std::array<bool, max_lines> went_active{};
  for (;;) {
    ::poll(waited.data(), waited.size(), sample_period_ms);
    if (stopping_.load(std::memory_order_relaxed)) return;
    // An edge is kept until it is published, even if the chip fails meanwhile.
    if (sample_inputs(went_active)) {
      failures = 0;
      went_active.fill(false);
      continue;
    }
    if (++failures < max_failures) continue;
    lost_.store(true, std::memory_order_relaxed);
    set_unknown();
    return;
  }
}

void Amplifier::close() noexcept {
  stopping_.store(true, std::memory_order_relaxed);
  join(setter_, command_event_);
  if (outputs_ && enable_) outputs_->set(*enable_, false);
  join(watcher_, wake_);
  outputs_.reset();
  inputs_.reset();
  open_ = false;
  set_unknown();
}

std::vector<AttachedDevice> find_gpio_chips() {
  std::vector<AttachedDevice> found;
  for (int number = 0; number < max_chips; ++number) {
    int error = 0;
    const std::string path = path_of(number);
    if (const auto chip = gpio::chip_at(path, error)) {
      found.push_back({"gpio", chip->label + ", " + physics::counted(chip->lines, "line"),
                       chip->name, path, ""});
    } else if (error == EACCES || error == EPERM) {
      found.push_back({"gpio", "GPIO chip", "", path, permission_remedy});
    }
  }
  return found;
}

}  // namespace stickslip::drivers
