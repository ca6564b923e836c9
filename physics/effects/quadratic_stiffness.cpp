// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "k2_n_m2",
                                                 .unit = "N/m^2",
                                                 .meaning = "quadratic stiffness",
                                                 .low = -1000000.0,
                                                 .high = 1000000.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"bias_force", "cubic_stiffness"};
constexpr std::array<std::string_view, 1> depends_on = {"displacement"};
constexpr std::array<std::string_view, 1> references = {
    "A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations, Wiley, 1979"};
constexpr std::array example = {100.0};
constexpr Card entry = {
    .id = "quadratic_stiffness",
    .relation = Relation::force_balance,
    .name = "asymmetric spring",
    .sentence = "The spring is stiffer on one side than on the other.",
    .equation = "k2_n_m2 x^2 added to the restoring force",
    .parameters = parameters,
    .experiment = "amplitude steps: the mean position shifts with the square of the amplitude",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

class QuadraticStiffness final : public EffectOf<QuadraticStiffness> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The spring is asymmetric: its force contains " + number_text(p[0]) + " N/m2 times x^2.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    return p[0] * at.x * at.x;
  }
};

}  // namespace

const Effect& quadratic_stiffness() {
  static const QuadraticStiffness effect;
  return effect;
}

}  // namespace stickslip::physics
