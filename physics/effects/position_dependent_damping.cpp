// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "c1_n_s_m2",
                  .unit = "N s/m^2",
                  .meaning = "linear change of the damping with position",
                  .low = -10000.0,
                  .high = 10000.0,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "c2_n_s_m3",
                  .unit = "N s/m^3",
                  .meaning = "quadratic change of the damping with position",
                  .low = -1000000.0,
                  .high = 1000000.0,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 1> rivals = {"quadratic_drag"};
constexpr std::array<std::string_view, 2> depends_on = {"displacement", "velocity"};
constexpr std::array<std::string_view, 2> references = {
    "B. van der Pol, On relaxation-oscillations, Philosophical Magazine, 1926",
    "A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations, Wiley, 1979"};
constexpr std::array example = {0.5, 100.0};
constexpr Card entry = {
    .id = "position_dependent_damping",
    .relation = Relation::force_balance,
    .name = "position-dependent damping",
    .sentence =
        "The damping varies along the track, e.g. because the mass passes an eddy-current brake.",
    .equation = "(c1_n_s_m2 x + c2_n_s_m3 x^2) v",
    .parameters = parameters,
    .experiment = "free decays around several positions",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

class PositionDependentDamping final : public EffectOf<PositionDependentDamping> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0, 0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The damping depends on the position: its variable part is " + number_text(p[0]) +
           " x + " + number_text(p[1]) + " x^2 N s/m.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    return (p[0] + p[1] * at.x) * at.x * at.v;
  }
};

}  // namespace

const Effect& position_dependent_damping() {
  static const PositionDependentDamping effect;
  return effect;
}

}  // namespace stickslip::physics
