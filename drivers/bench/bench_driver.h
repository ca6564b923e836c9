// A bench of real devices as one rig: a board whose scans are the frames, gauges that are read
// beside it, and an amplifier's contacts.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/bench/gauge_reader.h"
#include "drivers/device_clock.h"
#include "drivers/driver.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// The amplifier's contacts, as the bench uses them; see amplifier/amplifier.h.
class Contacts {
 public:
  Contacts() = default;
  Contacts(const Contacts&) = delete;
  Contacts& operator=(const Contacts&) = delete;
  virtual ~Contacts() = default;

  virtual Result open() = 0;
  /// Called in every cycle, off as well as on.
  virtual Result write(bool amplifier_on) = 0;
  virtual Signals signals() const noexcept = 0;
  virtual void close() noexcept = 0;
};

/// Which channel comes from which input of which gauge.
struct GaugeWire {
  Channel channel = Channel::displacement;
  std::size_t gauge = 0;
  std::size_t input = 0;
};

/// What a bench is made of.
struct BenchParts {
  std::unique_ptr<Driver> board;  ///< frames in V; its drive is the output in V
  std::vector<std::unique_ptr<Gauge>> gauges;
  std::vector<GaugeWire> wires;
  std::unique_ptr<Contacts> amplifier;  ///< null: none
};

/// Frames are the board's, in V, with the latest reading of each gauge that is not newer than the
/// scan, in the gauge's unit, and its age. A gauge that is lost costs its channels and is looked
/// for by its own thread; the board or the amplifier costs the rig, and whoever owns this closes it
/// and opens it again. The amplifier's contact goes off before the board's output, and on after it.
class BenchDriver final : public Driver {
 public:
  BenchDriver(BenchParts parts, const config::ShakerOutput& shaker, HostClock& clock,
              Patience patience = {});
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

 private:
  void describe();
  double volts_of(double drive) const;

  std::unique_ptr<Driver> board_;
  std::vector<std::unique_ptr<GaugeReader>> gauges_;
  std::vector<GaugeWire> wires_;
  std::unique_ptr<Contacts> amplifier_;
  config::ShakerOutput shaker_;
  HostClock& clock_;
  DeviceClock device_clock_;
  Description description_;
  bool opened_before_ = false;
};

}  // namespace stickslip::drivers
