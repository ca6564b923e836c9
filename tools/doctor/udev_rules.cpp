// SPDX-License-Identifier: Apache-2.0
#include "tools/doctor/udev_rules.h"

#include <algorithm>

namespace stickslip::doctor {

std::string rules_file(const Host& host) {
  for (const char* folder :
       {"/etc/udev/rules.d", "/run/udev/rules.d", "/usr/local/lib/udev/rules.d",
        "/usr/lib/udev/rules.d", "/lib/udev/rules.d"}) {
    const auto names = host.names_in(folder);
    if (std::find(names.begin(), names.end(), rules_name) != names.end()) {
      return std::string(folder) + "/" + rules_name;
    }
  }
  return {};
}

std::string install_rules_command() {
  return std::string("sudo install -m 644 systemd/") + rules_name + " /etc/udev/rules.d/ && " +
         apply_rules_command;
}

}  // namespace stickslip::doctor
