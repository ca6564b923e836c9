// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& friction_over_time() {
  static const FreeForm effect({.id = "friction_over_time",
                                .of = FreeFormOf::friction,
                                .over = FreeFormOver::time,
                                .name = "friction that changes over time",
                                .sentence = "Friction changes in time in an unlisted way.",
                                .equation = "mu (1 + s(t)), s piecewise linear with eight knots",
                                .experiment = "the same run repeated"});
  return effect;
}

}  // namespace stickslip::physics
