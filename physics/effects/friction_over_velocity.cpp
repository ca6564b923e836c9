// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& friction_over_velocity() {
  static const FreeForm effect(
      {.id = "friction_over_velocity",
       .of = FreeFormOf::friction,
       .over = FreeFormOver::velocity,
       .name = "friction that depends on v",
       .sentence = "Friction depends on the slip velocity in an unlisted way.",
       .equation = "mu (1 + s(v)), s piecewise linear with eight knots",
       .experiment = "a wide range of slip speeds in both directions"});
  return effect;
}

}  // namespace stickslip::physics
