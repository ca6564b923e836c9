// Which states the filter has for a model, and where they stand.
//
// The core moves by itself: the rig, the drive and the parameters. The tail is what the core and
// the tail's own past make of it: friction and the memories of the sensor chains.
#pragma once

#include <Eigen/Core>
#include <array>
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

/// One section of a filter chain, as far as its memory is concerned.
struct Section {
  bool second_order = false;
  double omega = 0.0;    ///< [rad/s]
  double damping = 0.0;  ///< 2 zeta omega [rad/s]
};

/// A channel's sensor chain in the tail.
struct Chain {
  bool used = false;
  int first = 0;    ///< index of its first state
  int reading = 0;  ///< index of the state that the channel reads
  /// Two states for a second-order section, one for a first-order one; one, the reading itself,
  /// where there are no filters.
  int count = 0;
  std::vector<Section> sections;
};

/// What a reading of some age is in terms of the states: the chain's output, less what it has
/// changed by since.
struct Sight {
  std::array<int, 2> at{};
  std::array<double, 2> weight{};
  int count = 1;
  double bend_per_s = 0.0;  ///< how fast the second state is forgotten: what a straight line misses
};

/// Of a chain's reading `age_s` ago; a chain without filters is read as if it stood still.
Sight sight_of(const Chain& chain, double age_s);

struct Layout {
  std::array<int, physics::max_rig_states> rig{};  ///< by physics::state; -1: not there
  int mu = -1;
  int log_rate = -1;   ///< ln gamma
  int load = -1;       ///< N where it is measured, otherwise load_n; -1: known exactly
  int load_rate = -1;  ///< N', measured load only
  int drive = -1;      ///< p, p', p'', lambda: base displacement or drive force, p''' = -lambda p'
  int core = 0;

  int friction = -1;  ///< f
  int theta = -1;     ///< theta; in the core where it has a memory
  std::array<Chain, channel_count> chain;
  int count = 0;

  const Chain& of(Channel channel) const { return chain[index_of(channel)]; }
};

/// The channel that the drive is measured by.
Channel drive_channel(const physics::Structure& structure);

/// The layout for a sound model, or in `reason` why there is none.
Layout layout_of(const physics::Model& model, const physics::Rig& rig, std::string& reason);

}  // namespace stickslip::observer
