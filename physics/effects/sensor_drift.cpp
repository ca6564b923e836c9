// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "rate_per_s",
                  .unit = "unit of the channel per second",
                  .meaning = "initial rate",
                  .low = -1000000.0,
                  .high = 1000000.0,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "approach_s",
                  .unit = "s",
                  .meaning = "time constant of the approach to a final value; much longer than "
                             "the recording: linear drift",
                  .low = 0.01,
                  .high = 1.0e12,
                  .positive = true,
                  .fixed_default = 1.0e12,
                  .estimated = true,
                  .start_sigma = 1.0}};
constexpr std::array<std::string_view, 2> rivals = {"friction_drift", "bias_force"};
constexpr std::array example = {1.0e-4, 20.0};
constexpr Card entry = {
    .id = "sensor_drift",
    .relation = Relation::sensor,
    .name = "zero drift",
    .sentence = "The zero of one channel drifts during the recording.",
    .equation =
        "reading + rate_per_s approach_s (1 - exp(-t / approach_s)), at first reading + "
        "rate_per_s t",
    .parameters = parameters,
    .experiment = "a recording with the rig at rest, before and after the run",
    .rivals = rivals,
    .example = example,
};

class SensorDrift final : public EffectOf<SensorDrift> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override {
    return !place.from && place.channel &&
           index_of(*place.channel) <= index_of(Channel::normal_load);
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{0.0, 5.0 * scales.duration_s}, {0.0, 0.3 * scales.duration_s}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The zero of the " + channel_words(place.channel) + " drifts by " +
           reading_text(p[0], place) + " per second initially, with a time constant of " +
           number_text(p[1]) + " s.";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].drift_per_s = p[0];
    laws.of[index_of(*place.channel)].drift_time_constant_s = p[1];
    laws.any_error = true;
  }
};

}  // namespace

const Effect& sensor_drift() {
  static const SensorDrift effect;
  return effect;
}

}  // namespace stickslip::physics
