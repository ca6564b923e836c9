// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "slope_per_m",
                                                 .unit = "1/m",
                                                 .meaning = "relative change per metre",
                                                 .low = -100.0,
                                                 .high = 100.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 3> rivals = {"load_dependent_mu", "wedge_load",
                                                    "asymmetric_friction"};
constexpr std::array<std::string_view, 1> references = {
    "B. Armstrong-H\u00e9louvry, Control of Machines with Friction, Kluwer, 1991"};
constexpr std::array example = {5.0};
constexpr Card entry = {
    .id = "position_dependent_mu",
    .relation = Relation::friction_law,
    .name = "position-dependent coefficient",
    .sentence = "The coefficient of friction changes along the track.",
    .equation = "mu (1 + slope_per_m x)",
    .parameters = parameters,
    .experiment = "the same run at another normal load and another position on the track",
    .rivals = rivals,
    .references = references,
    .example = example,
};

class PositionDependentMu final : public EffectOf<PositionDependentMu> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The coefficient of friction changes along the track by " + number_text(0.1 * p[0]) +
           " % per millimetre.";
  }

  unsigned hooks() const override { return hook::friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    const T factor = 1.0 + p[0] * at.x;
    f.mu = f.mu * (factor > 0.0 ? factor : T(0.0));
  }
};

}  // namespace

const Effect& position_dependent_mu() {
  static const PositionDependentMu effect;
  return effect;
}

}  // namespace stickslip::physics
