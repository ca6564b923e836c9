// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/expected_motion.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/parallel/for_each.h"
#include "physics/input.h"

namespace stickslip::design {

namespace {

// Longest integration step [s]: the contact is implicit, and a design needs no more accuracy.
constexpr double step_s = 1.0e-3;

physics::Input input_at(const physics::Model& model, const Drive& drive, std::size_t sample) {
  physics::Input out;
  const double value = drive.samples[std::min(sample, drive.samples.size() - 1)];
  if (model.oscillator.excitation == physics::Excitation::force) {
    out.drive_force_n = value;
  } else {
    out.base_displacement_m = value;
    out.base_acceleration_m_s2 = second_derivative(drive, sample);
  }
  return out;
}

physics::RigSimulator simulator_of(const physics::Model& model, const physics::RigTruth& start) {
  physics::SimulationOptions options;
  options.step_s = step_s;
  options.noise = false;
  return physics::RigSimulator(model, options, start);
}

void widen(Motion& motion, const Frame& frame) {
  for (std::size_t c = 0; c < channel_count; ++c) {
    motion.finite = motion.finite && std::isfinite(frame.value[c]);
    motion.lowest[c] = std::min(motion.lowest[c], frame.value[c]);
    motion.highest[c] = std::max(motion.highest[c], frame.value[c]);
  }
}

// Largest value of any channel relative to its range.
double use_of(const Extent& extent, const MotionRanges& ranges) {
  double out = 0.0;
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (std::isfinite(ranges.high[c])) out = std::max(out, extent.highest[c] / ranges.high[c]);
    if (std::isfinite(ranges.low[c]) && ranges.low[c] < 0.0) {
      out = std::max(out, extent.lowest[c] / ranges.low[c]);
    }
  }
  return out;
}

}  // namespace

Motion motion_of(const physics::Model& model, const Drive& drive, std::size_t samples_apart) {
  physics::RigSimulator simulator = simulator_of(model, {});
  Motion out;
  out.samples_apart = samples_apart;
  out.period_s = drive.period_s * static_cast<double>(samples_apart);
  simulator.set_input(input_at(model, drive, 0));
  for (std::size_t k = 0; k < drive.samples.size() && out.finite; ++k) {
    if (k > 0) simulator.advance(drive.period_s, input_at(model, drive, k));
    const Frame frame = simulator.read();
    widen(out, frame);
    if (k % samples_apart != 0) continue;
    out.readings.push_back(frame);
    out.state.push_back(simulator.truth());
  }
  return out;
}

std::vector<Frame> readings_from(const physics::Model& model, const Drive& drive,
                                 const physics::RigTruth& start, std::size_t begin,
                                 std::size_t count, std::size_t samples_apart) {
  physics::RigSimulator simulator = simulator_of(model, start);
  simulator.set_input(input_at(model, drive, begin));
  std::vector<Frame> out;
  for (std::size_t k = 1; k <= count * samples_apart; ++k) {
    simulator.advance(drive.period_s, input_at(model, drive, begin + k));
    if (k % samples_apart == 0) out.push_back(simulator.read());
  }
  return out;
}

physics::Model with_stiffness(physics::Model model, double factor) {
  physics::Oscillator& rig = model.oscillator;
  if (rig.two_well) {
    rig.two_well->linear_n_m.value *= factor;
    rig.two_well->cubic_n_m3.value *= factor;
  }
  if (rig.stiffness_n_m) rig.stiffness_n_m->value *= factor;
  if (rig.natural_frequency_hz) rig.natural_frequency_hz->value *= std::sqrt(factor);
  return model;
}

std::optional<Bounded> within_ranges(std::span<const physics::Model> models,
                                     std::span<const double> factors, const Drive& drive,
                                     const MotionRanges& ranges, double share, int threads) {
  constexpr int most_attempts = 8;
  Bounded out{drive, 1.0, {}};
  for (int attempt = 0; attempt < most_attempts; ++attempt) {
    std::vector<Motion> motions(models.size() * factors.size());
    parallel::for_each(motions.size(), threads, [&](std::size_t i) {
      const physics::Model& model = models[i / factors.size()];
      motions[i] = motion_of(with_stiffness(model, factors[i % factors.size()]), out.drive,
                             out.drive.samples.size());
    });
    out.extent = {};
    bool finite = true;
    for (const Motion& motion : motions) {
      finite = finite && motion.finite;
      for (std::size_t c = 0; c < channel_count; ++c) {
        out.extent.lowest[c] = std::min(out.extent.lowest[c], motion.lowest[c]);
        out.extent.highest[c] = std::max(out.extent.highest[c], motion.highest[c]);
      }
    }
    const double use = finite ? use_of(out.extent, ranges) / share : 4.0;
    if (use <= 1.0) return out;
    // A little more than in proportion: motion does not always follow the drive.
    const double smaller = std::clamp(0.97 / use, 0.25, 0.97);
    out.factor *= smaller;
    out.drive = scaled(std::move(out.drive), smaller);
  }
  return std::nullopt;
}

}  // namespace stickslip::design
