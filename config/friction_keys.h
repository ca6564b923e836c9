// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "config/key_binding.h"
#include "physics/model.h"

namespace stickslip::config {

/// The keys of [friction] of a model file. The law becomes a term (physics/friction_laws.h), also
/// one that physics::settle_law then makes part of Model::friction.
std::span<const BoundKey<physics::Model>> friction_keys();

}  // namespace stickslip::config
