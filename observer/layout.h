// Which states the filter has for a model, and where they stand.
//
// The core moves by itself: the rig, the drive and the parameters. The tail is what the core and
// the tail's own past make of it: friction, the memories of the sensor chains, and what is
// between those and the readings.
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

  int input = -1;       ///< the state that goes into the first section; -1: no single one does
  int input_rate = -1;  ///< the state that is its rate; -1: none is

  // What [[physics]] says of the channel. The states stand behind all chains (reading_states.h).
  double delay_s = 0.0;  ///< how much later than the others it is read; less than 0: earlier
  int first_delay = 0;   ///< a late one's delay sections: two states each, value and rate
  int delays = 0;
  int hum = -1;  ///< two states: the hum in the reading, and a quarter of its period before
  double hum_rad_s = 0.0;
  double hum_size = 0.0;
  int offset = -1;  ///< one state: how far the reading's zero has wandered
  double offset_per_s = 0.0;
  std::optional<Channel> leak_from;
  double leak = 0.0;  ///< of what that channel would read

  /// Calls visit(state) for those that belong to the channel alone.
  template <class Visit>
  void each_own_state(Visit&& visit) const {
    for (int k = 0; k < count; ++k) visit(first + k);
    for (int k = 0; k < 2 * delays; ++k) visit(first_delay + k);
    for (int k = 0; hum >= 0 && k < 2; ++k) visit(hum + k);
    if (offset >= 0) visit(offset);
  }
};

inline constexpr int max_delays = 8;  ///< sections of a channel

/// What a reading of some age is in terms of the states: what its chain and its delay deliver, less
/// what that has changed by since, what leaks into it, its hum and its offset.
struct Sight {
  std::array<int, max_states> at{};
  std::array<double, max_states> weight{};
  int count = 0;
  int moving = 0;  ///< how many of them, the first ones, are not hum or offset
  /// How fast what moves turns; a straight line back to its age misses that. 0: none is drawn.
  double bend_per_s = 0.0;

  /// One state more, or more of it.
  void see(int state, double by);
  /// What the first `terms` make of these states.
  double of(const Vector& states, int terms) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(terms); ++i) {
      sum += weight[i] * states[at[i]];
    }
    return sum;
  }
};

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
  int behind_chains = 0;  ///< the first state of delays, hum and offsets
  int count = 0;

  const Chain& of(Channel channel) const { return chain[index_of(channel)]; }
};

/// Of a reading `age_s` ago, beside the channel's own delay; less than 0 looks ahead. A reading
/// whose rate no state tells is taken as if it stood still.
Sight sight_of(const Layout& layout, Channel channel, double age_s);

/// The channel that the drive is measured by.
Channel drive_channel(const physics::Structure& structure);

/// The layout for a sound model whose channels are read by `laws`, or in `reason` why there is
/// none.
Layout layout_of(const physics::Model& model, const physics::Rig& rig, std::string& reason,
                 const physics::ReadingLaws<double>& laws = {});

}  // namespace stickslip::observer
