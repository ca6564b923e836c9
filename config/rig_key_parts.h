// SPDX-License-Identifier: Apache-2.0
// Parts of the table of a rig's keys.
#pragma once

#include <span>

#include "config/key_binding.h"

namespace stickslip::config {

std::span<const BoundKey<Rig>> excitation_keys();       ///< of a modulated carrier
std::span<const BoundKey<Rig>> excitation_kind_keys();  ///< of the other kinds
std::span<const BoundKey<Rig>> limit_keys();
std::span<const BoundKey<Rig>> bench_keys();

}  // namespace stickslip::config
