#include "tools/command.h"

namespace stickslip::tools {

void add_spy(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
