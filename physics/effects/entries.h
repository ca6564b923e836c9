// One name per file of this folder; catalogue.cpp lists them.
#pragma once

namespace stickslip::physics {

class Effect;

const Effect& dry_friction();
const Effect& friction_memory();
const Effect& stribeck();
const Effect& contact_compliance();
const Effect& load_dependent_mu();
const Effect& asymmetric_friction();
const Effect& position_dependent_mu();
const Effect& friction_drift();
const Effect& quadratic_drag();
const Effect& cubic_stiffness();
const Effect& hysteresis();
const Effect& bias_force();
const Effect& wedge_load();

}  // namespace stickslip::physics
