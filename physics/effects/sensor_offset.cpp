// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "offset",
                                                 .unit = "unit of the channel",
                                                 .meaning = "reading at a true value of zero",
                                                 .low = -1000000.0,
                                                 .high = 1000000.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"bias_force", "asymmetric_friction"};
constexpr std::array example = {0.002};
constexpr Card entry = {
    .id = "sensor_offset",
    .relation = Relation::sensor,
    .name = "zero offset",
    .sentence = "The zero of one channel is off by more than declared.",
    .equation = "reading = true value + offset",
    .parameters = parameters,
    .experiment = "a recording with the rig at rest and the load taken off",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .example = example,
};

class SensorOffset final : public EffectOf<SensorOffset> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  /// The zero of a base's channel, whose acceleration acts, has no consequences.
  bool acts_on(const Place& place) const override {
    return !place.from && place.channel && *place.channel != Channel::base_displacement;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The zero of the " + channel_words(place.channel) + " is off by " +
           reading_text(p[0], place) + ".";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].offset += p[0];
    laws.any_error = true;
  }
};

}  // namespace

const Effect& sensor_offset() {
  static const SensorOffset effect;
  return effect;
}

}  // namespace stickslip::physics
