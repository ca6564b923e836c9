#include "tools/command.h"

namespace stickslip::tools {

void add_simulate(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
