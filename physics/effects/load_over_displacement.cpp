// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& load_over_displacement() {
  static const FreeForm effect(
      {.id = "load_over_displacement",
       .of = FreeFormOf::load,
       .over = FreeFormOver::displacement,
       .name = "load that depends on x",
       .sentence = "The normal load depends on the displacement in an unlisted way.",
       .equation = "N (1 + s(x)), s piecewise linear with eight knots",
       .experiment = "a slow sweep over the whole track with the normal-load bridge recorded"});
  return effect;
}

}  // namespace stickslip::physics
