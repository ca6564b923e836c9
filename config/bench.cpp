// SPDX-License-Identifier: Apache-2.0
#include "config/bench.h"

namespace stickslip::config {

const LabjackOutput* output_of(const Bench& bench) {
  switch (bench.board) {
    case BoardKind::labjack_u6:
      return &bench.labjack_u6;
    case BoardKind::labjack_t7:
      return &bench.labjack_t7;
    case BoardKind::usb_1208fs_plus:
      break;
  }
  return nullptr;
}

BenchInputs inputs_of(const BenchInputs& inputs, const std::string& device) {
  BenchInputs own{};
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i] && inputs[i]->device == device) own[i] = inputs[i];
  }
  return own;
}

}  // namespace stickslip::config
