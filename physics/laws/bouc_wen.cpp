// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr ParameterCard loop_shape_card = {
    .name = "loop_shape",
    .unit = "1",
    .meaning =
        "Ikhouane and Rodellar's sigma; 0.5: unloads along a straight line, 1 with "
        "sharpness 1: Dahl's law",
    .low = 0.5,
    .high = 5.0,
    .positive = true,
    .fixed_default = 0.5,
    .estimated = true,
    .start_sigma = 0.5};
constexpr ParameterCard sharpness_card = {
    .name = "sharpness",
    .unit = "1",
    .meaning = "exponent n; 1: yields gradually, larger: a sharper corner",
    .low = 0.5,
    .high = 20.0,
    .positive = true,
    .fixed_default = 1.0,
    .estimated = true,
    .start_sigma = 0.7};
constexpr std::array parameters = {mu_card, stiffness_card, loop_shape_card, sharpness_card};
constexpr std::array<std::string_view, 3> references = {
    "R. Bouc, Forced vibration of mechanical systems with hysteresis, 1967",
    "Y.-K. Wen, Method for random vibration of hysteretic systems, Journal of the Engineering "
    "Mechanics Division (ASCE), 1976",
    "F. Ikhouane and J. Rodellar, Systems with hysteresis: analysis, identification and control "
    "using the Bouc-Wen model, Wiley, 2007"};
constexpr std::array example = {0.8, 60.0, 0.6, 2.0};
constexpr auto includes = bristle_includes;
constexpr Card entry = {
    .id = "bouc_wen",
    .relation = Relation::friction_law,
    .name = "Bouc-Wen law",
    .sentence = "The contact yields along a smooth loop whose corner may be round or sharp.",
    .equation =
        "theta' = rho (v - loop_shape abs(v) abs(theta)^(sharpness - 1) theta + "
        "(loop_shape - 1) v abs(theta)^sharpness), rho = stiffness_n_m / (mu N)",
    .parameters = parameters,
    .experiment = "slow loops of several sizes: their corners and the way back",
    .rivals = {},
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class BoucWen final : public LawOf<BoucWen> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    return {{start.mu, 5.0 * start.knee_n_m, 0.6, 1.5},
            {start.mu, 30.0 * start.knee_n_m, 0.6, 1.5},
            {start.mu, 200.0 * start.knee_n_m, 0.6, 1.5}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction follows a loop of Bouc and Wen with mu = " + number_text(p[0]) +
           " and a stiffness before slip of " + number_text(p[1]) + " N/m.";
  }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::bristle;
    structure.loop = true;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.contact_stiffness = p[1];
    // Below a half the loop would produce energy.
    c.loop_shape = p[2] > 0.5 ? 2.0 * p[2] - 1.0 : T(0.0);
    c.loop_sharpness = p[3] > 0.5 ? p[3] : T(0.5);
  }
};

}  // namespace

const Effect& bouc_wen_law() {
  static const BoucWen effect;
  return effect;
}

}  // namespace stickslip::physics
