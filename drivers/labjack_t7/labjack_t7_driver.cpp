// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/labjack_t7_driver.h"

#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "drivers/labjack/lines.h"
#include "drivers/labjack/stream_loop.h"
#include "drivers/labjack/streaming_output.h"
#include "drivers/labjack_t7/board_link.h"
#include "drivers/labjack_t7/protocol.h"
#include "drivers/labjack_t7/stream_plan.h"
#include "drivers/labjack_t7/stream_session.h"
#include "physics/number_text.h"

namespace stickslip::drivers {

namespace t7 = labjack_t7;

struct LabjackT7Driver::Board {
  Board(const config::LabjackT7& settings, HostClock& clock) : link(settings, clock) {}

  t7::BoardLink link;
  labjack::ConverterCalibration calibration;
  // While streaming.
  std::unique_ptr<t7::StreamSession> session;
  std::optional<labjack::StreamingOutput> output;
};

LabjackT7Driver::LabjackT7Driver(const config::LabjackT7& settings,
                                 const config::BenchInputs& inputs, double rate_hz,
                                 HostClock& clock)
    : settings_(settings),
      inputs_(inputs),
      rate_hz_(rate_hz),
      clock_(clock),
      lines_(std::make_unique<labjack::Lines>()),
      counts_(std::make_unique<t7::StreamCounts>()),
      rest_v_(settings.rest_v) {
  description_.name = "LabJack T7 at " + settings.host + ":" + std::to_string(settings.port);
  description_.paced = true;
  description_.own_clock = true;
  description_.can_drive = true;
  description_.unit.fill("V");
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (inputs_[i]) {
      description_.channels = static_cast<std::uint8_t>(description_.channels | (1U << i));
    }
  }
}

LabjackT7Driver::~LabjackT7Driver() { close(); }

Result LabjackT7Driver::refuse(Outcome outcome, std::string text) {
  refusal_ = std::move(text);
  return {outcome, refusal_.c_str()};
}

Result LabjackT7Driver::refuse(t7::Problem problem) {
  return refuse(problem.outcome, std::move(problem.text));
}

Result LabjackT7Driver::open() {
  if (board_) return {};
  if (std::string error = t7::settings_error(settings_, inputs_, rate_hz_); !error.empty()) {
    return refuse(Outcome::needs_attention, std::move(error));
  }
  board_ = std::make_unique<Board>(settings_, clock_);
  rest_v_ = settings_.rest_v;
  t7::Failure failure = board_->link.connect();
  // Another board has other wires: nothing is sent to it.
  if (!failure) failure = board_->link.identify(serial_at_start_);
  if (failure) {
    board_.reset();
    return refuse(std::move(*failure));
  }
  // A crashed process may have left the line high. Later steps may fail; this one needs no others.
  hold_enable_line_low();
  if (const Result prepared = prepare(); !prepared) {
    hold_enable_line_low();
    board_.reset();
    return prepared;
  }
  description_.name = board_->link.name();
  serial_at_start_ = board_->link.identity().serial;
  left_on_.clear();
  return {};
}

/// Best effort; needs no calibration and works during a stream.
void LabjackT7Driver::hold_enable_line_low() noexcept {
  if (!settings_.enable_line) return;
  try {
    t7::Feedback request(board_->link.next_transaction());
    request.write_word(t7::dio0 + *settings_.enable_line, 0);
    static_cast<void>(board_->link.request("make its enable line low", request));
  } catch (...) {  // out of memory for the message
  }
}

/// Stops a stream that is running, reads the calibration and makes the outputs safe.
Result LabjackT7Driver::prepare() {
  if (const Result stopped = stop_stream(); !stopped) return stopped;
  if (const Result calibrated = read_calibration(); !calibrated) return calibrated;
  if (!make_safe()) return {Outcome::needs_attention, refusal_.c_str()};
  return disarm_watchdog();
}

Result LabjackT7Driver::stop_stream() {
  t7::BoardLink& link = board_->link;
  t7::Feedback request(link.next_transaction());
  request.write(t7::stream_enable, 0);
  t7::Failure failure = link.request("stop the stream", request);
  if (!failure || link.verdict().error == t7::stream_not_running) return {};
  return refuse(std::move(*failure));
}

/// One of an earlier run may still be armed, also where this one uses none.
Result LabjackT7Driver::disarm_watchdog() {
  t7::Feedback request(board_->link.next_transaction());
  request.write(t7::watchdog_enable, 0);
  t7::Failure failure = board_->link.request("disable its watchdog", request);
  return failure ? refuse(std::move(*failure)) : Result{};
}

Result LabjackT7Driver::read_calibration() {
  t7::BoardLink& link = board_->link;
  for (int block = 0; block < t7::calibration_blocks; ++block) {
    std::span<const std::uint8_t> data;
    if (t7::Failure failure =
            link.request("read its calibration",
                         t7::request_calibration(link.next_transaction(), block), data)) {
      return refuse(std::move(*failure));
    }
    t7::add_constants(board_->calibration, block, data);
  }
  const std::string implausible = labjack::implausible_constant(board_->calibration);
  if (implausible.empty()) return {};
  return refuse(Outcome::needs_attention,
                link.name() + ": its calibration memory is empty or damaged: " + implausible +
                    ". Have it calibrated by the vendor, or use another board");
}

/// Enable line low, DAC at rest, the sensed lines inputs. A failure is in refusal_.
bool LabjackT7Driver::make_safe() noexcept {
  try {
    t7::Feedback request(board_->link.next_transaction());
    t7::add_output(request, settings_, t7::set_point_of(rest_v_), false);
    // Reading a line makes it an input.
    for (const auto& line : {settings_.amplifier_fault_line, settings_.emergency_stop_line}) {
      if (line) request.read(t7::dio0 + *line, 1);
    }
    t7::Failure failure = board_->link.request("switch the amplifier off", request);
    if (failure) refusal_ = std::move(failure->text);
    return !failure;
  } catch (...) {
    return false;
  }
}

Result LabjackT7Driver::start() {
  if (!board_) return {Outcome::fatal, "start of a LabJack T7 that is not open"};
  if (running_) return {};
  return begin_stream();
}

/// Configures the stream and arms the watchdog; `lines` are the levels just before.
Result LabjackT7Driver::configure(const t7::StreamPlan& plan, std::uint32_t& lines) {
  t7::BoardLink& link = board_->link;
  t7::Feedback inputs(link.next_transaction());
  t7::configure_inputs(inputs, plan);
  t7::Failure failure = link.request("configure its inputs", inputs);
  if (!failure) {
    t7::Feedback stream(link.next_transaction());
    t7::configure_stream(stream, plan, settings_);
    failure = link.request(
        "configure the stream (resolution_index or settling_us may be too large for this rate)",
        stream);
  }
  std::span<const std::uint8_t> data;
  if (!failure) {
    t7::Feedback levels(link.next_transaction());
    failure = link.request("read its lines", levels.read(t7::dio_state, 2), data);
  }
  if (failure) return refuse(std::move(*failure));
  lines = t7::double_word_at(data, 0);
  if (!settings_.has_watchdog()) return {};
  t7::Feedback arm(link.next_transaction());
  t7::arm_watchdog(arm, settings_, rest_v_);
  failure = link.request("set its watchdog (watchdog_s = 0 does without)", arm);
  return failure ? refuse(std::move(*failure)) : Result{};
}

/// Starts the stream, and replaces the interval of its scans by the one that the board reports.
Result LabjackT7Driver::start_stream(t7::StreamPlan& plan) {
  t7::BoardLink& link = board_->link;
  t7::Failure failure = link.connect_stream();
  if (failure) return refuse(std::move(*failure));
  t7::Feedback enable(link.next_transaction());
  enable.write(t7::stream_enable, 1).read(t7::stream_scan_rate, 2);
  std::span<const std::uint8_t> data;
  failure = link.request(
      "start the stream (resolution_index or settling_us may be too large for this rate)", enable,
      data);
  if (failure) return refuse(std::move(*failure));
  const auto actual_hz = static_cast<double>(t7::float_at(data, 0));
  const std::int64_t interval_ns = t7::interval_ns(actual_hz);
  if (interval_ns > 0 && t7::deviation(interval_ns, plan.rate_hz) <= t7::rate_tolerance) {
    plan.interval_ns = interval_ns;
    return {};
  }
  static_cast<void>(stop_stream());
  return refuse(Outcome::needs_attention,
                link.name() + " scans at " + physics::number_text(actual_hz, 9) +
                    " Hz, expected loop.rate_hz = " + physics::number_text(plan.rate_hz, 9) +
                    ". Set loop.rate_hz to a rate of the board's clock");
}

Result LabjackT7Driver::begin_stream() {
  t7::StreamPlan plan = t7::stream_plan(settings_, inputs_, rate_hz_);
  plan.calibration = board_->calibration;
  std::uint32_t lines = 0;
  if (const Result configured = configure(plan, lines); !configured) return configured;
  if (const Result started = start_stream(plan); !started) {
    const std::string why = refusal_;
    static_cast<void>(disarm_watchdog());
    return refuse(started.outcome, why);
  }
  board_->session = std::make_unique<t7::StreamSession>(board_->link, settings_, std::move(plan),
                                                        *lines_, *counts_, clock_);
  const std::int64_t now_ns = clock_.now_ns();
  lines_->update(lines, now_ns);  // the grace period until the first reply
  if (!board_->session->begin()) {
    end_stream();
    return refuse(Outcome::temporary, description_.name + ": no thread can be started for it");
  }
  board_->output.emplace(t7::output_rules(settings_), description_.name, *board_->session, *lines_,
                         t7::set_point_of(rest_v_), now_ns);
  outputs_ = {};
  running_ = true;
  return {};
}

Result LabjackT7Driver::read(Frame& frame) {
  if (!running_) return {Outcome::fatal, "read of a LabJack T7 that is not started"};
  t7::StreamSession& session = *board_->session;
  const bool received = labjack::wait_for_frame(session, *board_->output, clock_, frame, outputs_);
  if (board_->output->is_off() && !session.has_ended()) {
    board_->output->refresh_while_off(clock_.now_ns());
  }
  if (received) return {};
  return session.has_ended() ? stream_end() : Result{Outcome::no_data};
}

Result LabjackT7Driver::stream_end() {
  const auto text = [this](const char* format, auto... values) {
    std::snprintf(end_text_.data(), end_text_.size(), format, description_.name.c_str(), values...);
    return end_text_.data();
  };
  const t7::StreamSession& session = *board_->session;
  switch (session.ended()) {
    case t7::StreamEnd::not_ended:
      break;
    case t7::StreamEnd::disconnected:
      return {Outcome::lost,
              text("%s: the connection was closed. Check its power and the network cable")};
    case t7::StreamEnd::silent:
      return {Outcome::lost,
              text("%s: no scans arrive any more, expected some every second. Check its power and "
                   "the network cable")};
    case t7::StreamEnd::garbled:
      return {Outcome::lost, text("%s: what it sends is no stream of a T7, expected packets of "
                                  "function 76; it is started again")};
    case t7::StreamEnd::uncountable:
      return {Outcome::lost, text("%s lost an unknown number of scans; its stream must be "
                                  "restarted. Was the host too busy to read it?")};
    case t7::StreamEnd::board_error: {
      const std::uint16_t code = session.board_error();
      return {Outcome::needs_attention,
              text("%s ended the stream with status %d (%s). A lower loop.rate_hz, "
                   "resolution_index or settling_us may help",
                   static_cast<int>(code), t7::error_name(code))};
    }
  }
  return {};
}

Result LabjackT7Driver::write(const Actuation& actuation) {
  if (!running_) {
    if (!actuation.amplifier_on) return {};  // it is off
    return {Outcome::fatal, "write to a LabJack T7 that is not started"};
  }
  const t7::StreamSession& session = *board_->session;
  if (session.ended() == t7::StreamEnd::disconnected) return stream_end();
  const bool finite = std::isfinite(actuation.drive);
  const bool on = actuation.amplifier_on && finite;
  if (!on && finite) rest_v_ = actuation.drive;
  labjack::StreamingOutput& output = *board_->output;
  output.apply(t7::set_point_of(finite ? actuation.drive : rest_v_), actuation.amplifier_on, on,
               clock_.now_ns());
  if (session.ended() == t7::StreamEnd::disconnected) return stream_end();
  return labjack::result_of_write(output, finite);
}

Signals LabjackT7Driver::signals() const noexcept {
  if (!running_) return {};
  const std::int64_t now_ns = clock_.now_ns();
  return {lines_->low(settings_.emergency_stop_line, now_ns),
          lines_->low(settings_.amplifier_fault_line, now_ns)};
}

Counts LabjackT7Driver::counts() const noexcept {
  const auto value = [](const auto& count) { return count.load(std::memory_order_relaxed); };
  constexpr const char* board = "LabJack T7";
  Counts all;
  all.add({board, "packets_lost", value(counts_->packets_lost)});
  all.add({board, "overflows", value(counts_->overflows)});
  all.add({board, "scans_thrown_away", value(counts_->scans_thrown_away)});
  all.add({board, "scans_lost", value(counts_->scans_lost)});
  all.add({board, "fullest_backlog_bytes", value(counts_->fullest_backlog), Count::Kind::level});
  return all;
}

void LabjackT7Driver::stop() noexcept {
  if (!running_) return;
  running_ = false;
  if (board_->session->ended() != t7::StreamEnd::disconnected) {
    board_->output->turn_off(t7::set_point_of(rest_v_), clock_.now_ns());
  }
  end_stream();
}

/// Ends the session, and the stream if the board can be reached.
void LabjackT7Driver::end_stream() noexcept {
  board_->session->end();
  board_->output.reset();
  board_->session.reset();
  board_->link.stream().close();
  bool safe = make_safe();
  try {
    static_cast<void>(stop_stream());
    // The stream, or a reply to another command, may have caused the failure.
    if (!safe) safe = make_safe();
    if (!safe) return note_left_on(refusal_.c_str());  // and the watchdog stays armed
    static_cast<void>(disarm_watchdog());
  } catch (...) {  // out of memory for the message
  }
}

/// Unlike a board on USB, one that is not reached has power.
void LabjackT7Driver::note_left_on(const char* why) noexcept {
  try {
    left_on_ = description_.name +
               ": its enable line may still be high: press the emergency stop, then check cable "
               "and board. ";
    if (settings_.has_watchdog()) {
      left_on_ += "Its watchdog acts after " + std::to_string(settings_.watchdog_s) + " s. ";
    }
    left_on_ += "The last \"off\" was not confirmed: ";
    left_on_ += why;
  } catch (...) {  // out of memory for the message
  }
}

void LabjackT7Driver::close() noexcept {
  stop();
  board_.reset();
}

}  // namespace stickslip::drivers
