// SPDX-License-Identifier: Apache-2.0
// Output of a LabJack U6 while it streams: set-points at the DAC, the enable line, which the
// board's watchdog guards, and the input lines that each reply carries.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "config/bench.h"
#include "drivers/labjack_u6/stream_session.h"

namespace stickslip::drivers::labjack_u6 {

/// A state machine over the command slots of a session. The watchdog is armed before the stream,
/// and every command restarts it. No call waits. While a command is in progress, the newest
/// set-point replaces earlier ones; "off" is sent immediately in any case. Results are collected by
/// later calls. One thread.
class StreamingOutput {
 public:
  /// `name` begins the messages. `sent_counts` is the current DAC value, `echo` numbers the
  /// commands of all users of the board. The references must outlive the object.
  StreamingOutput(const config::LabjackU6& settings, const std::string& name,
                  StreamSession& session, Lines& lines, std::uint8_t& echo,
                  std::uint16_t sent_counts, std::int64_t now_ns);

  /// The command of one cycle. `requested` is the amplifier state of the caller, `on`
  /// the state that it may have (off for an invalid drive).
  void apply(std::uint16_t counts, bool requested, bool on, std::int64_t now_ns);
  /// Sends "off" immediately.
  void turn_off(std::uint16_t counts, std::int64_t now_ns);

  bool is_off() const { return !on_; }
  /// Keeps the input lines up to date before the amplifier is first enabled. Only while off: with
  /// the amplifier on, only commands of the caller may feed the watchdog.
  void refresh_while_off(std::int64_t now_ns);
  /// True if the newest set-point has not been sent yet.
  bool has_pending_set_point() const { return on_ && !tripped_ && wanted_counts_ != sent_counts_; }
  void send_pending_set_point(std::int64_t now_ns);

  /// True after the board's watchdog has, or may have, disabled the amplifier; until "off" is
  /// requested.
  bool tripped() const { return tripped_; }
  /// The latest failure of a command, null if there is none. It is reported at least once, and
  /// until a later command is confirmed. Valid until the next call.
  const char* report_failure();

 private:
  void collect(std::int64_t now_ns);
  void collect_set_point(std::int64_t now_ns);
  void collect_off(std::int64_t now_ns);
  void request_lines(std::int64_t now_ns);
  bool reads_lines() const;
  void keep_off(std::uint16_t counts, std::int64_t now_ns);
  void keep_on(std::uint16_t counts, std::int64_t now_ns);
  void send_set_point(std::uint16_t counts, bool on, std::int64_t now_ns);
  bool is_due(std::uint16_t counts, bool on, std::int64_t now_ns) const;
  bool watchdog_expired(std::int64_t now_ns) const;
  void note_failure(Slot slot, const char* what, const char* why);
  void note_success(Slot slot, std::int64_t sent_ns);

  const config::LabjackU6& settings_;
  const std::string& name_;
  StreamSession& session_;
  Lines& lines_;
  std::uint8_t& echo_;

  bool on_ = false;
  bool off_unconfirmed_ = false;
  bool tripped_ = false;
  bool sent_on_ = false;
  bool resend_ = true;
  std::uint16_t sent_counts_;
  std::uint16_t wanted_counts_ = 0;  // while the amplifier is on
  std::int64_t sent_ns_;             // time of the latest command
  std::int64_t confirmed_ns_;        // send time of the latest confirmed command

  std::array<char, 200> failure_{};  // empty: none to report
  bool failure_reported_ = false;
  std::uint8_t failed_ = 0;  // bit: slot whose latest command failed, none confirmed since
};

}  // namespace stickslip::drivers::labjack_u6
