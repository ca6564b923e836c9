// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "exponent",
                  .unit = "1",
                  .meaning = "exponent of the load; -1/3 for an elastic sphere",
                  .low = -1.0,
                  .high = 1.0,
                  .positive = false,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.05},
    ParameterCard{.name = "reference_load_n",
                  .unit = "N",
                  .meaning = "N0, the mean load of the recording",
                  .low = 0.0001,
                  .high = 1000.0,
                  .positive = true,
                  .fixed_default = 1.0}};
constexpr std::array<std::string_view, 2> rivals = {"position_dependent_mu", "wedge_load"};
constexpr std::array<std::string_view, 2> references = {
    "F. P. Bowden and D. Tabor, The Friction and Lubrication of Solids, Oxford, 1950",
    "J. F. Archard, Elastic deformation and the laws of friction, Proceedings of the Royal Society "
    "A, 1957"};
constexpr std::array example = {-0.3, 0.15};
constexpr Card entry = {
    .id = "load_dependent_mu",
    .relation = Relation::friction_law,
    .name = "load-dependent coefficient",
    .sentence = "The coefficient of friction changes with the normal load.",
    .equation = "mu = mu0 (N / N0)^exponent, N0 the mean load",
    .parameters = parameters,
    .experiment = "the same run at two normal loads, or with a second plate angle",
    .rivals = rivals,
    .formula_residual = 0.007,
    .references = references,
    .example = example,
    .shows_by_load = true,
};

class LoadDependentMu final : public EffectOf<LoadDependentMu> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none && model.normal_load.has_value();
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::vector<double> fixed(const Scales& scales) const override { return {scales.mean_load_n}; }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The coefficient of friction depends on the normal load: it varies as the load to the "
           "power " +
           number_text(p[0]) + ".";
  }

  unsigned hooks() const override { return hook::friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    using std::pow;
    // Near loss of contact the factor would diverge, while f = mu N vanishes.
    const T ratio = at.load / p[1];
    if (ratio > 1.0e-3) f.mu = f.mu * pow(ratio, p[0]);
  }
};

}  // namespace

const Effect& load_dependent_mu() {
  static const LoadDependentMu effect;
  return effect;
}

}  // namespace stickslip::physics
