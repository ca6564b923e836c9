// SPDX-License-Identifier: Apache-2.0
// Output of a LabJack board while it streams: set-points at the DAC, the enable line, which the
// board's watchdog guards, and the input lines that each reply carries.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "drivers/labjack/command_slot.h"
#include "drivers/labjack/lines.h"

namespace stickslip::drivers::labjack {

/// A voltage as the board takes it (counts, or the bits of a number): compared, not calculated
/// with.
using SetPoint = std::uint32_t;

/// The commands of a board that streams. No call waits.
class OutputPort {
 public:
  OutputPort() = default;
  OutputPort(const OutputPort&) = delete;
  OutputPort& operator=(const OutputPort&) = delete;
  virtual ~OutputPort() = default;

  virtual Progress progress(Slot slot, std::int64_t now_ns) = 0;
  /// True if no command of that slot is in progress.
  virtual bool free(Slot slot) const = 0;
  /// Sets DAC and enable line ("off": the line first), restarts the watchdog and reads the lines.
  /// Only where free(). False: it was not sent.
  virtual bool send_output(Slot slot, SetPoint set_point, bool on, std::int64_t now_ns) = 0;
  /// Likewise, but only reads the lines, in the slot `lines`.
  virtual bool send_request_of_lines(std::int64_t now_ns) = 0;
  /// Why a command failed: a literal.
  virtual const char* reason(const Progress& failed) const = 0;
};

struct OutputRules {
  bool reads_lines = false;  ///< some input line is configured
  int watchdog_s = 0;        ///< 0: no watchdog guards the enable line
  /// "On" may reach the board this long after it was sent; the watchdog must not have acted by
  /// then.
  std::int64_t max_transit_ns = 0;
};

/// A state machine over the command slots of a session. The watchdog is armed before the stream,
/// and every command restarts it. No call waits. While a command is in progress, the newest
/// set-point replaces earlier ones; "off" is sent immediately in any case. Results are collected by
/// later calls. One thread.
class StreamingOutput {
 public:
  /// `name` begins the messages. `sent` is the current set-point. The references must outlive the
  /// object.
  StreamingOutput(const OutputRules& rules, const std::string& name, OutputPort& port,
                  const Lines& lines, SetPoint sent, std::int64_t now_ns);

  /// The command of one cycle. `requested` is the amplifier state of the caller, `on`
  /// the state that it may have (off for an invalid drive).
  void apply(SetPoint wanted, bool requested, bool on, std::int64_t now_ns);
  /// Sends "off" immediately.
  void turn_off(SetPoint wanted, std::int64_t now_ns);

  bool is_off() const { return !on_; }
  /// Keeps the input lines up to date before the amplifier is first enabled. Only while off: with
  /// the amplifier on, only commands of the caller may feed the watchdog.
  void refresh_while_off(std::int64_t now_ns);
  /// True if the newest set-point has not been sent yet.
  bool has_pending_set_point() const { return on_ && !tripped_ && wanted_ != sent_; }
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
  void keep_off(SetPoint wanted, std::int64_t now_ns);
  void keep_on(SetPoint wanted, std::int64_t now_ns);
  void send_set_point(SetPoint wanted, bool on, std::int64_t now_ns);
  bool is_due(SetPoint wanted, bool on, std::int64_t now_ns) const;
  bool watchdog_expired(std::int64_t now_ns) const;
  void note_failure(Slot slot, const char* what, const char* why);
  void note_success(Slot slot, std::int64_t sent_ns);

  OutputRules rules_;
  const std::string& name_;
  OutputPort& port_;
  const Lines& lines_;

  bool on_ = false;
  bool off_unconfirmed_ = false;
  bool tripped_ = false;
  bool sent_on_ = false;
  bool resend_ = true;
  SetPoint sent_;
  SetPoint wanted_ = 0;        // while the amplifier is on
  std::int64_t sent_ns_;       // time of the latest command
  std::int64_t confirmed_ns_;  // send time of the latest confirmed command

  std::array<char, 200> failure_{};  // empty: none to report
  bool failure_reported_ = false;
  std::uint8_t failed_ = 0;  // bit: slot whose latest command failed, none confirmed since
};

}  // namespace stickslip::drivers::labjack
