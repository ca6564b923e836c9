// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& load_over_time() {
  static const FreeForm effect({.id = "load_over_time",
                                .of = FreeFormOf::load,
                                .over = FreeFormOver::time,
                                .name = "load that changes over time",
                                .sentence = "The normal load changes in time in an unlisted way.",
                                .equation = "N (1 + s(t)), s piecewise linear with eight knots",
                                .experiment = "the same run repeated"});
  return effect;
}

}  // namespace stickslip::physics
