// SPDX-License-Identifier: Apache-2.0
#include "protocol/progress_callback.h"

namespace stickslip::protocol {

ProgressCallback progress_of_part(const ProgressCallback& whole, std::size_t before,
                                  std::size_t all) {
  if (!whole) return {};
  return [&whole, before, all](double share) {
    whole((static_cast<double>(before) + share) / static_cast<double>(all));
  };
}

}  // namespace stickslip::protocol
