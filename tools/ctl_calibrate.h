// `stickslip ctl calibrate`: the talk with a person, with readings from a running daemon.
#pragma once

#include <memory>
#include <string>

#include "tools/command.h"

namespace stickslip::tools {

/// `socket`: the option of the command around it, as it will be once the line is read.
void add_ctl_calibrate(CLI::App& ctl, std::shared_ptr<const std::string> socket, Action& action);

}  // namespace stickslip::tools
