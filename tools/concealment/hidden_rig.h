// SPDX-License-Identifier: Apache-2.0
// A simulated rig whose physics is concealed: the model that is believed, and the truth as a model
// that a simulated device integrates.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "physics/model.h"
#include "tools/concealment/concealment.h"

namespace stickslip::concealment {

struct HiddenRig {
  GroundTruth truth;
  physics::Model declared;
  physics::Model actual;
  std::uint8_t channels = 0;  ///< bits of those that the case records: the rig has no others
};

/// The rig of a case. Nothing where its motion is imposed, or where its physics is not of the
/// catalogue with all its parameters.
std::optional<HiddenRig> rig_of(const Case& made);

/// A rig drawn as a case is; the same request, seed and name give the same rig. Throws Failure if
/// none of 40 cases is one.
HiddenRig conceal_rig(const CaseRequest& request, std::uint64_t seed, const std::string& name);

/// The configuration of a daemon for it, with limits and a drive within them. `truth_file`: of the
/// actual model, as the configuration is to name it.
std::string rig_text(const HiddenRig& rig, const std::string& truth_file);

}  // namespace stickslip::concealment
