// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack/streaming_output.h"

#include <algorithm>
#include <cstdio>

namespace stickslip::drivers::labjack {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t line_period_ns = 20'000'000;
// A set-point may take longer than the levels stay valid. One lost reply must not stop a rig: a
// separate request is sent early enough to be answered.
constexpr std::int64_t line_request_ns = line_validity_ns / 2;

constexpr const char* off_failed =
    "switching the amplifier off was not confirmed; the command is repeated";
constexpr const char* set_point_failed = "a set-point did not arrive";
constexpr const char* not_sent = "the command could not be sent";

bool failed(const Progress& progress) {
  return progress.kind == Progress::Kind::failed || progress.kind == Progress::Kind::timed_out;
}

unsigned bit_of(Slot slot) { return 1U << static_cast<unsigned>(slot); }

const char* reason(const OutputPort& port, const Progress& progress) {
  if (progress.kind == Progress::Kind::timed_out) return "no answer within 0.25 s";
  return port.reason(progress);
}

}  // namespace

StreamingOutput::StreamingOutput(const OutputRules& rules, const std::string& name,
                                 OutputPort& port, const Lines& lines, SetPoint sent,
                                 std::int64_t now_ns)
    : rules_(rules),
      name_(name),
      port_(port),
      lines_(lines),
      sent_(sent),
      sent_ns_(now_ns),
      confirmed_ns_(now_ns) {}

void StreamingOutput::apply(SetPoint wanted, bool requested, bool on, std::int64_t now_ns) {
  if (watchdog_expired(now_ns)) tripped_ = true;
  if (!requested) tripped_ = false;
  // "Off" goes out before anything else is processed.
  if ((!on || tripped_) && on_) turn_off(wanted, now_ns);
  collect(now_ns);
  request_lines(now_ns);
  if (on && !tripped_) {
    keep_on(wanted, now_ns);
  } else {
    keep_off(wanted, now_ns);
  }
}

void StreamingOutput::refresh_while_off(std::int64_t now_ns) {
  if (!is_due(sent_, false, now_ns)) return;
  collect(now_ns);
  request_lines(now_ns);
  keep_off(sent_, now_ns);
}

void StreamingOutput::send_pending_set_point(std::int64_t now_ns) {
  if (watchdog_expired(now_ns)) tripped_ = true;
  collect(now_ns);
  if (!tripped_) send_set_point(wanted_, true, now_ns);
}

const char* StreamingOutput::report_failure() {
  if (failed_ == 0 && failure_reported_) failure_[0] = '\0';
  if (failure_[0] == '\0') return nullptr;
  failure_reported_ = true;
  return failure_.data();
}

/// True if the watchdog has acted, or should have, for lack of confirmed commands.
bool StreamingOutput::watchdog_expired(std::int64_t now_ns) const {
  return rules_.watchdog_s > 0 && on_ &&
         now_ns - confirmed_ns_ > rules_.watchdog_s * second_ns - rules_.max_transit_ns;
}

void StreamingOutput::collect(std::int64_t now_ns) {
  collect_set_point(now_ns);
  collect_off(now_ns);
}

void StreamingOutput::note_failure(Slot slot, const char* what, const char* why) {
  failed_ = static_cast<std::uint8_t>(failed_ | bit_of(slot));
  failure_reported_ = false;
  std::snprintf(failure_.data(), failure_.size(), "%s: %s: %s", name_.c_str(), what, why);
}

/// A confirmed "off" settles all earlier commands. A set-point does not settle an "off".
void StreamingOutput::note_success(Slot slot, std::int64_t sent_ns) {
  confirmed_ns_ = std::max(confirmed_ns_, sent_ns);
  const unsigned settled = slot == Slot::off ? ~0U : bit_of(slot);
  failed_ = static_cast<std::uint8_t>(failed_ & ~settled);
}

void StreamingOutput::collect_set_point(std::int64_t now_ns) {
  const Progress progress = port_.progress(Slot::set_point, now_ns);
  if (progress.kind == Progress::Kind::done) note_success(Slot::set_point, progress.sent_ns);
  if (!failed(progress)) return;
  resend_ = true;
  note_failure(Slot::set_point, set_point_failed, reason(port_, progress));
}

void StreamingOutput::collect_off(std::int64_t now_ns) {
  const Progress progress = port_.progress(Slot::off, now_ns);
  if (progress.kind == Progress::Kind::done) {
    off_unconfirmed_ = false;
    note_success(Slot::off, progress.sent_ns);
  }
  if (!failed(progress)) return;
  note_failure(Slot::off, off_failed, reason(port_, progress));
}

/// A missing reply shows in the age of the levels and is not reported separately.
void StreamingOutput::request_lines(std::int64_t now_ns) {
  if (!rules_.reads_lines) return;
  port_.progress(Slot::lines, now_ns);
  if (now_ns - lines_.requested_ns() < line_request_ns || !port_.free(Slot::lines)) return;
  port_.send_request_of_lines(now_ns);
}

void StreamingOutput::turn_off(SetPoint wanted, std::int64_t now_ns) {
  on_ = false;
  sent_on_ = false;
  off_unconfirmed_ = true;
  // While an "off" is in progress no "on" is sent, so it is the latest command already.
  if (!port_.free(Slot::off)) return;
  if (port_.send_output(Slot::off, wanted, false, now_ns)) {
    sent_ns_ = now_ns;
    sent_ = wanted;
  } else {
    note_failure(Slot::off, off_failed, not_sent);
  }
}

void StreamingOutput::keep_off(SetPoint wanted, std::int64_t now_ns) {
  if (off_unconfirmed_) {
    if (port_.free(Slot::off)) turn_off(wanted, now_ns);
    return;
  }
  if (is_due(wanted, false, now_ns)) send_set_point(wanted, false, now_ns);
}

void StreamingOutput::keep_on(SetPoint wanted, std::int64_t now_ns) {
  if (off_unconfirmed_) {  // settled first
    keep_off(wanted, now_ns);
    return;
  }
  // The command that enables the amplifier restarts the watchdog.
  if (!on_) confirmed_ns_ = std::max(confirmed_ns_, now_ns);
  on_ = true;
  wanted_ = wanted;
  if (is_due(wanted, true, now_ns)) send_set_point(wanted, true, now_ns);
}

bool StreamingOutput::is_due(SetPoint wanted, bool on, std::int64_t now_ns) const {
  if (resend_ || wanted != sent_ || on != sent_on_) return true;
  std::int64_t quiet_ns = second_ns;
  if (rules_.reads_lines) quiet_ns = line_period_ns;
  if (rules_.watchdog_s > 0) quiet_ns = std::min(quiet_ns, rules_.watchdog_s * second_ns / 3);
  return now_ns - sent_ns_ >= quiet_ns;
}

void StreamingOutput::send_set_point(SetPoint wanted, bool on, std::int64_t now_ns) {
  if (!port_.free(Slot::set_point)) return;  // the next write brings a newer one
  if (!port_.send_output(Slot::set_point, wanted, on, now_ns)) {
    note_failure(Slot::set_point, set_point_failed, not_sent);
    return;
  }
  resend_ = false;
  sent_on_ = on;
  sent_ = wanted;
  sent_ns_ = now_ns;
}

}  // namespace stickslip::drivers::labjack
