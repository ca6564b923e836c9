// A case for a blind examination: a recording in which something is hidden (or nothing), the model
// that its owner believes in, another run of the same rig, and the truth.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "physics/model.h"
#include "protocol/recording.h"
#include "tools/concealment/truth.h"

namespace stickslip::concealment {

/// What to hide. Empty: drawn at random, single effects of the catalogue mostly.
struct Order {
  enum class Kind { any, nothing, single, pair, unlisted };
  Kind kind = Kind::any;
  std::vector<std::string> ids;  ///< names of secrets to choose from; empty: all that fit `kind`
  double duration_s = 30.0;      ///< about: of the recording; the validation run is two thirds
};

struct Case {
  Truth truth;
  physics::Model believed;
  protocol::Recording recording;
  protocol::Recording validation;
};

/// Draws a case. The effect is visible: within 0.4 s it changes the readings by at least four times
/// the noise, and by 1.2 times after the declared parameters have absorbed what they can. The same
/// order, seed and name give the same case. Throws std::runtime_error where 40 rigs were drawn and
/// none showed it.
Case conceal(const Order& order, std::uint64_t seed, const std::string& name);

}  // namespace stickslip::concealment
