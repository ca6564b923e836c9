// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/rerun.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics/simulator.h"

namespace stickslip::diagnosis {

namespace {

constexpr double ramp_s = 0.5;

// Recorded drive `time_s` after the beginning of the longest stretch without a gap, interpolated
// linearly.
physics::Input recorded_at(const Experiment& recorded, double time_s) {
  const double h = recorded.period_s / recorded.substeps;
  const Segment played = recorded.longest_segment();
  const auto first = static_cast<double>(played.begin) * recorded.substeps;
  const auto last = static_cast<double>(played.end - 1) * recorded.substeps;
  const double position = std::clamp(first + time_s / h, first, last);
  const auto before = std::min(static_cast<std::size_t>(position), recorded.input.size() - 2);
  return physics::between(recorded.input[before], recorded.input[before + 1],
                          position - static_cast<double>(before));
}

// Envelope of a drive in bursts, with its derivatives.
struct Envelope {
  double value = 1.0;
  double first = 0.0;   // [1/s]
  double second = 0.0;  // [1/s2]
};

Envelope envelope_of(const Rerun& run, double time_s) {
  if (!(run.burst_s > 0.0)) return {};
  const double phase = std::fmod(time_s, 2.0 * run.burst_s);
  const double from_end_s =
      std::min(phase, run.burst_s - phase);  // from the nearer end of the burst
  if (from_end_s <= 0.0) return {0.0, 0.0, 0.0};
  if (from_end_s >= ramp_s) return {};
  const double omega_rad_s = std::numbers::pi / ramp_s;
  const double direction = phase < 0.5 * run.burst_s ? 1.0 : -1.0;
  return {0.5 * (1.0 - std::cos(omega_rad_s * from_end_s)),
          0.5 * direction * omega_rad_s * std::sin(omega_rad_s * from_end_s),
          0.5 * omega_rad_s * omega_rad_s * std::cos(omega_rad_s * from_end_s)};
}

// Input of a varied run. Displacements remain consistent with their derivatives.
physics::Input input_of(const Rerun& run, const Experiment& recorded, double time_s) {
  constexpr double half_step_s = 0.01;
  physics::Input input = recorded_at(recorded, run.pace * time_s);
  const double rate_m_s =
      (recorded_at(recorded, run.pace * time_s + half_step_s).base_displacement_m -
       recorded_at(recorded, run.pace * time_s - half_step_s).base_displacement_m) /
      (2.0 * half_step_s);
  const Envelope envelope = envelope_of(run, time_s);
  const double displacement_scale =
      run.amplitude / (run.pace * run.pace);  // at the same accelerations
  input.drive_force_n *= run.amplitude * envelope.value;
  input.base_acceleration_m_s2 = run.amplitude * envelope.value * input.base_acceleration_m_s2 +
                                 2.0 * displacement_scale * run.pace * envelope.first * rate_m_s +
                                 displacement_scale * envelope.second * input.base_displacement_m;
  input.base_displacement_m *= displacement_scale * envelope.value;
  input.velocity_m_s = displacement_scale * (run.pace * envelope.value * input.velocity_m_s +
                                             envelope.first * input.displacement_m);
  input.displacement_m *= displacement_scale * envelope.value;
  return input;
}

}  // namespace

physics::Model with_noise_of(physics::Model model, const Experiment& recorded) {
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (recorded.noise_std[c] > 0.0) model.sensors[c].noise_std = recorded.noise_std[c];
  }
  return model;
}

protocol::Recording rerun(const Experiment& recorded, const physics::Model& model, const Rerun& run,
                          std::uint64_t seed) {
  physics::SimulationOptions options;
  options.seed = seed;
  options.step_s = recorded.period_s / recorded.substeps;
  physics::RigTruth start;
  start.displacement_m = run.release * recorded.largest.displacement_m;
  if (run.from_recorded_state) {
    const StateGuess& guess = recorded.guess[recorded.longest_segment().begin];
    start.displacement_m = guess.displacement_m;
    start.velocity_m_s = guess.velocity_m_s;
    start.load_cell_deflection_m = guess.load_cell_deflection_m;
    start.load_cell_velocity_m_s = guess.load_cell_velocity_m_s;
  }
  physics::RigSimulator rig(with_noise_of(model, recorded), options, start);
  protocol::Recording recording;
  recording.source = "simulated";
  const Segment played = recorded.longest_segment();
  double duration_s = recorded.period_s * static_cast<double>(played.end - played.begin);
  if (run.longest_s > 0.0) duration_s = std::min(duration_s, run.longest_s);
  if (run.pace > 1.0) duration_s /= run.pace;  // the recorded drive ends earlier
  const auto samples = static_cast<std::size_t>(duration_s / recorded.period_s);
  rig.set_input(input_of(run, recorded, 0.0));
  for (std::size_t k = 0; k < samples; ++k) {
    const double time_s = recorded.period_s * static_cast<double>(k);
    for (int part = 1; k > 0 && part <= recorded.substeps; ++part) {
      const double h = recorded.period_s / recorded.substeps;
      rig.advance(h, input_of(run, recorded, time_s - recorded.period_s + h * part));
    }
    Frame frame = rig.read();
    frame.time_ns = std::llround(time_s * 1.0e9);
    for (const Channel channel : all_channels) {
      if (!(recorded.channel_std[index_of(channel)] > 0.0)) {
        frame.valid &= static_cast<std::uint8_t>(~(1U << index_of(channel)));
      }
    }
    recording.channels |= frame.valid;
    recording.frames.push_back(frame);
  }
  return recording;
}

}  // namespace stickslip::diagnosis
