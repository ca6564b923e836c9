// SPDX-License-Identifier: Apache-2.0
// The project's udev rules.
#pragma once

#include <string>

#include "tools/doctor/host.h"

namespace stickslip::doctor {

constexpr const char* rules_name = "70-stickslip.rules";

/// Path of the installed rules; empty if they are not installed.
std::string rules_file(const Host& host);

/// Applies installed rules to all devices.
constexpr const char* apply_rules_command = "sudo udevadm control --reload && sudo udevadm trigger";

/// Installs the rules alone, from the checkout, and applies them.
std::string install_rules_command();

}  // namespace stickslip::doctor
