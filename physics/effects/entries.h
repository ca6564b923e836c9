// One name per file of this folder; catalogue.cpp lists them.
#pragma once

namespace stickslip::physics {

class Effect;

const Effect& dry_friction();
const Effect& friction_memory();
const Effect& stribeck();
const Effect& dwell_strengthening();
const Effect& contact_compliance();
const Effect& load_dependent_mu();
const Effect& asymmetric_friction();
const Effect& position_dependent_mu();
const Effect& friction_drift();
const Effect& quadratic_drag();
const Effect& cubic_stiffness();
const Effect& hysteresis();
const Effect& end_stop();
const Effect& bias_force();
const Effect& ambient_vibration();
const Effect& second_mode();
const Effect& wedge_load();
const Effect& load_cell_resonance();
const Effect& differentiator_lag();
const Effect& channel_delay();
const Effect& gain_error();
const Effect& crosstalk();
const Effect& clipping();
const Effect& mains_hum();
const Effect& sensor_drift();
const Effect& quadratic_stiffness();
const Effect& position_dependent_damping();
const Effect& contact_viscosity();
const Effect& logarithmic_friction();
const Effect& periodic_friction();
const Effect& load_curvature();
const Effect& load_vibration();
const Effect& quintic_stiffness();
const Effect& rate_and_state();
const Effect& load_history();
const Effect& bridge_nonlinearity();
const Effect& load_episode();
const Effect& friction_episode();
const Effect& force_episode();

// All in shapes.cpp.
const Effect& force_over_displacement();
const Effect& force_over_velocity();
const Effect& force_over_time();
const Effect& friction_over_displacement();
const Effect& friction_over_velocity();
const Effect& friction_over_time();
const Effect& friction_over_load();
const Effect& load_over_displacement();
const Effect& load_over_time();

}  // namespace stickslip::physics
