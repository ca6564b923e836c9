// SPDX-License-Identifier: Apache-2.0
// Random benches for hidden effects: the declared model with its priors, and the true rig with
// parameters drawn from those priors.
#pragma once

#include <array>
#include <functional>
#include <string_view>
#include <vector>

#include "physics/model.h"
#include "tools/concealment/random_source.h"
#include "tools/concealment/reference_simulator.h"

namespace stickslip::concealment {

enum class BenchKind { regular, skewed, two_well, motivational, force, imposed };
inline constexpr std::array all_bench_kinds = {BenchKind::regular,  BenchKind::skewed,
                                               BenchKind::two_well, BenchKind::motivational,
                                               BenchKind::force,    BenchKind::imposed};
std::string_view name_of(BenchKind kind);

struct Bench {
  BenchKind kind = BenchKind::regular;
  physics::Model declared;
  ReferenceRig rig;
  double sample_rate_hz = 500.0;
  /// Perturbation of each uncertain parameter by one standard deviation of its prior.
  std::vector<std::function<void(ReferenceRig&)>> prior_shifts;
};

struct BenchRequirements {
  bool lacks_friction = false;  ///< the declared model has no friction (force excitation only)
  bool relaxes = false;         ///< state-variable friction law
  bool rings = true;            ///< load cell with its resonance, if there is a load cell
  bool set_valued = false;
};
/// A bench without hidden effects.
Bench draw_bench(BenchKind kind, const BenchRequirements& requirements, RandomSource& random);

/// The excitation of another run of the same bench.
std::vector<Tone> draw_drive(BenchKind kind, const ReferenceRig& rig, RandomSource& random);

}  // namespace stickslip::concealment
