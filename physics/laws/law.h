// SPDX-License-Identifier: Apache-2.0
// Laws of friction by name. Each is one file: f = mu N theta with everything that is known of the
// law, as an effect that brings friction to a model without any.
#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "physics/effect.h"

namespace stickslip::physics {

inline constexpr ParameterCard mu_card = {
    .name = "mu",
    .unit = "1",
    .meaning = "coefficient of friction in sliding; in N without a normal load",
    .low = 0.001,
    .high = 10.0,
    .positive = true,
    .fixed_default = std::nullopt};
inline constexpr ParameterCard mu_static_card = {
    .name = "mu_static",
    .unit = "1",
    .meaning = "coefficient at the lowest speeds, which falls to mu; in N without a normal load",
    .low = 0.001,
    .high = 10.0,
    .positive = true,
    .fixed_default = std::nullopt};
inline constexpr ParameterCard stribeck_speed_card = {
    .name = "stribeck_speed_m_s",
    .unit = "m/s",
    .meaning = "speed at which the excess over mu has fallen to 1/e",
    .low = 0.0001,
    .high = 1.0,
    .positive = true,
    .fixed_default = std::nullopt};
inline constexpr ParameterCard transition_speed_card = {
    .name = "transition_speed_m_s",
    .unit = "m/s",
    .meaning = "speed over which g(v) = tanh(v / transition_speed_m_s) changes sign; 0: set-valued",
    .low = 1e-06,
    .high = 0.1,
    .positive = true,
    .fixed_default = 0.0,
    .estimated = true,
    // Not identifiable below about a hundredth of the rms speed, as in dry friction.
    .start_sigma = 0.7};
inline constexpr ParameterCard stiffness_card = {
    .name = "stiffness_n_m",
    .unit = "N/m",
    .meaning = "tangential stiffness of the contact before it slips",
    .low = 1.0,
    .high = 1000000.0,
    .positive = true,
    .fixed_default = std::nullopt};
inline constexpr ParameterCard viscosity_card = {
    .name = "viscosity_n_s_m",
    .unit = "N s/m",
    .meaning = "viscous friction of the contact, independent of the load",
    .low = 1.0e-6,
    .high = 100.0,
    .positive = true,
    .fixed_default = 0.0,
    .estimated = true,
    // A small one is not seen: the estimate would run away to nothing.
    .start_sigma = 2.0};
inline constexpr ParameterCard yield_spread_card = {
    .name = "yield_spread",
    .unit = "1",
    .meaning = "half width of the band of the elements' slip forces over their mean; 0: all alike",
    .low = 0.0,
    .high = 1.0,
    .positive = false,
    .fixed_default = std::nullopt,
    .start_sigma = 0.3};  // without it an estimate would leave the range, where nothing holds it

/// The effects that a bristle in the contact has in it or takes the place of.
inline constexpr std::array<std::string_view, 2> bristle_includes = {"contact_compliance",
                                                                     "friction_memory"};
inline constexpr std::array<std::string_view, 4> bristle_and_stribeck_include = {
    "contact_compliance", "friction_memory", "stribeck", "contact_viscosity"};

/// Where estimates begin.
struct LawStart {
  double mu = 0.0;
  double knee_n_m = 0.0;  ///< stiffness with which the contact just slips
  double viscosity_n_s_m = 0.0;
  double transition_speed_m_s = 0.0;
  explicit LawStart(const Scales& scales) {
    const double force_n = scales.friction_n > 0.0 ? scales.friction_n : 0.05 * scales.force_n;
    mu = force_n / std::max(scales.mean_load_n, 1.0e-9);
    knee_n_m = force_n / scales.displacement_m;
    viscosity_n_s_m = 0.02 * force_n / scales.velocity_m_s;
    transition_speed_m_s = scales.transition_speed_m_s > 0.0 ? scales.transition_speed_m_s
                                                             : 0.02 * scales.velocity_m_s;
  }
};

/// 1 + (mu_static / mu - 1) exp(-(v / speed)^2), Stribeck's curve over mu.
template <class T>
T stribeck_factor(const T& slip, const T& mu, const T& mu_static, const T& speed) {
  using std::exp;
  const T ratio = slip / speed;
  return 1.0 + (mu_static / mu - 1.0) * exp(-(ratio * ratio));
}

/// The common part of all laws: a model that lacks one has no friction.
template <class Derived>
class LawOf : public EffectOf<Derived> {
 public:
  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law == FrictionLaw::none;
  }
  void amend(Model& model) const override { model.friction.law = FrictionLaw::coulomb; }
  unsigned hooks() const override { return hook::coefficients; }
  void set_structure(Structure& structure) const override { structure.friction = true; }
};

}  // namespace stickslip::physics
