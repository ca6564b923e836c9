// SPDX-License-Identifier: Apache-2.0
// The paper's bench as a simulated rig, observed by a FrictionObserver.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "observer/observer.h"
#include "physics/simulator.h"

namespace stickslip::observer::test {

enum class Law { coulomb, state_variable, set_valued };

/// The paper's rig with noise of about 0.3 % of each channel's range.
inline physics::Model paper_rig(Law law, bool wedge = false, bool resonant = true) {
  using namespace physics;
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = Parameter{2.4};
  model.oscillator.damping_ratio = Parameter{0.015};
  model.normal_load = NormalLoad{
      wedge ? NormalLoadLaw::wedge : NormalLoadLaw::constant, {0.15}, {wedge ? 25.0 : 0.0}};
  model.friction.law =
      law == Law::state_variable ? FrictionLaw::state_variable : FrictionLaw::coulomb;
  model.friction.mu = {0.8};
  model.friction.transition_speed_m_s = {law == Law::set_valued ? 0.0 : 0.0025};
  if (law == Law::state_variable) model.friction.rate_per_s = {150.0};
  model.load_cell =
      LoadCell{{0.0126},
               {19.3},
               {0.016},
               resonant ? LoadCellDynamics::resonant : LoadCellDynamics::quasi_static};
  const std::vector<Filter> analogue = {{FilterKind::butterworth_lowpass, 4, 25.0}};
  const auto set_sensor = [&](Channel channel, double noise_std,
                              const std::vector<Filter>& filters) {
    model.sensors[index_of(channel)].noise_std = noise_std;
    model.sensors[index_of(channel)].filters = filters;
  };
  set_sensor(Channel::displacement, 6.0e-5, analogue);
  set_sensor(Channel::velocity, 1.5e-3, {{FilterKind::first_order_lowpass, 1, {150.0}}});
  set_sensor(Channel::friction_force, 6.0e-4, analogue);
  set_sensor(Channel::normal_load, 6.0e-4, analogue);
  set_sensor(Channel::base_displacement, 4.0e-5, analogue);
  return model;
}

/// Base motion A(t) sin(w t) and its acceleration. A varies slowly between `amplitude_m` and
/// (1 - depth) of it, starting at the minimum for phase 0.
struct ModulatedBase {
  double amplitude_m = 0.012;
  double carrier_hz = 3.0;
  double modulation_hz = 0.1;
  double depth = 1.0;
  double phase_rad = 0.0;

  physics::Input operator()(double t) const {
    const double w = 2.0 * std::numbers::pi * carrier_hz;
    const double s = 2.0 * std::numbers::pi * modulation_hz;
    const double swing = 0.5 * depth * amplitude_m;
    const double at = s * t + phase_rad;
    const double a = amplitude_m - swing - swing * std::cos(at);
    const double a1 = swing * s * std::sin(at);
    const double a2 = swing * s * s * std::cos(at);
    physics::Input input;
    input.base_displacement_m = a * std::sin(w * t);
    input.base_acceleration_m_s2 =
        a2 * std::sin(w * t) + 2.0 * a1 * w * std::cos(w * t) - a * w * w * std::sin(w * t);
    return input;
  }
};

/// A frame, the true state at its time, and the observer's estimate.
struct Sample {
  Frame frame;
  physics::RigTruth truth;
  FrictionEstimate estimate;
};

struct RunOptions {
  double duration_s = 12.0;
  double period_s = 1.0e-3;
  std::uint64_t seed = 1;
  std::function<physics::Input(double)> drive = ModulatedBase{};
  std::function<void(Frame&)> modify = [](Frame&) {};  ///< applied to each frame
};

/// Runs an observer with the model `assumed` on a rig with the model `real`.
inline std::vector<Sample> run_observer(const physics::Model& real, const physics::Model& assumed,
                                        const RunOptions& options = {}) {
  physics::RigSimulator rig(real, {.step_s = 1.25e-4, .seed = options.seed});
  rig.set_input(options.drive(0.0));
  FrictionObserver observer(assumed, options.period_s);
  std::vector<Sample> samples;
  const auto count = static_cast<long>(std::llround(options.duration_s / options.period_s));
  samples.reserve(static_cast<std::size_t>(count));
  for (long k = 1; k <= count; ++k) {
    // The acceleration of some drives is not linear over a millisecond.
    for (int half = 1; half <= 2; ++half) {
      const double t = (static_cast<double>(k - 1) + 0.5 * half) * options.period_s;
      rig.advance(0.5 * options.period_s, options.drive(t));
    }
    Sample sample;
    sample.frame = rig.read();
    options.modify(sample.frame);
    sample.truth = rig.truth();
    sample.estimate = observer.update(sample.frame);
    samples.push_back(sample);
  }
  return samples;
}

/// Root mean square of error(sample) over the samples from `from_s` on.
inline double rms(const std::vector<Sample>& samples, double from_s,
                  const std::function<double(const Sample&)>& error) {
  double sum = 0.0;
  std::size_t count = 0;
  const double start = samples.front().frame.time_s();
  for (const Sample& sample : samples) {
    if (sample.frame.time_s() - start < from_s) continue;
    sum += error(sample) * error(sample);
    ++count;
  }
  return std::sqrt(sum / static_cast<double>(count));
}

/// Mean normalised innovation squared per degree of freedom; 1 for a consistent filter.
inline double mean_nis(const std::vector<Sample>& samples, double from_s) {
  double sum = 0.0;
  double freedom = 0.0;
  const double start = samples.front().frame.time_s();
  for (const Sample& sample : samples) {
    if (sample.frame.time_s() - start < from_s) continue;
    sum += sample.estimate.nis;
    freedom += sample.estimate.nis_freedom;
  }
  return sum / freedom;
}

}  // namespace stickslip::observer::test
