// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulated/simulated_driver.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "drivers/simulated/shaker.h"
#include "physics/simulator.h"

namespace stickslip::drivers {

namespace {

/// The acceleration of the base is linear within a step. Its error grows with the square of the
/// step: 0.01 % at 3 Hz with this one.
constexpr double max_shaker_step_s = 1.0e-4;

physics::SimulationOptions options_of(const config::SimulatedDriver& settings) {
  physics::SimulationOptions options;
  options.step_s = settings.step_s;
  options.seed = settings.seed;
  options.noise = settings.noise;
  options.resolution = settings.resolution;
  return options;
}

int steps_of(double period_s) {
  return std::max(1, static_cast<int>(std::ceil(period_s / max_shaker_step_s - 1.0e-9)));
}

// The bits of the channels for which the rig has an instrument.
std::uint8_t present_channels(const config::SimulatedDriver& settings) {
  std::uint8_t out = 0;
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (!settings.absent[c]) out = static_cast<std::uint8_t>(out | 1U << c);
  }
  return out;
}

}  // namespace

struct SimulatedDriver::Bench {
  Bench(const config::SimulatedDriver& settings, double period_s)
      : excitation(settings.truth.oscillator.excitation),
        steps(steps_of(period_s)),
        step_s(period_s / steps),
        present(present_channels(settings)),
        simulator(settings.truth, options_of(settings)),
        shaker(excitation, settings.shaker_bandwidth_hz, period_s, steps) {}

  Frame read() {
    Frame out = simulator.read();
    out.valid &= present;
    for (std::size_t c = 0; c < channel_count; ++c) {
      if (!((present >> c) & 1U)) out.value[c] = 0.0;
    }
    return out;
  }

  void move() {
    shaker.begin_cycle();
    for (int i = 0; i < steps; ++i) {
      shaker.advance();
      physics::Input input;
      if (excitation == physics::Excitation::force) {
        input.drive_force_n = shaker.output();
      } else {
        input.base_displacement_m = shaker.output();
        input.base_acceleration_m_s2 = shaker.acceleration();
      }
      simulator.advance(step_s, input);
    }
  }

  physics::Excitation excitation;
  int steps;
  double step_s;
  std::uint8_t present;
  physics::RigSimulator simulator;
  Shaker shaker;
  std::uint64_t next = 0;
};

SimulatedDriver::SimulatedDriver(const config::SimulatedDriver& settings, double period_s)
    : settings_(settings), period_s_(period_s) {
  description_.name = "simulated rig";
  description_.stepped_time = true;
  description_.can_drive = settings.truth.oscillator.excitation != physics::Excitation::imposed;
  for (const Channel channel : all_channels) {
    description_.unit[index_of(channel)] = info(channel).unit.data();
  }
}

SimulatedDriver::~SimulatedDriver() = default;

Result SimulatedDriver::open() {
  if (bench_) return {};
  if (const Result relay = open_relay(); !relay) return relay;
  try {
    auto bench = std::make_unique<Bench>(settings_, period_s_);
    // The channels are those of a first reading, of a copy: the bench itself is unchanged.
    description_.channels = Bench(settings_, period_s_).read().valid;
    bench_ = std::move(bench);
  } catch (const std::exception& error) {
    refusal_ = std::string("the true model of the simulated rig is invalid: ") + error.what();
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  return {};
}

Result SimulatedDriver::open_relay() {
  if (settings_.relay.empty() || relay_) return {};
  auto relay = std::make_unique<Relay>(settings_.relay);
  if (const Result opened = relay->open(); !opened) {
    refusal_ = opened.message;
    return {opened.outcome, refusal_.c_str()};
  }
  relay_ = std::move(relay);
  return {};
}

Result SimulatedDriver::start() {
  if (!bench_) return {Outcome::fatal, "start of a simulated rig that is not open"};
  running_ = true;
  return {};
}

Result SimulatedDriver::read(Frame& frame) {
  if (!running_) return {Outcome::fatal, "read of a simulated rig that is not started"};
  Bench& bench = *bench_;
  if (bench.next > 0) bench.move();
  Frame reading = bench.read();
  reading.sequence = bench.next++;
  reading.time_ns = std::llround(static_cast<double>(reading.sequence) * period_s_ * 1.0e9);
  for (const double value : reading.value) {
    if (!std::isfinite(value)) {
      return {Outcome::fatal, "the simulated rig diverged"};
    }
  }
  frame = reading;
  return {};
}

Result SimulatedDriver::write(const Actuation& actuation) {
  if (!running_) {
    // It is off.
    if (!actuation.amplifier_on) return {};
    return {Outcome::fatal, "write to a simulated rig that is not started"};
  }
  bench_->shaker.command(actuation.drive, actuation.amplifier_on);
  if (relay_) {
    const Result set = relay_->set(actuation.amplifier_on && std::isfinite(actuation.drive));
    if (!set) return set;
  }
  if (!std::isfinite(actuation.drive)) return {Outcome::fatal, "the commanded drive is not finite"};
  return {};
}

void SimulatedDriver::stop() noexcept {
  if (bench_) bench_->shaker.command(0.0, false);
  if (relay_) relay_->set(false);
  running_ = false;
}

void SimulatedDriver::close() noexcept {
  running_ = false;
  bench_.reset();
  relay_.reset();
}

}  // namespace stickslip::drivers
