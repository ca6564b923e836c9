#include "tools/command.h"

namespace stickslip::tools {

void add_check(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
