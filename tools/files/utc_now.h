// SPDX-License-Identifier: Apache-2.0
// The date that a file of results states.
#pragma once

#include <string>

namespace stickslip::files {

/// The current time, ISO 8601: "2026-11-22T14:03:00Z".
std::string utc_now();

}  // namespace stickslip::files
