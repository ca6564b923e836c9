// SPDX-License-Identifier: Apache-2.0
// State layout of the filter for a model.
//
// The core states evolve by themselves: rig, drive, parameters. The remaining states follow from
// the core and from their own past: friction, the sensor chains, and the sensor errors between a
// chain and its reading.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::observer {

inline constexpr int max_core = physics::max_rig_states + 8;
inline constexpr int max_states = 48;

using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_states, 1>;
using Matrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, max_states, max_states>;

/// One section of a filter chain.
struct Section {
  bool second_order = false;
  double omega = 0.0;    ///< [rad/s]
  double damping = 0.0;  ///< 2 zeta omega [rad/s]
};

/// States of a channel's sensor chain and of its sensor errors.
struct Chain {
  bool used = false;
  int first = 0;    ///< index of its first state
  int reading = 0;  ///< index of the state that the channel reads
  /// Two states for a second-order section, one for a first-order one; without filters one, the
  /// reading itself; none where that is a core state, a constant load.
  int count = 0;
  std::vector<Section> sections;

  int input = -1;       ///< state at the input of the first section; -1: not a single state
  int input_rate = -1;  ///< state that holds its rate; -1: none

  // Sensor errors from [[physics]]; their states come after all chains (sensor_error_states.h).
  double delay_s = 0.0;  ///< relative to the other channels; negative: the channel is early
  int first_delay = 0;   ///< first state of the delay sections: value and rate of each
  int delays = 0;        ///< number of delay sections
  int hum = -1;          ///< two states: hum in the reading, and the same a quarter period earlier
  double hum_rad_s = 0.0;
  double hum_amplitude = 0.0;
  int offset = -1;           ///< one state: zero offset of the reading
  double drift_per_s = 0.0;  ///< rate at which the offset drifts
  std::optional<Channel> crosstalk_from;
  double crosstalk = 0.0;  ///< share of that channel's reading

  /// Calls visit(state) for each state of this channel.
  template <class Visit>
  void for_each_state(Visit&& visit) const {
    for (int k = 0; k < count; ++k) visit(first + k);
    for (int k = 0; k < 2 * delays; ++k) visit(first_delay + k);
    for (int k = 0; hum >= 0 && k < 2; ++k) visit(hum + k);
    if (offset >= 0) visit(offset);
  }
};

inline constexpr int max_delays = 8;  ///< delay sections of a channel

/// Sparse row of the measurement matrix for a reading of a given age: output of the channel's chain
/// and delay, extrapolated back to that age, plus crosstalk, hum and offset.
struct MeasurementRow {
  std::array<int, max_states> state{};
  std::array<double, max_states> weight{};
  int count = 0;
  int dynamic_terms = 0;  ///< number of leading terms that are not hum or offset
  /// Bandwidth of the dynamic part, from which the error of the linear extrapolation is estimated;
  /// 0: no extrapolation.
  double bandwidth_rad_s = 0.0;

  /// Adds a term, or adds to the weight of an existing one.
  void add(int index, double by);
  /// Product of the first `terms` terms with `states`.
  double product(const Vector& states, int terms) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(terms); ++i) {
      sum += weight[i] * states[state[i]];
    }
    return sum;
  }
};

struct Layout {
  std::array<int, physics::max_rig_states> rig{};  ///< by physics::state; -1: absent
  int mu = -1;
  int log_rate = -1;   ///< ln gamma
  int load = -1;       ///< measured load: N; otherwise load_n; -1: known exactly
  int load_rate = -1;  ///< N', measured load only
  /// p, p', p'', lambda: base displacement, drive force or imposed motion, p''' = -lambda p'. Where
  /// the motion is imposed, p and p' are also x and v of `rig`.
  int drive = -1;
  int core = 0;  ///< number of core states

  int friction = -1;  ///< f
  int theta = -1;     ///< theta; a core state where it has memory
  std::array<Chain, channel_count> chain;
  int first_sensor_error = 0;  ///< first state of delays, hum and offsets
  int count = 0;

  const Chain& of(Channel channel) const { return chain[index_of(channel)]; }
};

/// Measurement row of a reading taken `age_s` ago, in addition to the channel's own delay; negative
/// extrapolates ahead. A reading whose rate is not a function of the states is taken as constant.
MeasurementRow measurement_row(const Layout& layout, Channel channel, double age_s);

/// Channel that measures the drive.
Channel drive_channel(const physics::Structure& structure);

/// Layout for a consistent model whose channels are read by `laws`. Where the model is not
/// supported, `reason` says why.
Layout make_layout(const physics::Model& model, const physics::Rig& rig, std::string& reason,
                   const physics::ReadingLaws<double>& laws = {});

}  // namespace stickslip::observer
