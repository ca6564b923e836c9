// SPDX-License-Identifier: Apache-2.0
// A sensor effect that is not part of Stickslip, with a characteristic of its own.
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "cubic",
                  .unit = "1/square of the channel's unit",
                  .meaning = "relative change of the gain with the square of the reading",
                  .low = -1.0e6,
                  .high = 1.0e6,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 3> depends_on = {"displacement", "velocity",
                                                        "friction_force"};
constexpr std::array example = {400.0};
constexpr Card entry = {
    .id = "cubic_characteristic",
    .relation = Relation::sensor,
    .name = "cubic characteristic",
    .sentence = "The gain of one channel changes with the square of its reading.",
    .equation = "reading = r (1 + cubic r^2)",
    .parameters = parameters,
    .experiment = "a calibration of this channel at five values on both sides of zero",
    .rivals = {},
    .depends_on = depends_on,
    .tier = Tier::formula,
    .example = example,
};

class CubicCharacteristic final : public EffectOf<CubicCharacteristic> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override {
    return !place.from && place.channel && *place.channel <= Channel::friction_force;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The gain of the channel changes by " + number_text(100.0 * p[0]) +
           " % times the square of its reading.";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void distort_of(T& reading, const T* p) const {
    reading = reading * (1.0 + p[0] * reading * reading);
  }
};

}  // namespace

const Effect& cubic_characteristic() {
  static const CubicCharacteristic effect;
  return effect;
}

}  // namespace stickslip::physics
