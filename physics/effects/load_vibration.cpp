// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <numbers>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "share",
                  .unit = "1",
                  .meaning = "relative amplitude",
                  .low = 0.0001,
                  .high = 1.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "frequency_hz",
                  .unit = "Hz",
                  .meaning = "frequency",
                  .low = 0.05,
                  .high = 500.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.003},
    ParameterCard{.name = "phase_rad",
                  .unit = "rad",
                  .meaning = "phase at the beginning of the recording",
                  .low = -6.3,
                  .high = 6.3,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 1> rivals = {"mains_hum"};
constexpr std::array<std::string_view, 1> depends_on = {"time"};
constexpr std::array<std::string_view, 1> references = {
    "J. T. Oden and J. A. C. Martins, Models and computational methods for dynamic friction "
    "phenomena, Computer Methods in Applied Mechanics and Engineering, 1985"};
constexpr std::array example = {0.1, 20.0, 0.0};
constexpr Card entry = {
    .id = "load_vibration",
    .relation = Relation::normal_load,
    .name = "vibrating load",
    .sentence = "The normal load oscillates independently of the motion.",
    .equation = "N (1 + share sin(2 pi frequency_hz t + phase_rad))",
    .parameters = parameters,
    .experiment = "a recording of the normal load with the rig at rest",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .frequency = Frequency{.parameter = 1, .tone = true},
    .references = references,
    .example = example,
};

class LoadVibration final : public EffectOf<LoadVibration> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.normal_load && model.normal_load->law != NormalLoadLaw::measured;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<std::vector<double>> starts;
    for (const double frequency_hz : scales.frequencies_hz) {
      for (const double turn : {0.0, 0.5, 1.0, 1.5}) {
        starts.push_back({0.03, frequency_hz, turn * std::numbers::pi});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The normal load oscillates by " + number_text(100.0 * p[0]) + " % at " +
           number_text(p[1]) + " Hz.";
  }

  unsigned hooks() const override { return hook::load; }
  template <class T>
  void scale_load_of(T& load, const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    using std::sin;
    load = load * (1.0 + p[0] * sin(p[1] * (2.0 * std::numbers::pi * at.time_s) + p[2]));
  }
};

}  // namespace

const Effect& load_vibration() {
  static const LoadVibration effect;
  return effect;
}

}  // namespace stickslip::physics
