// SPDX-License-Identifier: Apache-2.0
// Consistency of a model with itself and with the catalogue of effects.
#pragma once

#include <string>
#include <vector>

#include "physics/model.h"

namespace stickslip::physics {

/// A contradiction of a model to itself or to the catalogue. `path` is that in the model file (of a
/// table, or of a missing key), so that a loader can add line and column.
struct Inconsistency {
  std::string path;
  std::string message;
};

/// Empty for a valid model.
std::vector<Inconsistency> inconsistencies_of(const Model& model);

}  // namespace stickslip::physics
