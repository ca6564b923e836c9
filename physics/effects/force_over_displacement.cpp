// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& force_over_displacement() {
  static const FreeForm effect(
      {.id = "force_over_displacement",
       .of = FreeFormOf::force,
       .over = FreeFormOver::displacement,
       .name = "force that depends on x",
       .sentence = "An unlisted force depends on the displacement.",
       .equation = "s(x) added to the restoring force, s piecewise linear with eight knots",
       .experiment = "a slow sweep over the whole range of the displacement"});
  return effect;
}

}  // namespace stickslip::physics
