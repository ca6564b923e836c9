// SPDX-License-Identifier: Apache-2.0
#include "physics/declared_value.h"

#include <array>

#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "value",
                                                 .unit = "unit of the number",
                                                 .meaning = "what the recording asks for",
                                                 .low = -1.0e12,
                                                 .high = 1.0e12,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.0}};
constexpr std::array<std::string_view, 1> rivals = {"gain_error"};
constexpr Card entry = {
    .id = "declared_value",
    .relation = Relation::force_balance,
    .name = "contradicted number of the model",
    .sentence =
        "A number that the model states, exactly or with a small standard deviation, is "
        "contradicted by the recording.",
    .equation = "the declared equations with another value of this number",
    .parameters = parameters,
    .experiment =
        "a measurement of this number by itself, such as weighing the mass or a free "
        "decay without friction",
    .rivals = rivals,
    .strength = std::nullopt,
};

// The number itself is changed, by its path: as a term this effect does not exist.
class DeclaredValue final : public EffectOf<DeclaredValue> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return false; }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override { return {}; }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "A number of the model is " + number_text(p[0]) + ".";
  }
  unsigned hooks() const override { return 0; }
};

}  // namespace

const Effect& declared_value() {
  static const DeclaredValue effect;
  return effect;
}

}  // namespace stickslip::physics
