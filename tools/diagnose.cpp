#include "tools/command.h"

namespace stickslip::tools {

void add_diagnose(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
