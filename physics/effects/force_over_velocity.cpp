// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& force_over_velocity() {
  static const FreeForm effect(
      {.id = "force_over_velocity",
       .of = FreeFormOf::force,
       .over = FreeFormOver::velocity,
       .name = "force that depends on v",
       .sentence = "An unlisted force depends on the velocity.",
       .equation = "s(v) added to the restoring force, s piecewise linear with eight knots",
       .experiment = "free decays from several amplitudes"});
  return effect;
}

}  // namespace stickslip::physics
