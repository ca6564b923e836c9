// SPDX-License-Identifier: Apache-2.0
#include "config/bench.h"

namespace stickslip::config {

BenchInputs inputs_of(const BenchInputs& inputs, const std::string& device) {
  BenchInputs own{};
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i] && inputs[i]->device == device) own[i] = inputs[i];
  }
  return own;
}

}  // namespace stickslip::config
