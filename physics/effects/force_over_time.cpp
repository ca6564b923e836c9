// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

namespace stickslip::physics {

const Effect& force_over_time() {
  static const FreeForm effect(
      {.id = "force_over_time",
       .of = FreeFormOf::force,
       .over = FreeFormOver::time,
       .name = "force that changes in time",
       .sentence = "An unlisted force changes during the recording.",
       .equation = "s(t) added to the restoring force, s piecewise linear with eight knots",
       .experiment = "the same run repeated"});
  return effect;
}

}  // namespace stickslip::physics
