// SPDX-License-Identifier: Apache-2.0
// The rig as a client that designs runs for it has to know it.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "config/rig.h"

namespace stickslip::daemon {

/// Name, rate, kind of drive, limits, permitted ranges, where its frames are published, and the
/// text of its model.
nlohmann::json description_of(const config::Rig& rig);

}  // namespace stickslip::daemon
