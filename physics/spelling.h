// SPDX-License-Identifier: Apache-2.0
// Suggestions for misspelt names.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stickslip::physics {

/// The one of `names` that `name` probably misspells; empty if none is similar enough.
std::string nearest(std::string_view name, const std::vector<std::string>& names);

}  // namespace stickslip::physics
