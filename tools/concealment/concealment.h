// SPDX-License-Identifier: Apache-2.0
// A case for a blind examination: a recording with or without hidden effects, the declared model, a
// second run of the same rig for validation, and the truth.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/recording.h"
#include "tools/concealment/case_plan.h"
#include "tools/concealment/ground_truth.h"

namespace stickslip::concealment {

struct Case {
  GroundTruth truth;
  physics::Model declared;
  /// The same with the uncertainties of the instruments, where those are imperfect.
  std::optional<physics::Model> with_instruments;
  protocol::Recording recording;
  std::vector<physics::RigTruth> states;  ///< true states at the frames of `recording`
  protocol::Recording validation;
};

/// Every hidden effect is visible: within 0.4 s it changes the readings by at least four times the
/// noise, and by 1.2 times after calibration of the declared parameters; with `request.snr` by that
/// much, and by 0.3 of its lower limit after calibration. The same request, seed and name give the
/// same case. Throws Failure if none of 40 benches fulfils the request.
Case conceal(const CaseRequest& request, std::uint64_t seed, const std::string& name);

}  // namespace stickslip::concealment
