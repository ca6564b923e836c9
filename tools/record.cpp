#include "tools/command.h"

namespace stickslip::tools {

void add_record(CLI::App& /*app*/, Action& /*action*/) {}

}  // namespace stickslip::tools
