#include "drivers/simulated/simulated_driver.h"

#include <array>
#include <cmath>
#include <exception>

#include "physics/sensor_chain.h"
#include "physics/simulator.h"

namespace stickslip::drivers {

namespace {

physics::SimulationOptions options_of(const config::SimulatedDriver& settings) {
  physics::SimulationOptions options;
  options.step_s = settings.step_s;
  options.seed = settings.seed;
  options.noise = settings.noise;
  options.resolution = settings.resolution;
  return options;
}

}  // namespace

struct SimulatedDriver::Bench {
  Bench(const config::SimulatedDriver& settings, double period_s)
      : simulator(settings.truth, options_of(settings)),
        shaker(std::array{physics::Filter{physics::FilterKind::butterworth_lowpass, 4,
                                          settings.shaker_bandwidth_hz}},
               period_s) {}

  physics::RigSimulator simulator;
  physics::FilterChain shaker;
  physics::FilterMemory<double> moving;
  double command = 0.0;
  std::uint64_t next = 0;
};

SimulatedDriver::SimulatedDriver(const config::SimulatedDriver& settings, double period_s)
    : settings_(settings), period_s_(period_s) {
  description_.name = "simulated rig";
  description_.can_drive = true;
  for (const Channel channel : all_channels) {
    description_.unit[index_of(channel)] = info(channel).unit.data();
  }
}

SimulatedDriver::~SimulatedDriver() = default;

Result SimulatedDriver::open() {
  try {
    bench_ = std::make_unique<Bench>(settings_, period_s_);
    // What this rig measures is what a first reading holds; the bench itself stays untouched.
    description_.channels = Bench(settings_, period_s_).simulator.read().valid;
  } catch (const std::exception&) {
    return {Outcome::needs_attention, "the simulated rig's truth is no sound model"};
  }
  return {};
}

Result SimulatedDriver::start() {
  if (!bench_) return {Outcome::fatal, "start of a simulated rig that is not open"};
  running_ = true;
  return {};
}

Result SimulatedDriver::read(Frame& frame) {
  if (!bench_ || !running_) return {Outcome::fatal, "read of a simulated rig that is not started"};
  Bench& bench = *bench_;
  if (bench.next > 0) {
    bench.shaker.advance(bench.moving, bench.command, 0.0);
    physics::Input input;
    if (settings_.truth.oscillator.excitation == physics::Excitation::force) {
      input.drive_force_n = bench.shaker.output(bench.moving);
    } else {
      input.base_displacement_m = bench.shaker.output(bench.moving);
      input.base_acceleration_m_s2 = bench.shaker.output_acceleration(bench.moving);
    }
    bench.simulator.advance(period_s_, input);
  }
  frame = bench.simulator.read();
  frame.sequence = bench.next++;
  frame.time_ns = std::llround(static_cast<double>(frame.sequence) * period_s_ * 1.0e9);
  for (const double value : frame.value) {
    if (!std::isfinite(value))
      return {Outcome::fatal, "the simulated rig's motion grew without bound"};
  }
  return {};
}

Result SimulatedDriver::write(const Actuation& actuation) {
  if (!bench_) return {Outcome::fatal, "write to a simulated rig that is not open"};
  if (!std::isfinite(actuation.drive)) return {Outcome::fatal, "the commanded drive is not finite"};
  bench_->command = actuation.amplifier_on ? actuation.drive : 0.0;
  return {};
}

void SimulatedDriver::stop() noexcept {
  if (bench_) bench_->command = 0.0;
  running_ = false;
}

void SimulatedDriver::close() noexcept {
  running_ = false;
  bench_.reset();
}

}  // namespace stickslip::drivers
