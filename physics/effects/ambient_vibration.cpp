// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <numbers>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

// Share of the second harmonic in the amplitude: machines shake with harmonics.
constexpr ParameterCard second_harmonic(std::string_view name, std::string_view meaning) {
  return {.name = name,
          .unit = "1",
          .meaning = meaning,
          .low = -1.0,
          .high = 1.0,
          .fixed_default = 0.0,
          .estimated = true};
}

constexpr std::array parameters = {
    ParameterCard{.name = "frequency_hz",
                  .unit = "Hz",
                  .meaning = "frequency of the force",
                  .low = 0.05,
                  .high = 200.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.003},
    ParameterCard{.name = "amplitude_n",
                  .unit = "N",
                  .meaning = "its amplitude",
                  .low = 1e-06,
                  .high = 100.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "phase_rad",
                  .unit = "rad",
                  .meaning = "its phase at the beginning of the recording",
                  .low = -6.3,
                  .high = 6.3,
                  .positive = false,
                  .fixed_default = std::nullopt},
    second_harmonic("second_sin", "second harmonic in phase, relative to the amplitude"),
    second_harmonic("second_cos", "second harmonic in quadrature, relative to the amplitude")};
constexpr std::array<std::string_view, 2> rivals = {"second_mode", "mains_hum"};
constexpr std::array example = {7.0, 0.02, 0.0, 0.0, 0.0};
constexpr Card entry = {
    .id = "ambient_vibration",
    .relation = Relation::force_balance,
    .name = "ambient vibration",
    .sentence =
        "A periodic force that no sensor measures acts on the mass, as from a machine nearby or "
        "the floor.",
    .equation =
        "amplitude_n (sin(p) + second_sin sin(2 p) + second_cos cos(2 p)) on the mass, with "
        "p = 2 pi frequency_hz t + phase_rad",
    .parameters = parameters,
    .experiment = "a run with the shaker off: any remaining motion is ambient",
    .rivals = rivals,
    .strength = 1,
    .frequency = Frequency{.parameter = 0, .tone = true},
    .example = example,
};

class AmbientVibration final : public EffectOf<AmbientVibration> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<std::vector<double>> starts;
    for (const double frequency_hz : scales.frequencies_hz) {
      for (const double phase : {0.0, 0.5, 1.0, 1.5}) {
        starts.push_back({frequency_hz, 0.03 * scales.force_n, phase * std::numbers::pi});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    const double second = std::hypot(p[3], p[4]);
    return "A force of " + number_text(p[1]) + " N at " + number_text(p[0]) + " Hz" +
           (second > 0.02 ? ", with a second harmonic of " + number_text(100.0 * second) + " %,"
                          : "") +
           " that no sensor measures acts on the mass.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    using std::cos;
    using std::sin;
    const T phase = p[0] * (2.0 * std::numbers::pi * at.time_s) + p[2];
    return -(p[1] * (sin(phase) + p[3] * sin(phase * 2.0) + p[4] * cos(phase * 2.0)));
  }
};

}  // namespace

const Effect& ambient_vibration() {
  static const AmbientVibration effect;
  return effect;
}

}  // namespace stickslip::physics
