// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/usb_1208fs_plus_driver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "drivers/usb_1208fs_plus/board.h"

namespace stickslip::drivers {

using namespace usb_1208fs_plus;

namespace {
constexpr const char* lost_message = "the USB-1208FS-Plus is disconnected; plug it in again";
}

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

Result Usb1208fsPlusDriver::refuse(Outcome outcome, std::string text) {
  refusal_ = std::move(text);
  return {outcome, refusal_.c_str()};
}

Result Usb1208fsPlusDriver::open() {
  if (board_) return {};
  refusal_.clear();
  if (settings_.output != 0 && settings_.output != 1) {
    return refuse(Outcome::needs_attention, "usb_1208fs_plus.output is " +
                                                std::to_string(settings_.output) +
                                                "; the board has outputs 0 and 1");
  }
  const auto plan = plan_scan(inputs_, settings_, rate_hz_, refusal_);
  if (!plan) return {Outcome::needs_attention, refusal_.c_str()};
  Session session;
  const WantedUsbBoard wanted = wanted_usb_board(settings_.serial, serial_at_start_);
  if (const Outcome opened = session.open(wanted, refusal_); opened != Outcome::ok) {
    return {opened, refusal_.c_str()};
  }
  const std::string serial = session.serial();
  description_.name = "USB-1208FS-Plus #" + serial;
  CalibrationMemory memory{};
  if (const Result read = read_calibration(session, memory); !read) return read;
  const auto calibration = parse_calibration(memory);
  if (!calibration) {
    return refuse(Outcome::needs_attention,
                  description_.name +
                      ": its calibration memory holds no valid constants, so its voltages are not "
                      "usable. Calibrate it with the vendor's program");
  }
  board_ = std::make_unique<Board>(std::move(session), *plan, *calibration, settings_.output,
                                   settings_.output_ahead_s, settings_.rest_v, clock_, overruns_,
                                   underruns_);
  written_sequence_ = read_sequence_ = 0;
  was_driving_ = false;
  held_back_ = 0;
  left_on_.clear();
  serial_at_start_ = serial;
  return {};
}

Result Usb1208fsPlusDriver::read_calibration(const Session& session, CalibrationMemory& memory) {
  constexpr std::size_t piece = 64;
  for (std::size_t at = 0; at < memory.size(); at += piece) {
    const int got =
        session.receive(Request::calibration_memory, std::span(memory).subspan(at, piece),
                        static_cast<std::uint16_t>(at));
    if (got == static_cast<int>(piece)) continue;
    return refuse(got == LIBUSB_ERROR_NO_DEVICE ? Outcome::lost : Outcome::temporary,
                  description_.name + ": its calibration memory cannot be read" +
                      (got < 0 ? std::string(": ") + libusb_error_name(got) : std::string()));
  }
  return {};
}

Result Usb1208fsPlusDriver::start() {
  if (!board_) return {Outcome::fatal, "start of a USB-1208FS-Plus that is not open"};
  if (board_->running()) return {};
  outputs_ = {};
  if (board_->lost()) return {Outcome::lost, lost_message};
  const int started = board_->start();
  if (started >= 0) return {};
  return refuse(started == LIBUSB_ERROR_NO_DEVICE ? Outcome::lost : Outcome::temporary,
                description_.name + " rejects its settings: " + libusb_error_name(started));
}

Result Usb1208fsPlusDriver::read(Frame& frame) {
  if (!board_ || !board_->running()) {
    return {Outcome::fatal, "read of a USB-1208FS-Plus that is not started"};
  }
  if (board_->take_overrun()) {
    return {Outcome::temporary,
            "the USB-1208FS-Plus overran and lost scans; it was restarted, and the number lost is "
            "estimated from the host's clock"};
  }
  Frame next;
  if (board_->next(next, outputs_)) {
    read_sequence_ = next.sequence;
    frame = next;
    return {};
  }
  if (board_->lost()) return {Outcome::lost, lost_message};
  if (board_->refuses_scan()) {
    return {Outcome::temporary, "the USB-1208FS-Plus does not begin to scan"};
  }
  return {Outcome::no_data, ""};
}

Result Usb1208fsPlusDriver::write(const Actuation& actuation) {
  const bool finite = std::isfinite(actuation.drive);
  if (!board_ || !board_->running()) {
    if (!actuation.amplifier_on) return {};
    return {Outcome::fatal, "write to a USB-1208FS-Plus that is not started"};
  }
  if (board_->lost()) return {Outcome::lost, lost_message};
  if (!finite || !actuation.amplifier_on) {
    was_driving_ = false;
    board_->rest(output_counts(finite ? actuation.drive : settings_.rest_v));
    return finite ? Result{} : Result{Outcome::fatal, "the commanded drive is not finite"};
  }
  if (!queue_drive(output_counts(actuation.drive))) {
    return {Outcome::temporary,
            "the USB-1208FS-Plus does not accept the drive at the rate at which it is written"};
  }
  if (board_->take_underrun()) {
    return {Outcome::temporary,
            "the output of the USB-1208FS-Plus ran dry and was restarted; increase "
            "usb_1208fs_plus.output_ahead_s if this recurs"};
  }
  return {};
}

/// One value for each frame since the last write, so that the output's delay is constant. False:
/// the queue is full.
bool Usb1208fsPlusDriver::queue_drive(std::uint16_t counts) {
  const std::uint64_t copies = was_driving_ ? read_sequence_ - written_sequence_ : 1;
  was_driving_ = true;
  written_sequence_ = read_sequence_;
  const bool dry = board_->ran_dry();
  // The wait for a loop that never catches up is bounded.
  const bool behind = dry && board_->has_frames() && ++held_back_ < Board::frame_capacity;
  if (behind) return true;
  held_back_ = 0;
  const auto limited = dry ? 1 : std::min<std::uint64_t>(copies, board_->ahead());
  if (!board_->drive(counts, static_cast<std::size_t>(limited))) return false;
  if (dry) board_->refill();
  return true;
}

void Usb1208fsPlusDriver::stop() noexcept {
  if (!board_ || !board_->running()) return;
  board_->stop();
  if (board_->at_rest()) return;
  try {
    left_on_ = description_.name +
               ": its output may not be at rest: press the emergency stop, then check cable and "
               "board. It did not accept its last value";
  } catch (...) {  // out of memory for the message
  }
}

void Usb1208fsPlusDriver::close() noexcept {
  stop();
  if (board_ && board_->has_stuck_transfers()) {
    // The kernel may still write into this memory: a leak is better than reuse.
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

std::vector<AttachedDevice> find_usb_1208fs_plus() { return usb_1208fs_plus::find_all(); }

}  // namespace stickslip::drivers
