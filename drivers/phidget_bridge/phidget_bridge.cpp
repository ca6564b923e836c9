// SPDX-License-Identifier: Apache-2.0
#include "drivers/phidget_bridge/phidget_bridge.h"

#include <hidapi/hidapi.h>

#include <algorithm>
#include <array>
#include <cwchar>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include "drivers/clock/arrival_scatter.h"
#include "drivers/phidget_bridge/protocol.h"
#include "drivers/usb/udev_rule.h"
#include "drivers/usb/usb_boards.h"

namespace stickslip::drivers {

using namespace phidget_bridge;

namespace {

constexpr int timeout_ms = 200;
constexpr std::size_t max_report_bytes = 64;
/// If the descriptor cannot be read: the maximum of a full-speed report.
constexpr std::size_t default_output_bytes = 64;
/// More than the kernel buffers; bounds a read.
constexpr std::uint64_t max_reports = 1024;
constexpr std::int64_t settle_ns = 3'000'000'000;
constexpr std::int64_t repeat_ns = 500'000'000;

struct CloseDevice {
  void operator()(hid_device* device) const { hid_close(device); }
};
struct FreeList {
  void operator()(hid_device_info* list) const { hid_free_enumeration(list); }
};
using Device = std::unique_ptr<hid_device, CloseDevice>;

struct Found {
  std::string path;
  std::string serial;
  std::optional<int> firmware;
};

std::vector<Found> search() {
  std::vector<Found> found;
  const std::unique_ptr<hid_device_info, FreeList> list(hid_enumerate(vendor_id, product_id));
  for (const hid_device_info* one = list.get(); one != nullptr; one = one->next) {
    if (one->interface_number > 0) continue;
    Found board;
    board.path = one->path;
    board.firmware = firmware_of(one->release_number);
    for (const wchar_t* letter = one->serial_number; letter != nullptr && *letter != 0; ++letter) {
      if (*letter > L' ' && *letter < 0x7F) board.serial += static_cast<char>(*letter);
    }
    found.push_back(std::move(board));
  }
  return found;
}

bool is_there(const std::string& path) {
  const auto found = search();
  return std::any_of(found.begin(), found.end(),
                     [&path](const Found& one) { return one.path == path; });
}

std::string title_of(const Found& board) {
  return "PhidgetBridge 1046" + (board.serial.empty() ? "" : " #" + board.serial);
}

std::string firmware_text(std::optional<int> firmware) {
  if (!firmware) return "of unknown version";
  const std::string decimals = std::to_string(*firmware % 100);
  return std::to_string(*firmware / 100) + (decimals.size() < 2 ? ".0" : ".") + decimals;
}

/// Message about an unsupported version; empty: supported.
std::string unsupported_version(const Found& board) {
  if (!board.firmware) {
    return title_of(board) + " at " + board.path +
           ": the kernel knows no release of this device, so its version cannot be determined "
           "(expected 1.00 to 1.99). Connect it by USB, not through a virtual HID device";
  }
  if (*board.firmware >= first_firmware && *board.firmware <= last_firmware) return {};
  return title_of(board) + " at " + board.path + " has firmware " + firmware_text(board.firmware) +
         ": that is a 1046_1 or newer, which uses a different protocol. Only the 1046 (1046_0, "
         "firmware 1.00 to 1.99) is supported";
}

std::string refused_access(const Found& board) {
  return title_of(board) + ": " + board.path + " cannot be opened by this user. " +
         udev_rule_remedy;
}

/// The bridge to open. Null: `problem` holds reason and remedy.
const Found* chosen_of(const std::vector<Found>& boards, const WantedUsbBoard& wanted,
                       UsbProblem& problem) {
  const Found* chosen = nullptr;
  std::string present;
  for (const Found& board : boards) {
    if (!present.empty()) present += ", ";
    present += board.serial.empty() ? board.path : board.serial;
    if (!wanted.serial.empty() && board.serial != wanted.serial) continue;
    if (chosen != nullptr) {
      problem = {Outcome::needs_attention,
                 "several PhidgetBridges are attached; select one with phidget_bridge.serial"};
      return nullptr;
    }
    chosen = &board;
  }
  if (boards.empty()) {
    problem = {Outcome::lost,
               "no PhidgetBridge 1046 (06c2:003b) is attached; plug it in. `lsusb -d 06c2:` shows "
               "whether the host detects it. A 1046_1 uses a different protocol and is not "
               "supported"};
  } else if (chosen == nullptr) {
    problem = {Outcome::needs_attention, "no PhidgetBridge with serial number " + wanted.serial +
                                             " is attached; present: " + present +
                                             (wanted.of_start ? not_that_of_the_start : "")};
  }
  return chosen;
}

/// Length of an output report, by the kernel's copy of the report descriptor.
std::size_t output_length(const std::string& path) {
  const std::string name = path.substr(path.rfind('/') + 1);
  std::ifstream file("/sys/class/hidraw/" + name + "/device/report_descriptor", std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(file), {}};
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  const std::size_t length = output_report_bytes(bytes);
  return length >= output_bytes ? length : default_output_bytes;
}

std::optional<std::size_t> input_number(const std::string& name) {
  if (name.size() != 1 || name[0] < '0' || name[0] > '3') return std::nullopt;
  return static_cast<std::size_t>(name[0] - '0');
}

}  // namespace

struct PhidgetBridge::Board {
  Board(Device opened, std::size_t length, const Settings& settings, int firmware)
      : device(std::move(opened)),
        output_length(length),
        handshake(settings, firmware),
        interval_ms(settings.interval_ms),
        gaps(interval_ns()),
        arrivals(interval_ns()) {}

  Device device;
  std::size_t output_length;
  Handshake handshake;
  int interval_ms;  // as stated by the latest report with one that exists; until then as requested
  bool interval_stated = false;
  GapCounter gaps;
  ArrivalScatter arrivals;
  /// Latest reading of an input; `fresh` until it is published.
  struct Latest {
    bool fresh = false;
    double value = 0.0;
    bool valid = false;
    std::int64_t time_ns = 0;
  };
  std::array<Latest, input_count> latest{};

  std::int64_t interval_ns() const { return std::int64_t{interval_ms} * 1'000'000; }

  void take(const InputReport& report) {
    handshake.take(report);
    interval_stated = is_interval(report.settings.interval_ms);
    if (!interval_stated || report.settings.interval_ms == interval_ms) return;
    interval_ms = report.settings.interval_ms;
    gaps = GapCounter(interval_ns());
    arrivals = ArrivalScatter(interval_ns());
  }

  void note(const InputReport& report) {
    for (std::size_t i = 0; i < input_count; ++i) {
      if (!report.measured[i] || !handshake.settled(i)) continue;
      latest[i].fresh = true;
      latest[i].value = ratio(report.raw[i], report.settings.gain[i]);
      latest[i].valid = is_valid(report, i);
    }
  }
};

PhidgetBridge::PhidgetBridge(const config::PhidgetBridge& settings,
                             const config::BenchInputs& inputs, HostClock& clock)
    : settings_(settings), wired_(inputs), clock_(clock) {
  for (const auto& input : wired_) {
    if (!input) continue;
    inputs_.push_back({input->device, input->input, "V/V"});
    numbers_.push_back(input_number(input->input).value_or(input_count));
  }
}

PhidgetBridge::~PhidgetBridge() { close(); }

Result PhidgetBridge::check() {
  const auto refuse = [this](std::string text) {
    refusal_ = std::move(text);
    return Result{Outcome::needs_attention, refusal_.c_str()};
  };
  if (inputs_.empty()) return refuse("PhidgetBridge: no channel is assigned to its inputs");
  if (!is_interval(settings_.interval_ms)) {
    return refuse("phidget_bridge.interval_ms is " + std::to_string(settings_.interval_ms) +
                  "; it must be a multiple of 8 from 8 to 1000");
  }
  std::array<bool, input_count> taken{};
  for (const auto& input : wired_) {
    if (!input) continue;
    const auto number = input_number(input->input);
    if (!number) {
      return refuse("PhidgetBridge: there is no input " + input->input + "; it has 0, 1, 2 and 3");
    }
    if (!is_gain(input->gain)) {
      return refuse("PhidgetBridge: the gain of input " + input->input + " is " +
                    std::to_string(input->gain) + "; it has 1, 8, 16, 32, 64 and 128");
    }
    if (std::exchange(taken[*number], true)) {
      return refuse("PhidgetBridge: the input " + input->input + " is assigned to two channels");
    }
  }
  return {};
}

Result PhidgetBridge::open() {
  if (board_) return {};
  losses_ = {};
  if (const Result checked = check(); !checked) return checked;
  if (hid_init() != 0) return {Outcome::fatal, "hidapi cannot be initialized"};
  const auto boards = search();
  UsbProblem problem;
  const WantedUsbBoard wanted = wanted_usb_board(
      settings_.serial ? std::to_string(*settings_.serial) : std::string(), serial_at_start_);
  const Found* chosen = chosen_of(boards, wanted, problem);
  if (chosen == nullptr) {
    refusal_ = std::move(problem.text);
    return {problem.outcome, refusal_.c_str()};
  }
  refusal_ = unsupported_version(*chosen);
  if (!refusal_.empty()) return {Outcome::needs_attention, refusal_.c_str()};
  Device device(hid_open_path(chosen->path.c_str()));
  if (!device && !is_there(chosen->path)) return gone();
  if (!device) {
    refusal_ = refused_access(*chosen);
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  // Once: other threads read the name while a lost bridge is reopened.
  if (name_ != title_of(*chosen)) name_ = title_of(*chosen);
  board_ = std::make_unique<Board>(std::move(device), output_length(chosen->path),
                                   wanted_settings(), *chosen->firmware);
  const Result settled = settle();
  if (settled) {
    serial_at_start_ = chosen->serial;
  } else {
    close();
  }
  return settled;
}

Settings PhidgetBridge::wanted_settings() const {
  Settings wanted;
  wanted.interval_ms = settings_.interval_ms;
  std::size_t index = 0;
  for (const auto& input : wired_) {
    if (!input) continue;
    wanted.enabled[numbers_[index]] = true;
    wanted.gain[numbers_[index++]] = input->gain;
  }
  return wanted;
}

std::string PhidgetBridge::remark() const {
  if (!board_) return {};
  const std::string requested = std::to_string(settings_.interval_ms) + " ms";
  if (!board_->interval_stated) return "states no valid interval; " + requested + " is assumed";
  if (board_->interval_ms == settings_.interval_ms) return {};
  return "measures every " + std::to_string(board_->interval_ms) + " ms, " + requested +
         " was requested";
}

Result PhidgetBridge::gone() {
  refusal_ = name_ + " is disconnected; plug it in again";
  return {Outcome::lost, refusal_.c_str()};
}

Result PhidgetBridge::send() {
  const auto report = board_->handshake.to_send();
  if (!report) return {};
  // The first byte is the report ID, which this device does not use.
  std::vector<std::uint8_t> bytes(1 + board_->output_length);
  std::copy(report->begin(), report->end(), bytes.begin() + 1);
  return hid_write(board_->device.get(), bytes.data(), bytes.size()) < 0 ? gone() : Result{};
}

Result PhidgetBridge::settle() {
  const std::int64_t start_ns = clock_.now_ns();
  const auto longest = [this] { return settle_ns + 5 * board_->interval_ns(); };
  std::int64_t sent = start_ns;
  // The count of time-outs bounds the loop even with a clock that stands still in a test.
  for (int silent = 0; silent < 15 && clock_.now_ns() - start_ns < longest();) {
    if (const Result sent_now = send(); !sent_now) return sent_now;
    std::array<std::uint8_t, max_report_bytes> bytes{};
    const int got = hid_read_timeout(board_->device.get(), bytes.data(), bytes.size(), timeout_ms);
    if (got < 0) return gone();
    silent = got == 0 ? silent + 1 : 0;
    if (const auto report = parse_input({bytes.data(), static_cast<std::size_t>(got)})) {
      board_->take(*report);
    }
    if (board_->handshake.done()) {
      board_->gaps.restart();
      return {};
    }
    if (clock_.now_ns() - sent > repeat_ns) {
      board_->handshake.repeat();
      sent = clock_.now_ns();
    }
  }
  refusal_ =
      name_ +
      " does not confirm its settings; unplug it and plug it in again, and make sure that no "
      "other program (phidget22networkserver) uses it";
  return {Outcome::temporary, refusal_.c_str()};
}

Result PhidgetBridge::read(std::span<Reading> readings) {
  if (!board_) return {Outcome::fatal, "read of a PhidgetBridge that is not open"};
  if (const Result sent_now = send(); !sent_now) return sent_now;
  std::uint64_t reports = 0;
  std::uint64_t rejected = 0;
  while (reports < max_reports) {
    std::array<std::uint8_t, max_report_bytes> bytes{};
    const int got = hid_read_timeout(board_->device.get(), bytes.data(), bytes.size(),
                                     reports == 0 ? timeout_ms : 0);
    if (got < 0) return gone();
    if (got == 0) break;
    ++reports;
    const auto report = parse_input({bytes.data(), static_cast<std::size_t>(got)});
    if (report) board_->take(*report);
    if (report && board_->handshake.done()) {
      board_->note(*report);
    } else {
      ++rejected;
    }
  }
  const std::int64_t now = clock_.now_ns();
  if (reports > 0) losses_.missing += board_->gaps.count(now, reports);
  losses_.rejected += rejected;
  if (publish(readings, now)) return {};
  if (rejected == 0) return {Outcome::no_data, ""};
  return {Outcome::temporary, "the reports of the PhidgetBridge do not match its settings"};
}

/// True if a reading is new or has become invalid.
bool PhidgetBridge::publish(std::span<Reading> readings, std::int64_t now) {
  const std::int64_t max_age = 5 * board_->interval_ns() / 2;
  const auto is_fresh = [this](std::size_t number) { return board_->latest[number].fresh; };
  if (std::any_of(numbers_.begin(), numbers_.end(), is_fresh)) board_->arrivals.add(now);
  bool any = false;
  for (std::size_t i = 0; i < std::min(readings.size(), numbers_.size()); ++i) {
    Board::Latest& latest = board_->latest[numbers_[i]];
    if (latest.fresh) {
      latest.fresh = false;
      latest.time_ns = now;
      readings[i] = {latest.value, now, latest.valid, board_->arrivals.sigma_ns()};
      any = true;
    } else if (latest.valid && now - latest.time_ns > max_age) {
      latest.valid = false;
      readings[i] = {latest.value, now, false};
      any = true;
    }
  }
  return any;
}

void PhidgetBridge::close() noexcept { board_.reset(); }

std::vector<AttachedDevice> find_phidget_bridge() {
  std::vector<AttachedDevice> attached;
  if (hid_init() != 0) return attached;
  for (const Found& board : search()) {
    AttachedDevice one;
    one.kind = "phidget_bridge";
    one.name = title_of(board) + ", firmware " + firmware_text(board.firmware);
    one.serial = board.serial;
    one.location = board.path;
    one.problem = unsupported_version(board);
    if (one.problem.empty() && !Device(hid_open_path(board.path.c_str()))) {
      one.problem = refused_access(board);
    }
    attached.push_back(std::move(one));
  }
  return attached;
}

}  // namespace stickslip::drivers
