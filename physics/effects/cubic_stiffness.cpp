// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "k3_n_m3",
                                                 .unit = "N/m3",
                                                 .meaning = "cubic stiffness; positive: hardening",
                                                 .low = -1000000000.0,
                                                 .high = 1000000000.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"end_stop", "quadratic_drag"};
constexpr std::array<std::string_view, 2> references = {
    "G. Duffing, Erzwungene Schwingungen bei ver\u00e4nderlicher Eigenfrequenz und ihre technische "
    "Bedeutung, Vieweg, 1918",
    "A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations, Wiley, 1979"};
constexpr std::array example = {7000.0};
constexpr Card entry = {
    .id = "cubic_stiffness",
    .relation = Relation::force_balance,
    .name = "hardening or softening spring",
    .sentence = "The spring hardens or softens with deflection.",
    .equation = "k3_n_m3 x^3 added to the restoring force",
    .parameters = parameters,
    .experiment = "stepped amplitudes: the resonance moves with the square of the amplitude",
    .rivals = rivals,
    .formula_residual = 0.008,
    .references = references,
    .example = example,
};

class CubicStiffness final : public EffectOf<CubicStiffness> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed && !model.oscillator.two_well;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    const std::string_view way = p[0] > 0.0 ? "hardens" : "softens";
    return "The spring " + std::string(way) +
           " with deflection: a force k3 x^3 with k3 = " + number_text(p[0]) + " N/m3.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    return p[0] * at.x * at.x * at.x;
  }
};

}  // namespace

const Effect& cubic_stiffness() {
  static const CubicStiffness effect;
  return effect;
}

}  // namespace stickslip::physics
