// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/labjack_u6_driver.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "drivers/labjack/lines.h"
#include "drivers/labjack/stream_loop.h"
#include "drivers/labjack/streaming_output.h"
#include "drivers/labjack_u6/board_link.h"
#include "drivers/labjack_u6/output_commands.h"
#include "drivers/labjack_u6/protocol.h"
#include "drivers/labjack_u6/stream_plan.h"
#include "drivers/labjack_u6/stream_session.h"

namespace stickslip::drivers {

namespace u6 = labjack_u6;

struct LabjackU6Driver::Board {
  u6::BoardLink link;
  u6::Calibration calibration;
  std::unique_ptr<u6::StreamSession> session;
  // While streaming.
  std::optional<u6::OutputCommands> commands;
  std::optional<labjack::StreamingOutput> output;
};

LabjackU6Driver::LabjackU6Driver(const config::LabjackU6& settings,
                                 const config::BenchInputs& inputs, double rate_hz,
                                 HostClock& clock)
    : settings_(settings),
      inputs_(inputs),
      rate_hz_(rate_hz),
      clock_(clock),
      lines_(std::make_unique<labjack::Lines>()),
      counts_(std::make_unique<u6::StreamCounts>()),
      rest_v_(settings.rest_v) {
  description_.name = "LabJack U6";
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

LabjackU6Driver::~LabjackU6Driver() { close(); }

Result LabjackU6Driver::refuse(Outcome outcome, std::string text) {
  refusal_ = std::move(text);
  return {outcome, refusal_.c_str()};
}

Result LabjackU6Driver::open() {
  if (board_) return {};
  if (std::string error = u6::settings_error(settings_, inputs_, rate_hz_); !error.empty()) {
    return refuse(Outcome::needs_attention, std::move(error));
  }
  board_ = std::make_unique<Board>();
  rest_v_ = settings_.rest_v;
  // A crashed process may have left the line high. Later steps may fail; this one needs no others.
  const u6::Command line_low = enable_line_low();
  const bool low_first = settings_.enable_line && !settings_.serial;
  const WantedUsbBoard wanted = wanted_usb_board(
      settings_.serial ? std::to_string(*settings_.serial) : std::string(), serial_at_start_);
  if (u6::Failure failure = board_->link.open(wanted, low_first ? &line_low : nullptr)) {
    board_.reset();
    return refuse(failure->outcome, std::move(failure->text));
  }
  hold_enable_line_low();
  if (const Result prepared = prepare(); !prepared) {
    hold_enable_line_low();
    board_.reset();
    return prepared;
  }
  description_.name = u6::name_of(board_->link.identity());
  serial_at_start_ = std::to_string(board_->link.identity().serial);
  left_on_.clear();
  return {};
}

u6::Command LabjackU6Driver::enable_line_low() {
  u6::Feedback feedback(++echo_);
  if (settings_.enable_line) feedback.set_line(*settings_.enable_line, false);
  return feedback.command();
}

/// Best effort; needs no calibration and works during a stream.
void LabjackU6Driver::hold_enable_line_low() noexcept {
  if (!settings_.enable_line) return;
  try {
    const u6::Command command = enable_line_low();
    const auto check = [this](std::span<const std::uint8_t> reply) { return check_echo(reply); };
    static_cast<void>(board_->link.request("make its enable line low", command, check));
  } catch (...) {  // out of memory for the message
  }
}

/// Verdict on the reply to a Feedback that reads no lines; late replies to others are `command`.
u6::Verdict LabjackU6Driver::check_echo(std::span<const std::uint8_t> reply) const {
  u6::FeedbackReply out{echo_, 0};
  const u6::Verdict verdict = u6::parse_feedback(reply, false, out);
  if (out.echo != echo_) return u6::Verdict{u6::Verdict::Kind::command};
  return verdict;
}

/// Stops a stream that is running, reads the calibration and makes the outputs safe.
Result LabjackU6Driver::prepare() {
  u6::BoardLink& link = board_->link;
  constexpr std::uint8_t not_running = 52;
  if (u6::Failure failure =
          link.request("stop a stream", u6::stop_stream(), u6::check_stream_stopped)) {
    if (link.verdict().code != not_running) {
      return refuse(failure->outcome, std::move(failure->text));
    }
  }
  link.drain();
  if (const Result calibrated = read_calibration(); !calibrated) return calibrated;
  if (u6::Failure failure =
          link.request("set its lines", u6::plain_lines(), u6::check_plain_lines)) {
    return refuse(failure->outcome, std::move(failure->text));
  }
  if (!make_safe()) return {Outcome::needs_attention, refusal_.c_str()};
  return set_watchdog(u6::disarm_watchdog());
}

/// Only while the board does not stream: no source states that its firmware permits it then.
Result LabjackU6Driver::set_watchdog(const u6::Command& command) {
  if (!settings_.has_watchdog()) return {};
  u6::Failure failure = board_->link.request("set its watchdog (watchdog_s = 0 does without)",
                                             command, u6::check_watchdog);
  return failure ? refuse(failure->outcome, std::move(failure->text)) : Result{};
}

Result LabjackU6Driver::read_calibration() {
  u6::BoardLink& link = board_->link;
  std::array<u6::CalibrationBlock, u6::calibration_blocks> blocks{};
  for (int i = 0; i < u6::calibration_blocks; ++i) {
    auto& block = blocks[static_cast<std::size_t>(i)];
    const auto parse = [&block](std::span<const std::uint8_t> reply) {
      return u6::parse_calibration(reply, block);
    };
    if (u6::Failure failure =
            link.request("read its calibration", u6::request_calibration(i), parse)) {
      return refuse(failure->outcome, std::move(failure->text));
    }
  }
  board_->calibration = u6::calibration_of(blocks);
  const std::string implausible = u6::implausible_constant(board_->calibration);
  if (implausible.empty()) return {};
  return refuse(Outcome::needs_attention,
                u6::name_of(link.identity()) + ": its calibration memory is empty or damaged: " +
                    implausible + ". Have it calibrated by the vendor, or use another board");
}

/// Enable line low, the sensed lines inputs, DAC at rest. A failure is in refusal_.
bool LabjackU6Driver::make_safe() noexcept {
  try {
    u6::BoardLink& link = board_->link;
    u6::Feedback feedback(++echo_);
    if (settings_.enable_line) feedback.set_line(*settings_.enable_line, false);
    if (settings_.amplifier_fault_line) feedback.make_input(*settings_.amplifier_fault_line);
    if (settings_.emergency_stop_line) feedback.make_input(*settings_.emergency_stop_line);
    feedback.dac(settings_.dac, u6::dac_counts(board_->calibration, settings_.dac, rest_v_));
    const auto check = [this](std::span<const std::uint8_t> reply) { return check_echo(reply); };
    u6::Failure failure = link.request("switch the amplifier off", feedback.command(), check);
    if (failure) refusal_ = std::move(failure->text);
    return !failure;
  } catch (...) {
    return false;
  }
}

Result LabjackU6Driver::start() {
  if (!board_) return {Outcome::fatal, "start of a LabJack U6 that is not open"};
  if (running_) return {};
  return begin_stream();
}

/// Configures the stream, arms the watchdog and starts the stream; `lines` are the levels just
/// before.
Result LabjackU6Driver::configure_stream(const u6::StreamPlan& plan, std::uint32_t& lines) {
  u6::BoardLink& link = board_->link;
  const u6::Command configure =
      u6::configure_stream(plan.scan, settings_.resolution_index, plan.samples_per_packet,
                           settings_.settling, plan.clock);
  u6::Failure failure = link.request(
      "configure the stream (resolution_index or settling may be too large for this rate)",
      configure, u6::check_stream_configured);
  if (!failure) {
    const auto check = [&lines](std::span<const std::uint8_t> reply) {
      u6::FeedbackReply out{};
      const u6::Verdict verdict = u6::parse_feedback(reply, true, out);
      lines = out.lines;
      return verdict;
    };
    failure = link.request("read its lines", u6::Feedback(++echo_).read_lines().command(), check);
  }
  if (failure) return refuse(failure->outcome, std::move(failure->text));
  if (settings_.enable_line) {
    const auto timeout_s = static_cast<std::uint16_t>(settings_.watchdog_s);
    const Result armed = set_watchdog(u6::arm_watchdog(timeout_s, *settings_.enable_line));
    if (!armed) return armed;
  }
  failure = link.request("start the stream", u6::start_stream(), u6::check_stream_started);
  if (!failure) return {};
  static_cast<void>(set_watchdog(u6::disarm_watchdog()));
  return refuse(failure->outcome, std::move(failure->text));
}

Result LabjackU6Driver::begin_stream() {
  u6::StreamPlan plan = u6::stream_plan(settings_, inputs_, rate_hz_);
  plan.calibration = board_->calibration;
  std::uint32_t lines = 0;
  if (const Result configured = configure_stream(plan, lines); !configured) return configured;
  const u6::BoardLink& link = board_->link;
  auto session = std::make_unique<u6::StreamSession>(link.context(), link.handle(), std::move(plan),
                                                     *lines_, *counts_);
  const bool submitted = session->begin();
  board_->session = std::move(session);
  if (!submitted) {
    end_stream();
    return refuse(Outcome::temporary,
                  description_.name +
                      ": the transfers of its stream cannot be submitted. Is "
                      "/sys/module/usbcore/parameters/usbfs_memory_mb large enough?");
  }
  const std::uint16_t rest_counts = u6::dac_counts(board_->calibration, settings_.dac, rest_v_);
  const std::int64_t now_ns = clock_.now_ns();
  board_->commands.emplace(settings_, *board_->session, echo_);
  board_->output.emplace(u6::output_rules(settings_), description_.name, *board_->commands, *lines_,
                         rest_counts, now_ns);
  outputs_ = {};
  lines_->update(lines, now_ns);  // the grace period until the first reply
  running_ = true;
  return {};
}

Result LabjackU6Driver::read(Frame& frame) {
  if (!running_) return {Outcome::fatal, "read of a LabJack U6 that is not started"};
  u6::StreamSession& session = *board_->session;
  const bool received = labjack::wait_for_frame(session, *board_->output, clock_, frame, outputs_);
  if (board_->output->is_off() && session.ended() == u6::StreamEnd::not_ended) {
    board_->output->refresh_while_off(clock_.now_ns());
  }
  if (received) return {};
  return session.ended() == u6::StreamEnd::not_ended ? Result{Outcome::no_data} : stream_end();
}

Result LabjackU6Driver::stream_end() {
  const auto text = [this](const char* format, auto... values) {
    std::snprintf(end_text_.data(), end_text_.size(), format, description_.name.c_str(), values...);
    return end_text_.data();
  };
  const u6::StreamSession& session = *board_->session;
  switch (session.ended()) {
    case u6::StreamEnd::not_ended:
      break;
    case u6::StreamEnd::unplugged:
      return {Outcome::lost, text("%s was unplugged")};
    case u6::StreamEnd::usb_error:
      return {Outcome::lost, text("%s: the USB connection failed. Check cable and hub")};
    case u6::StreamEnd::uncountable:
      return {Outcome::lost, text("%s lost an unknown number of scans; its stream must be "
                                  "restarted. Was the host too busy to read it?")};
    case u6::StreamEnd::board_error: {
      const std::uint8_t code = session.board_error();
      return {Outcome::needs_attention,
              text("%s ended the stream with error %d (%s). A lower loop.rate_hz or "
                   "resolution_index may help",
                   static_cast<int>(code), u6::error_name(code))};
    }
  }
  return {};
}

Result LabjackU6Driver::write(const Actuation& actuation) {
  if (!running_) {
    if (!actuation.amplifier_on) return {};  // it is off
    return {Outcome::fatal, "write to a LabJack U6 that is not started"};
  }
  if (board_->session->ended() == u6::StreamEnd::unplugged) return stream_end();
  const bool finite = std::isfinite(actuation.drive);
  const bool on = actuation.amplifier_on && finite;
  if (!on && finite) rest_v_ = actuation.drive;
  const std::uint16_t counts =
      u6::dac_counts(board_->calibration, settings_.dac, finite ? actuation.drive : rest_v_);
  labjack::StreamingOutput& output = *board_->output;
  output.apply(counts, actuation.amplifier_on, on, clock_.now_ns());
  if (board_->session->ended() == u6::StreamEnd::unplugged) return stream_end();
  return labjack::result_of_write(output, finite);
}

Signals LabjackU6Driver::signals() const noexcept {
  if (!running_) return {};
  const std::int64_t now_ns = clock_.now_ns();
  return {lines_->low(settings_.emergency_stop_line, now_ns),
          lines_->low(settings_.amplifier_fault_line, now_ns)};
}

Counts LabjackU6Driver::counts() const noexcept {
  const auto value = [](const auto& count) { return count.load(std::memory_order_relaxed); };
  constexpr const char* board = "LabJack U6";
  Counts all;
  all.add({board, "packets_lost", value(counts_->packets_lost)});
  all.add({board, "packets_damaged", value(counts_->packets_damaged)});
  all.add({board, "overflows", value(counts_->overflows)});
  all.add({board, "scans_thrown_away", value(counts_->scans_thrown_away)});
  all.add({board, "scans_lost", value(counts_->scans_lost)});
  all.add({board, "fullest_backlog_of_256", value(counts_->fullest_backlog), Count::Kind::level});
  return all;
}

void LabjackU6Driver::stop() noexcept {
  if (!running_) return;
  running_ = false;
  if (board_->session->ended() != u6::StreamEnd::unplugged) {
    board_->output->turn_off(u6::dac_counts(board_->calibration, settings_.dac, rest_v_),
                             clock_.now_ns());
  }
  end_stream();
}

/// Ends the session and, if the board is still attached, its stream.
void LabjackU6Driver::end_stream() noexcept {
  const bool unplugged = board_->session->ended() == u6::StreamEnd::unplugged;
  const bool ended = board_->session->end();
  board_->output.reset();
  board_->commands.reset();
  if (!ended) {
    // The kernel may still write into this memory: a leak is better than reuse.
    static_cast<void>(board_->session.release());
    board_->link.abandon();
    board_.reset();
    if (!unplugged) note_left_on("the kernel kept its transfers");
    return;
  }
  board_->session.reset();
  // An unplugged board has no power, so its lines are low.
  if (unplugged) return;
  bool safe = make_safe();
  try {
    static_cast<void>(
        board_->link.request("stop the stream", u6::stop_stream(), u6::check_stream_stopped));
  } catch (...) {  // out of memory for the message
  }
  board_->link.drain();
  // The stream, or a reply to another command, may have caused the failure.
  if (!safe) safe = make_safe();
  if (!safe) return note_left_on(refusal_.c_str());  // and the watchdog stays armed
  try {
    static_cast<void>(set_watchdog(u6::disarm_watchdog()));
  } catch (...) {  // out of memory for the message
  }
}

void LabjackU6Driver::note_left_on(const char* why) noexcept {
  try {
    left_on_ = description_.name +
               ": its enable line may still be high: press the emergency stop, then check cable "
               "and board. The last \"off\" was not confirmed: " +
               why;
  } catch (...) {  // out of memory for the message
  }
}

void LabjackU6Driver::close() noexcept {
  stop();
  board_.reset();
}

std::vector<AttachedDevice> find_labjack_u6() { return u6::find_boards(); }

}  // namespace stickslip::drivers
