// SPDX-License-Identifier: Apache-2.0
// Contacts of the shaker amplifier on a GPIO chip: outputs enable and heartbeat, inputs fault and
// emergency stop.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "config/bench.h"
#include "drivers/amplifier/debounced.h"
#include "drivers/amplifier/gpio_lines.h"
#include "drivers/attached_device.h"
#include "drivers/clock/host_clock.h"
#include "drivers/contacts.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// open, write, switch_off and close in the loop's thread (or one after the other); signals in any.
///
/// The loop commands, and a separate thread sets the lines: the kernel waits five seconds for each
/// transfer of a USB chip that hangs, which the loop cannot afford.
///
/// Unknown states are unsafe states: a configured emergency stop or fault counts as active before
/// open, after close, when the chip is disconnected, and when the lines have not been sampled for
/// `validity_ns`. A line that is not configured is always inactive; the loss of the chip is
/// reported by write().
class Amplifier final : public Contacts {
 public:
  /// Lines are sampled every 50 ms. An older sample is invalid: the sampling thread hangs in the
  /// chip's driver or is not scheduled. The same limit applies to the thread that sets lines.
  static constexpr std::int64_t validity_ns = 300'000'000;

  /// `clock` is used from several threads, and must outlive the object.
  Amplifier(const config::Amplifier& settings, HostClock& clock);
  ~Amplifier() override;

  /// Finds the chip by path, name or label and requests the lines; enable and heartbeat are
  /// requested inactive, without a pulse. Lost if enable reads back as active.
  Result open() override;

  /// Once a cycle. Commands enable, unless its state is confirmed, and toggles the heartbeat after
  /// each period: it stops with the loop. Neither allocates, locks nor waits. A failed command is
  /// repeated; one that has not been carried out for `validity_ns` means that the chip is lost.
  Result write(bool amplifier_on) override;

  /// Waits until the chip reports enable as inactive, at most `validity_ns`. Ok only if so, and if
  /// the chip is not lost.
  Result switch_off() override;

  Signals signals() const noexcept override;

  /// Leaves enable inactive and the heartbeat constant. Waits for a hanging chip until the
  /// kernel times out.
  void close() noexcept override;

 private:
  /// Levels of the outputs. The serial number distinguishes a repeated command.
  struct Command {
    bool enable = false;
    bool heartbeat = false;
    std::uint32_t serial = 0;

    /// Packed in one word, for a lock-free exchange.
    std::uint64_t word() const;
    static Command in(std::uint64_t word);
  };
  Result refused(const gpio::Refusal& refusal);
  Result find_chip(std::string& path);
  bool request_outputs(const std::string& path, gpio::Refusal& refusal);
  bool request_inputs(const std::string& path, gpio::Refusal& refusal);
  Result failed(int error);
  int set_enable(bool active) noexcept;
  void issue(Command command, std::int64_t now_ns);
  Result collect_result(std::int64_t now_ns);
  void execute_commands();
  void watch_inputs();
  bool sample_inputs(std::span<bool> went_active);
  void set_unknown() noexcept;
  bool is_known() const noexcept;

  config::Amplifier settings_;
  HostClock& clock_;
  std::int64_t heartbeat_period_ns_;
  std::string message_;
  std::string lost_message_;
  std::string set_failed_message_;
  std::string hung_message_;

  // Of the loop's thread.
  std::optional<std::size_t> enable_;
  std::optional<std::size_t> heartbeat_;
  Command command_;                    // the latest one
  std::uint32_t completed_ = 0;        // serial number of the latest completed command
  bool command_failed_ = false;        // the completed one
  std::int64_t waiting_since_ns_ = 0;  // for a result, if a command is pending
  std::int64_t next_heartbeat_ns_ = 0;
  int consecutive_failures_ = 0;
  const char* lost_reason_ = nullptr;
  bool open_ = false;

  // Of the setting thread, while it runs. A result holds the serial number of the command, the
  // number of consecutive failures, and the error number.
  std::unique_ptr<gpio::Lines> outputs_;
  bool reads_back_ = false;  // the chip can read its outputs
  std::atomic<std::uint64_t> command_word_{0};
  std::atomic<std::uint64_t> result_{0};
  int command_event_ = -1;
  std::thread setter_;

  // Of the sampling thread, while it runs.
  struct Input {
    gpio::Debounced state;
    std::atomic<bool>* result;
  };
  std::unique_ptr<gpio::Lines> inputs_;
  std::vector<Input> watched_;
  int wake_ = -1;
  std::atomic<bool> stopping_{false};
  std::thread watcher_;

  std::atomic<bool> lost_{false};
  std::atomic<std::int64_t> sampled_ns_{0};  // start of the latest sample of the lines
  std::atomic<bool> emergency_stop_;
  std::atomic<bool> fault_;
};

/// The chips of this host.
std::vector<AttachedDevice> find_gpio_chips();

}  // namespace stickslip::drivers
