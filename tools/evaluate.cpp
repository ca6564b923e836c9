#include "tools/command.h"

namespace stickslip::tools {

void add_evaluate(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
