// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "asymmetry",
                                                 .unit = "1",
                                                 .meaning = "half the relative difference",
                                                 .low = -0.9,
                                                 .high = 0.9,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.075}};
constexpr std::array<std::string_view, 2> rivals = {"bias_force", "position_dependent_mu"};
constexpr std::array<std::string_view, 1> references = {
    "B. Armstrong-H\u00e9louvry, Control of Machines with Friction, Kluwer, 1991"};
constexpr std::array example = {0.1};
constexpr Card entry = {
    .id = "asymmetric_friction",
    .relation = Relation::friction_law,
    .name = "direction-dependent friction",
    .sentence = "Friction differs between the two directions of sliding.",
    .equation = "mu (1 + asymmetry) for v > 0, mu (1 - asymmetry) for v < 0",
    .parameters = parameters,
    .experiment =
        "the rig turned by 180 degrees: an asymmetry of the contact turns with it, a bias force "
        "does "
        "not",
    .rivals = rivals,
    .formula_residual = 0.04,
    .references = references,
    .example = example,
};

class AsymmetricFriction final : public EffectOf<AsymmetricFriction> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction depends on the direction of sliding: " + number_text(100.0 * std::abs(p[0])) +
           (p[0] > 0.0 ? " % above its mean for v > 0 and as much below it for v < 0."
                       : " % above its mean for v < 0 and as much below it for v > 0.");
  }

  unsigned hooks() const override { return hook::slip_friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    f.mu = f.mu * (at.slip > 0.0 ? 1.0 + p[0] : (at.slip < 0.0 ? 1.0 - p[0] : T(1.0)));
  }
};

}  // namespace

const Effect& asymmetric_friction() {
  static const AsymmetricFriction effect;
  return effect;
}

}  // namespace stickslip::physics
