// SPDX-License-Identifier: Apache-2.0
// Readings of a window with their derivatives in many directions: parameters, the rig's states at
// the beginning, knots of the drive's error. Every step of the rig is differentiated once, with
// respect to its own beginning, the drive's error and the parameters; the directions, of which
// there may be sixty, are carried along by the chain rule.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "diagnosis/window_simulation.h"

namespace stickslip::diagnosis {

/// Directions of the derivatives, in this order. A slope is the change of the number by one unit of
/// the direction.
struct Directions {
  struct Slope {
    std::size_t index = 0;
    double slope = 1.0;
  };
  std::vector<Slope> parameters;  ///< index into Rig::parameter_values
  std::vector<Slope> states;      ///< index into WindowState, below max_rig_states
  std::size_t knots = 0;          ///< the first ones, by one unit each

  std::size_t size() const { return parameters.size() + states.size() + knots; }
};

/// The parameters with their derivatives in each block of directions; one block at least.
std::vector<std::vector<physics::Dual>> seeded_blocks(std::span<const double> parameters,
                                                      const Directions& directions);

/// The motion of a rig with its derivatives.
class DerivedMotion {
 public:
  /// A block of as many directions as a Dual has; the last one is filled with zeros.
  using Slopes = physics::Dual::Derivatives;

  /// Begins with the input `now`. `parameters`: of the rig. All must outlive it.
  DerivedMotion(const WindowRun& run, const physics::Rig& rig, std::span<const double> parameters,
                const Directions& directions, const WindowState& from, const physics::Input& now);
  void advance(const WindowStep& step);

  /// With the derivatives in one block of directions.
  physics::Quantities<physics::Dual> quantities(std::size_t block) const;
  std::size_t blocks() const { return blocks_; }

 private:
  // Directions of one differentiation of a step: those of its beginning first, with the first
  // parameters, then the remaining parameters.
  struct Pass {
    physics::RigNumbers<physics::Dual> n;
    CorrectedInput<physics::Dual> input;
    std::size_t first_parameter = 0;
    std::size_t parameters = 0;
    Eigen::Index first_direction = 0;  // of its parameters
    bool of_beginning = false;
  };
  using Row = std::vector<Slopes>;  // by block of directions

  void add_passes(const WindowRun& run);
  physics::RigState<physics::Dual> begun(const Pass& pass) const;
  void carry(const Pass& pass, const DriveError::Shares& error,
             std::span<const Slopes* const> result);
  void take(const Pass& pass, const DriveError::Shares& error,
            const physics::RigState<physics::Dual>& s, const physics::Quantities<physics::Dual>& q);

  const physics::Rig& rig_;
  std::span<const double> parameters_;
  const Directions& directions_;
  const WindowState& from_;
  std::size_t blocks_;
  bool derived_counts_;  // friction, slip and load at the beginning of a step act on it
  Eigen::Index drive_direction_ = 0;
  std::vector<Pass> passes_;
  std::vector<std::size_t> state_;  // indices into RigState::s
  std::size_t carried_ = 0;         // rows that a step begins with
  physics::RigState<double> value_;
  physics::Quantities<double> read_;
  // Derivatives of the states, then of friction, slip and load where they count; and at the end of
  // a step of the quantities, too.
  std::vector<Row> beginning_, end_;
};

/// As run_window, with the derivatives of each reading: calls sink(block of directions, sample,
/// channel, reading, its rate).
template <class Sink>
void run_window_derived(const WindowRun& run, const physics::Rig& rig,
                        const physics::SensorBank& bank, std::span<const double> parameters,
                        const Directions& directions, const WindowState& from, Sink&& sink) {
  using physics::Dual;
  const auto plain = numbers_on_recording<double>(rig, parameters);
  const CorrectedInput<double> input(run, plain, rig.structure().excitation);
  DerivedMotion motion(run, rig, parameters, directions, from, input.at(run.first_input()));
  std::vector<WindowReader<Dual>> readers;
  std::vector<std::vector<Dual>> seeded = seeded_blocks(parameters, directions);
  for (std::size_t b = 0; b < motion.blocks(); ++b) {
    const auto n = numbers_on_recording<Dual>(rig, std::span<const Dual>(seeded[b]));
    readers.emplace_back(run, bank, n.reading).settle(motion.quantities(b));
  }
  const auto sink_of = [&](std::size_t b) {
    return [&sink, b](std::size_t k, std::size_t c, const Dual& reading, double rate) {
      sink(b, k, c, reading, rate);
    };
  };
  const bool whole = run_steps(
      run, input, motion,
      [&](double since_warm) {
        for (std::size_t b = 0; b < readers.size(); ++b) {
          readers[b].advance(motion.quantities(b), since_warm, sink_of(b));
        }
      },
      [&] { return readers.front().complete(); });
  if (whole) return;
  for (std::size_t b = 0; b < readers.size(); ++b) readers[b].finish(sink_of(b));
}

}  // namespace stickslip::diagnosis
