#include "tools/command.h"

namespace stickslip::tools {

void add_convert(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
