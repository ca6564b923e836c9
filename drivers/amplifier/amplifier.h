// The shaker amplifier's contacts on the lines of a GPIO chip: enable and heartbeat out, fault and
// emergency stop in.
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
#include "drivers/attached.h"
#include "drivers/contacts.h"
#include "drivers/driver.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// open, write, switch_off and close in the loop's thread (or one after the other); signals in any.
///
/// The loop decides, and a thread of its own sets the lines: the kernel gives a chip at USB that
/// hangs five seconds for every transfer, and the loop has none of them.
///
/// Whatever is not known is pressed: an emergency stop that is configured counts as pressed, and a
/// fault as one, before open, after close, when the chip is gone, and when nobody has looked at the
/// lines for `believed_for_ns`. A line that is not configured says nothing, then as ever: that the
/// chip is gone is what write() answers.
class Amplifier final : public Contacts {
 public:
  /// Lines are looked at every 50 ms. A look that is older than this is no knowledge: the thread
  /// that looks hangs in the chip's driver, or gets no processor. The same holds for the thread
  /// that sets lines.
  static constexpr std::int64_t believed_for_ns = 300'000'000;

  /// `clock` is asked from several threads, and must outlive it.
  Amplifier(const config::Amplifier& settings, HostClock& clock);
  ~Amplifier() override;

  /// Finds the chip by path, name or label and requests the lines; enable and heartbeat begin
  /// inactive, and have never been active in between. Lost, where enable reads as active.
  Result open() override;

  /// Once a cycle. Orders enable to be as it should, where it is not known to be so, and turns the
  /// heartbeat when its period is over: a loop that hangs lets it stop. Allocates nothing, takes no
  /// lock and waits for nobody. An order that failed is given again; one that nobody has carried
  /// out for `believed_for_ns` means that the chip is lost.
  Result write(bool amplifier_on) override;

  /// Waits until enable is inactive as far as the chip tells, no longer than `believed_for_ns`.
  /// Well only if so, and if the chip is not lost.
  Result switch_off() override;

  Signals signals() const noexcept override;

  /// Leaves enable inactive and the heartbeat still. Waits for a chip that hangs until the kernel
  /// has given it up.
  void close() noexcept override;

 private:
  /// How the outputs shall be. The serial number makes the same one, given again, another.
  struct Order {
    bool enable = false;
    bool heartbeat = false;
    std::uint32_t serial = 0;

    /// In one word, which is handed over without a lock.
    std::uint64_t word() const;
    static Order in(std::uint64_t word);
  };
  Result refused(const gpio::Refusal& refusal);
  Result find_chip(std::string& path);
  bool request_outputs(const std::string& path, gpio::Refusal& refusal);
  bool request_inputs(const std::string& path, gpio::Refusal& refusal);
  Result failed(int error);
  int set_enable(bool active) noexcept;
  void give(Order order, std::int64_t now_ns);
  Result take_answer(std::int64_t now_ns);
  void carry_out_orders();
  void watch_inputs();
  bool look_at_inputs(std::span<bool> went_active);
  void say_unknown() noexcept;
  bool is_known() const noexcept;

  config::Amplifier settings_;
  HostClock& clock_;
  std::int64_t heartbeat_period_ns_;
  std::string message_;
  std::string lost_message_;
  std::string failed_message_;
  std::string hangs_message_;

  // The loop's.
  std::optional<std::size_t> enable_;
  std::optional<std::size_t> heartbeat_;
  Order order_;                        // the latest one
  std::uint32_t answered_ = 0;         // the serial number of the latest that was carried out
  bool order_failed_ = false;          // that one
  std::int64_t waiting_since_ns_ = 0;  // for an answer, if one is due
  std::int64_t next_beat_ns_ = 0;
  int failures_in_row_ = 0;
  const char* lost_because_ = nullptr;
  bool open_ = false;

  // The setting thread's, while it runs. An answer: the order's serial number, how many have failed
  // in a row, and the error's number.
  std::unique_ptr<gpio::Lines> outputs_;
  bool reads_back_ = false;  // the chip tells what an output holds
  std::atomic<std::uint64_t> given_{0};
  std::atomic<std::uint64_t> answer_{0};
  int given_event_ = -1;
  std::thread setter_;

  // The watching thread's, while it runs.
  struct Input {
    gpio::Debounced state;
    std::atomic<bool>* told;
  };
  std::unique_ptr<gpio::Lines> inputs_;
  std::vector<Input> watched_;
  int wake_ = -1;
  std::atomic<bool> stopping_{false};
  std::thread watcher_;

  std::atomic<bool> lost_{false};
  std::atomic<std::int64_t> looked_ns_{0};  // when the lines began to be looked at, last
  std::atomic<bool> emergency_stop_;
  std::atomic<bool> fault_;
};

/// The chips of this host, for a person who configures one.
std::vector<Attached> find_gpio_chips();

}  // namespace stickslip::drivers
