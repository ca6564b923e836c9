#include "tools/command.h"

namespace stickslip::tools {

void add_replay(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
