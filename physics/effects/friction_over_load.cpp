// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& friction_over_load() {
  static const FreeForm effect(
      {.id = "friction_over_load",
       .of = FreeFormOf::friction,
       .over = FreeFormOver::load,
       .name = "friction that depends on N",
       .sentence = "The coefficient of friction depends on the load in an unlisted way.",
       .equation = "mu (1 + s(N)), s piecewise linear with eight knots",
       .experiment = "the same run at another dead weight"});
  return effect;
}

}  // namespace stickslip::physics
