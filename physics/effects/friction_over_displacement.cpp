// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& friction_over_displacement() {
  static const FreeForm effect({.id = "friction_over_displacement",
                                .of = FreeFormOf::friction,
                                .over = FreeFormOver::displacement,
                                .name = "friction that depends on x",
                                .sentence = "Friction depends on the position in an unlisted way.",
                                .equation = "mu (1 + s(x)), s piecewise linear with eight knots",
                                .experiment = "a slow sweep over the whole track"});
  return effect;
}

}  // namespace stickslip::physics
