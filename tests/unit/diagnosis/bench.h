// SPDX-License-Identifier: Apache-2.0
// A small rig for diagnoses: a mass on a spring, driven by a force and sampled at 200 Hz. Without a
// load cell a diagnosis takes a second instead of a minute.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <utility>

#include "diagnosis/experiment.h"
#include "diagnosis/shooting.h"
#include "physics/simulator.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis::test {

inline constexpr double rate_hz = 200.0;

/// 1 kg at 2 Hz, known within a few per cent; displacement measured with 20 um of noise, and exact
/// instruments.
inline physics::Model driven_mass() {
  physics::Model model;
  model.oscillator.excitation = physics::Excitation::force;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = physics::Parameter{158.0, 5.0};
  model.oscillator.damping_n_s_m = physics::Parameter{0.5, 0.2};
  model.sensors[index_of(Channel::displacement)].noise_std = 2.0e-5;
  for (const Channel channel : {Channel::displacement, Channel::drive_force}) {
    physics::Sensor& sensor = model.sensors[index_of(channel)];
    sensor.gain = physics::Parameter{1.0};
    sensor.offset = physics::Parameter{0.0};
    sensor.delay_s = physics::Parameter{0.0};
  }
  return model;
}

/// The same where nothing is known of its instruments.
inline physics::Model undeclared_instruments() {
  physics::Model model = driven_mass();
  for (physics::Sensor& sensor : model.sensors) {
    sensor.gain.reset();
    sensor.offset.reset();
    sensor.delay_s.reset();
  }
  return model;
}

/// The model with a term of the catalogue.
inline physics::Model with_term(physics::Model model, const char* id,
                                std::map<std::string, physics::Parameter> parameters) {
  physics::Term term;
  term.id = id;
  term.parameters = std::move(parameters);
  model.terms.push_back(term);
  return model;
}

/// An amplitude-modulated carrier at resonance, and a slower tone: small and large motion, and
/// rest.
inline double swelling_force_n(double time_s) {
  const double turn = 2.0 * std::numbers::pi * time_s;
  return 1.5 * (1.0 - std::cos(turn / 6.0)) * std::sin(2.0 * turn) + std::sin(0.7 * turn);
}

/// Blows of 20 ms, after which a mass rings.
inline double blows_n(double time_s) {
  return 10.0 * std::exp(-std::pow((std::fmod(time_s, 0.7) - 0.1) / 0.02, 2));
}

/// The mass at 20 Hz, with eight periods in a window: where the declared uncertainty of the
/// stiffness is two of them, the cost has a minimum for each number of periods.
inline physics::Model ringing_mass(double stiffness_sigma_n_m) {
  physics::Model model = driven_mass();
  model.oscillator.stiffness_n_m = physics::Parameter{15800.0, stiffness_sigma_n_m};
  return model;
}

inline constexpr std::uint8_t bits_of_displacement_and_force =
    (1U << index_of(Channel::displacement)) | (1U << index_of(Channel::drive_force));

/// Simulated recording of `channels` (bits), of displacement and drive force by default.
inline protocol::Recording record(const physics::Model& model, double duration_s,
                                  std::uint64_t seed = 1, bool noise = true,
                                  const std::function<double(double)>& force = swelling_force_n,
                                  std::uint8_t channels = bits_of_displacement_and_force) {
  physics::SimulationOptions options;
  options.seed = seed;
  options.noise = noise;
  options.step_s = 5.0e-4;
  physics::RigSimulator rig(model, options);
  protocol::Recording recording;
  recording.source = "bench.csv";
  const auto samples = static_cast<std::int64_t>(std::llround(duration_s * rate_hz)) + 1;
  physics::Input input;
  input.drive_force_n = force(0.0);
  rig.set_input(input);
  for (std::int64_t k = 0; k < samples; ++k) {
    // The force changes between its recorded samples.
    for (int part = 1; k > 0 && part <= 10; ++part) {
      input.drive_force_n = force((static_cast<double>(k - 1) + 0.1 * part) / rate_hz);
      rig.advance(0.1 / rate_hz, input);
    }
    Frame frame = rig.read();
    frame.time_ns = k * static_cast<std::int64_t>(1.0e9 / rate_hz);
    frame.valid &= channels;
    recording.channels |= frame.valid;
    recording.frames.push_back(frame);
  }
  return recording;
}

/// Correlation time of the error of add_slow_error.
inline constexpr double slow_error_s = 0.1;

/// Adds a slow error of that standard deviation to the displacement.
inline void add_slow_error(protocol::Recording& recording, double std_m, std::uint64_t seed) {
  const double kept = std::exp(-1.0 / (slow_error_s * rate_hz));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  double slow = std_m * normal(random);
  for (Frame& frame : recording.frames) {
    frame.set(Channel::displacement, frame[Channel::displacement] + slow);
    slow = kept * slow + std_m * std::sqrt(1.0 - kept * kept) * normal(random);
  }
}

/// The recording cut into windows of 0.4 s.
inline Experiment experiment_of(const protocol::Recording& recording, const physics::Model& model) {
  Experiment experiment = make_experiment(recording, model);
  cut_windows(experiment, model, 0.4);
  return experiment;
}

/// All its windows, in units of the noise.
inline Task all_windows(std::span<const Experiment> experiments) {
  Task task;
  task.experiments = experiments;
  task.sigma.fill(2.0e-5);
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    for (std::size_t w = 0; w < experiments[i].windows.size(); ++w) task.windows.push_back({i, w});
  }
  return task;
}

/// Fits the states of all windows; the declared parameters are held.
inline Fit with_fitted_states(const Task& task, const Hypothesis& hypothesis) {
  FitOptions options;
  options.parameters_free = false;
  return fit(task, hypothesis, std::vector<double>(hypothesis.unknowns().size(), 0.0),
             initial_states(task, hypothesis), options);
}

}  // namespace stickslip::diagnosis::test
