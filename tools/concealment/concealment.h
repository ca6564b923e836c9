// A case for a blind examination: a recording with or without hidden effects, the declared model, a
// second run of the same rig for validation, and the truth.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/recording.h"
#include "tools/concealment/ground_truth.h"

namespace stickslip::concealment {

/// The effects to hide; by default drawn at random, mostly single effects of the catalogue.
struct CaseRequest {
  enum class Kind { any, nothing, single, pair, unlisted };
  Kind kind = Kind::any;
  std::vector<std::string> ids;  ///< effects to choose from; empty: all of `kind`
  double duration_s = 30.0;      ///< minimum; at most 30 % more, the validation run two thirds
};

struct Case {
  GroundTruth truth;
  physics::Model declared;
  protocol::Recording recording;
  std::vector<physics::RigTruth> states;  ///< true states at the frames of `recording`
  protocol::Recording validation;
};

/// Every hidden effect is visible: within 0.4 s it changes the readings by at least four times the
/// noise, and by 1.2 times after calibration of the declared parameters. The same request, seed and
/// name give the same case. Throws Failure if no effect is visible on 40 benches.
Case conceal(const CaseRequest& request, std::uint64_t seed, const std::string& name);

}  // namespace stickslip::concealment
