// SPDX-License-Identifier: Apache-2.0
// Imperfections of instruments as every laboratory has them: no missing physics, and no finding of
// a diagnosis.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/recording.h"
#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/ground_truth.h"
#include "tools/concealment/hidden_effect.h"
#include "tools/concealment/random_source.h"
#include "tools/concealment/sample_times.h"

namespace stickslip::concealment {

enum class Nuisance : std::uint8_t {
  gain,         ///< of every channel
  offset,       ///< of every channel
  cutoff,       ///< of every filter
  skew,         ///< a multiplexed converter: channels are late by parts of a sample
  colour,       ///< noise with a correlated share
  half_noise,   ///< the declared noise is half of the true one
  jitter,       ///< of the sampling times, which the file states
  clock,        ///< a sampling rate that the rounded times of the file hide
  gaps,         ///< missing rows and empty cells
  rates,        ///< a channel of an eighth of the rate
  noisy_drive,  ///< declared
};
inline constexpr std::array all_nuisances = {
    Nuisance::gain,   Nuisance::offset,     Nuisance::cutoff,     Nuisance::skew,
    Nuisance::colour, Nuisance::half_noise, Nuisance::jitter,     Nuisance::clock,
    Nuisance::gaps,   Nuisance::rates,      Nuisance::noisy_drive};

/// The name in the truth.
std::string_view name_of(Nuisance nuisance);
std::optional<Nuisance> nuisance_named(std::string_view name);

/// False for two that contradict each other: jittered times are stated, a clock's are rounded.
bool go_together(Nuisance a, Nuisance b);

struct Imperfections {
  Clock clock;
  std::optional<Channel> slow_channel;
  std::size_t slow_phase = 0;                             ///< row of its first value
  std::vector<std::pair<std::size_t, std::size_t>> gaps;  ///< first missing row, number of rows
  std::set<std::pair<std::size_t, Channel>> empty_cells;  ///< row, channel
  nlohmann::ordered_json drawn;  ///< by name of the nuisance, as in the truth
};

/// A random subset of one to four nuisances that `bench` can have.
std::vector<Nuisance> draw_nuisances(const Bench& bench, RandomSource& random);

/// Whether the bench has what the nuisance needs.
bool is_applicable(Nuisance nuisance, const Bench& bench);

/// Gives the bench's rig imperfect instruments; the declared model stays without, but for the noise
/// where the nuisance says so. `taken`: channels with hidden errors, which keep their rate.
Imperfections make_imperfect(Bench& bench, const std::vector<Nuisance>& nuisances,
                             const Sizes& sizes, const std::set<Channel>& taken,
                             RandomSource& random);

/// Empties the cells of the slow channel, and with `gaps` those of the gaps; rows of gaps are left
/// out of `recording` and, if given, of the `states` that belong to them.
void leave_out(const Imperfections& imperfections, bool gaps, protocol::Recording& recording,
               std::vector<physics::RigTruth>* states);

/// The declared model with the uncertainties of its instruments: gain 0.5 %, offset 1 % of the
/// channel, delay 0.3 samples, cut-offs 2.4 %.
physics::Model with_declared_instruments(const Bench& bench, const Sizes& sizes);

/// False for an error of a sensor that could be one of a sound instrument: at most four standard
/// deviations of those above.
bool is_beyond_tolerance(const TrueEffect& effect, const Sizes& sizes, double sample_rate_hz);

}  // namespace stickslip::concealment
