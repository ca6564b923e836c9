// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "force_n",
                                                 .unit = "N",
                                                 .meaning = "the force",
                                                 .low = -1000.0,
                                                 .high = 1000.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"asymmetric_friction", "sensor_drift"};
constexpr std::array example = {0.05};
constexpr Card entry = {
    .id = "bias_force",
    .relation = Relation::force_balance,
    .name = "constant force",
    .sentence = "A constant force acts on the mass, as from a tilt, a cable or a magnet.",
    .equation = "force_n, a constant force on the mass, positive towards +x",
    .parameters = parameters,
    .experiment = "the rig at rest without friction, mounted both ways round",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .example = example,
};

class BiasForce final : public EffectOf<BiasForce> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "A constant force of " + number_text(p[0]) +
           " N acts on the mass (tilt, cable, magnet).";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& /*at*/, const T* p, const T* /*s*/) const {
    return -p[0];
  }
};

}  // namespace

const Effect& bias_force() {
  static const BiasForce effect;
  return effect;
}

}  // namespace stickslip::physics
