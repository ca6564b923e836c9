// A LabJack U6 or U6-Pro as the board of a bench: its inputs are streamed, one of its DACs drives
// the shaker, and one of its lines lets the amplifier run.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/attached.h"
#include "drivers/driver.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

namespace labjack_u6 {
struct Command;
struct Verdict;
class Lines;
struct StreamCounts;
enum class Slot : std::uint8_t;
}  // namespace labjack_u6

/// A frame is a scan, in volts at the inputs; its time is exactly its number times the period of
/// the board's crystal, and its sequence counts the scans that were lost too, whether on the bus or
/// in the board. Actuation.drive is volts at the configured DAC; Actuation.amplifier_on is the
/// level of the enable line.
///
/// read and write are for one thread; the samples arrive in another one, which this starts.
class LabjackU6Driver final : public Driver {
 public:
  /// `inputs` are those on this board alone (input "AIN0" to "AIN13"; differential pairs begin with
  /// an even one; range_v 10, 1, 0.1 or 0.01). `rate_hz` is that of the scans. The clock has to
  /// outlive it. What cannot be done is told by open.
  LabjackU6Driver(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                  double rate_hz, HostClock& clock);
  ~LabjackU6Driver() override;

  /// Finds the board, makes the enable line low before anything else (again, where a later step
  /// fails), reads its calibration, ends a stream that a dead process has left behind, and
  /// makes the output safe: the enable line low, the DAC at rest.
  Result open() override;
  Result start() override;
  /// Waits at most 20 ms. A loss of the board or of the count of scans is told until close.
  Result read(Frame& frame) override;
  /// Never waits. While a command is under way, the newest set-point replaces those before it;
  /// "off" is sent at once in any case. What became of a command is told by a later write:
  /// after a failure every one says `temporary`, until a command was confirmed.
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }
  /// Read with every command, and at least every 20 ms while read or write is called; where an
  /// answer stays away, asked for once more after 50 ms. For any thread. While started, a line that
  /// is configured counts as pressed or as a fault where no command of the last 100 ms was
  /// answered; the start counts as an answer.
  Signals signals() const noexcept override;
  const char* left_on() const noexcept override {
    return left_on_.empty() ? nullptr : left_on_.c_str();
  }
  Counts counts() const noexcept override;

 private:
  struct Board;
  enum class Power : std::uint8_t { off, arming, on };

  Result refuse(Outcome outcome, std::string text);
  std::string trouble_with_settings() const;
  Result prepare();
  Result begin_stream();
  labjack_u6::Command enable_line_low();
  void hold_enable_line_low() noexcept;
  labjack_u6::Verdict answered(std::span<const std::uint8_t> reply) const;
  bool make_safe() noexcept;
  void wind_down() noexcept;
  void note_left_on(const char* why) noexcept;
  void forget_what_is_over();
  void note_failure(labjack_u6::Slot slot, const char* what, const char* why);
  void note_success(labjack_u6::Slot slot, std::int64_t sent_ns);
  Result ended();
  bool wait_for(Frame& frame);

  void collect(std::int64_t now_ns);
  void collect_set_point(std::int64_t now_ns);
  void collect_off(std::int64_t now_ns);
  void collect_watchdog(std::int64_t now_ns);
  void ask_for_lines(std::int64_t now_ns);
  bool reads_lines() const;
  void turn_off(std::uint16_t counts, std::int64_t now_ns);
  void keep_off(std::uint16_t counts, std::int64_t now_ns);
  void keep_on(std::uint16_t counts, std::int64_t now_ns);
  void send_set_point(std::uint16_t counts, bool on, std::int64_t now_ns);
  bool worth_sending(std::uint16_t counts, bool on, std::int64_t now_ns) const;
  bool guarded(std::int64_t now_ns);
  bool let_go_by_watchdog(std::int64_t now_ns) const;
  bool has_watchdog() const;

  config::LabjackU6 settings_;
  config::BenchInputs inputs_;
  double rate_hz_;
  HostClock& clock_;
  Description description_;
  std::unique_ptr<Board> board_;
  std::string refusal_;
  std::string left_on_;              // empty: all is off
  std::array<char, 200> failure_{};  // of a command; empty: none to tell
  bool failure_told_ = false;
  std::uint8_t failed_ = 0;  // bit: that slot; its latest command, and none was confirmed since
  std::array<char, 200> end_text_{};
  std::atomic<bool> running_{false};
  std::unique_ptr<labjack_u6::Lines> lines_;
  std::unique_ptr<labjack_u6::StreamCounts> counts_;

  Power power_ = Power::off;
  bool off_unconfirmed_ = false;
  bool watchdog_armed_ = false;
  bool arming_ = false;  // what is under way in the watchdog's slot
  bool let_go_ = false;  // by the watchdog; until the amplifier was told to be off
  bool sent_on_ = false;
  bool resend_ = false;
  std::uint16_t sent_counts_ = 0;
  std::uint16_t wanted_counts_ = 0;  // while the amplifier is on
  std::int64_t sent_ns_ = 0;         // of the latest command
  std::int64_t confirmed_ns_ = 0;    // when that was sent which was confirmed last
  double rest_v_;  // the drive that came with the latest "off"; before any, that of the settings
  std::uint8_t echo_ = 0;
};

/// Every LabJack U6 that is attached, whether or not it can be used.
std::vector<Attached> find_labjack_u6();

}  // namespace stickslip::drivers
