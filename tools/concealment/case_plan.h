// SPDX-License-Identifier: Apache-2.0
// The request for a case, and the plan drawn for it: its effects and the kind of bench.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/hidden_effect.h"
#include "tools/concealment/imperfect_instruments.h"
#include "tools/concealment/random_source.h"

namespace stickslip::concealment {

/// Limits of the visibility of an effect: RMS change of the readings within 0.4 s over the noise.
struct SnrRange {
  double low = 0.0;
  double high = 0.0;
};

/// The effects to hide; by default drawn at random, mostly single effects of the catalogue.
struct CaseRequest {
  enum class Kind { any, nothing, single, pair, triple, unlisted };
  Kind kind = Kind::any;
  std::vector<std::string> ids;  ///< effects to choose from; empty: all of `kind`
  double duration_s = 30.0;      ///< minimum; at most 30 % more, the validation run two thirds
  std::optional<SnrRange> snr;   ///< of every hidden effect; absent: easily visible
  bool imperfect_instruments = false;
  std::vector<Nuisance> nuisances;  ///< of imperfect instruments; empty: drawn
};

struct Plan {
  std::string kind;
  std::vector<const HiddenEffect*> effects;
  BenchKind bench = BenchKind::regular;
  BenchRequirements requirements;
};

/// A plan for one bench. A pair may have one effect only, where no other goes with it; of a triple
/// without three the plan is empty.
std::optional<Plan> draw_plan(const CaseRequest& request, RandomSource& random);

}  // namespace stickslip::concealment
