// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "static_ratio",
                  .unit = "1",
                  .meaning = "static over kinetic friction",
                  .low = 0.5,
                  .high = 3.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .neutral = 1.0,
                  .formula_uncertainty = 0.25},
    ParameterCard{.name = "stribeck_speed_m_s",
                  .unit = "m/s",
                  .meaning = "speed at which the excess has fallen to 1/e",
                  .low = 0.0001,
                  .high = 1.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.25}};
constexpr std::array<std::string_view, 3> rivals = {"dwell_strengthening", "contact_compliance",
                                                    "friction_memory"};
constexpr std::array<std::string_view, 2> references = {
    "R. Stribeck, Die wesentlichen Eigenschaften der Gleit- und Rollenlager, Zeitschrift des "
    "Vereines deutscher Ingenieure, 1902",
    "B. Armstrong-H\u00e9louvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis "
    "tools and compensation methods for the control of machines with friction, Automatica, 1994"};
constexpr std::array example = {1.3, 0.05};
constexpr Card entry = {
    .id = "stribeck",
    .relation = Relation::friction_law,
    .name = "Stribeck effect",
    .sentence = "Friction falls from a static level to a lower kinetic one as the speed grows.",
    .equation = "g(v) (1 + (static_ratio - 1) exp(-(v / stribeck_speed_m_s)^2))",
    .parameters = parameters,
    .experiment = "slow runs: long stretches below the Stribeck speed in both directions",
    .rivals = rivals,
    .formula_residual = 0.002,
    .references = references,
    .example = example,
};

class Stribeck final : public EffectOf<Stribeck> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{1.1, 0.1 * scales.velocity_m_s}, {1.1, 0.4 * scales.velocity_m_s}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction depends on the speed (Stribeck): at rest it is " + number_text(p[0]) +
           " times the kinetic level, and the excess falls to 1/e at " + number_text(p[1]) +
           " m/s.";
  }

  unsigned hooks() const override { return hook::slip_friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    using std::exp;
    const T ratio = at.slip / p[1];
    f.backbone = f.backbone * (1.0 + (p[0] - 1.0) * exp(-(ratio * ratio)));
  }
};

}  // namespace

const Effect& stribeck() {
  static const Stribeck effect;
  return effect;
}

}  // namespace stickslip::physics
