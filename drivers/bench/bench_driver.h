// A bench of real devices as one rig: a board whose scans are the frames, gauges that are read
// beside it, and an amplifier's contacts.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/bench/gauge_reader.h"
#include "drivers/contacts.h"
#include "drivers/device_clock.h"
#include "drivers/driver.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// What a bench is made of.
struct BenchParts {
  std::unique_ptr<HostClock> clock;  ///< the devices' too
  std::unique_ptr<Driver> board;     ///< frames in V; its drive is the output in V
  std::vector<std::unique_ptr<Gauge>> gauges;
  std::unique_ptr<Contacts> amplifier;  ///< null: none
};

/// Frames are the board's, in V, with the latest reading of each gauge that is not newer than the
/// scan, in the gauge's unit, and its age. A gauge that is lost costs its channels and is looked
/// for by its own thread; the board or the amplifier costs the rig, and whoever owns this closes it
/// and opens it again. The amplifier's contact is the first to be opened, is told "off" before
/// the board's output and "on" after it; a board that fails for once does not switch it.
class BenchDriver final : public Driver {
 public:
  /// `inputs` says which channel comes from which input of which gauge; those of the board are the
  /// board's business.
  BenchDriver(BenchParts parts, const config::BenchInputs& inputs,
              const config::ShakerOutput& shaker, Patience patience = {});
  ~BenchDriver() override;

  /// The first time, every device has to be there; later, gauges may come by themselves.
  Result open() override;
  Result start() override;
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }
  Signals signals() const noexcept override;
  const char* left_on() const noexcept override;
  /// The board's, and of each gauge what it lost.
  Counts counts() const noexcept override;

 private:
  struct Wire {
    Channel channel = Channel::displacement;
    std::size_t gauge = 0;
    std::size_t input = 0;
  };
  void connect(const config::BenchInputs& inputs);
  bool connect(Channel channel, const config::BenchInput& wanted);
  void describe();
  void switch_contact_off() noexcept;
  double volts_of(double drive) const;

  std::unique_ptr<HostClock> clock_;  // outlives the devices that look at it
  std::unique_ptr<Driver> board_;
  std::vector<std::unique_ptr<GaugeReader>> gauges_;
  std::vector<Wire> wires_;
  std::unique_ptr<Contacts> amplifier_;
  config::ShakerOutput shaker_;
  DeviceClock device_clock_;
  Description description_;
  std::string unmatched_;  // inputs that no device has, in words
  bool contact_on_ = false;
  std::string left_on_;  // the contact, in words; empty: it is off
  bool opened_before_ = false;
};

}  // namespace stickslip::drivers
