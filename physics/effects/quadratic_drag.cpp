// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "drag_n_s2_m2",
                                                 .unit = "N s2/m2",
                                                 .meaning = "drag at unit speed",
                                                 .low = 0.0,
                                                 .high = 1000.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.05}};
constexpr std::array<std::string_view, 2> rivals = {"dry_friction", "cubic_stiffness"};
constexpr std::array<std::string_view, 1> references = {
    "A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations, Wiley, 1979"};
constexpr std::array example = {0.1};
constexpr Card entry = {
    .id = "quadratic_drag",
    .relation = Relation::force_balance,
    .name = "quadratic drag",
    .sentence = "A drag grows with the square of the speed, as from air or a fluid.",
    .equation = "drag_n_s2_m2 v abs(v) added to the forces against the motion",
    .parameters = parameters,
    .experiment = "a free decay from a large amplitude, or the same drive at two amplitudes",
    .rivals = rivals,
    .formula_residual = 0.009,
    .references = references,
    .example = example,
};

class QuadraticDrag final : public EffectOf<QuadraticDrag> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "A drag that grows with the square of the speed acts on the mass: " + number_text(p[0]) +
           " N at 1 m/s.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    using std::abs;
    return p[0] * at.v * abs(at.v);
  }
};

}  // namespace

const Effect& quadratic_drag() {
  static const QuadraticDrag effect;
  return effect;
}

}  // namespace stickslip::physics
