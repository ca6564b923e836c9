// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <numbers>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "frequency_hz",
                  .unit = "Hz",
                  .meaning = "frequency of the mode",
                  .low = 5.0,
                  .high = 500.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.003},
    ParameterCard{.name = "friction_share_per_kg",
                  .unit = "1/kg",
                  .meaning = "acceleration of the mode per newton of friction",
                  .low = -1000.0,
                  .high = 1000.0,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "base_share",
                  .unit = "1",
                  .meaning = "acceleration of the mode over that of the base",
                  .low = -10.0,
                  .high = 10.0,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "damping_ratio",
                  .unit = "1",
                  .meaning = "damping ratio of the mode",
                  .low = 0.001,
                  .high = 0.3,
                  .positive = true,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 3> rivals = {"load_cell_resonance", "ambient_vibration",
                                                    "crosstalk"};
constexpr std::array example = {37.0, 30.0, 0.5, 0.01};
constexpr Card entry = {
    .id = "second_mode",
    .relation = Relation::force_balance,
    .name = "second mode of the beam",
    .sentence =
        "The beam has a second mode that the displacement gauge measures in addition to the mass's "
        "motion.",
    .equation =
        "the displacement gauge reads x + q, q'' + 2 damping_ratio w q' + w^2 q = "
        "-friction_share_per_kg f - base_share "
        "b'', w = 2 pi frequency_hz",
    .parameters = parameters,
    .experiment = "a tap on the beam with the contact lifted",
    .rivals = rivals,
    .strength = 1,
    .frequency = Frequency{.parameter = 0, .spectral_mark = "bending mode"},
    .example = example,
};

class SecondMode final : public EffectOf<SecondMode> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    // Without a base's motion and without friction nothing would excite the mode.
    return model.oscillator.excitation == Excitation::base ||
           (model.oscillator.excitation == Excitation::force &&
            model.friction.law != FrictionLaw::none);
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<std::vector<double>> starts;
    for (const double frequency_hz : scales.frequencies_hz) {
      starts.push_back({frequency_hz, 0.0, 0.0, 0.01});
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The displacement gauge also measures a mode of the beam at " + number_text(p[0]) +
           " Hz, with a damping ratio of " + number_text(p[3]) +
           ", which friction and the base excite.";
  }

  unsigned hooks() const override { return hook::measured_motion; }
  int state_count() const override { return 2; }
  StateSize state_size(int index, std::span<const double> p, const Scales& scales) const override {
    const double size = 0.1 * scales.displacement_m;
    return {index == 0 ? size : 2.0 * std::numbers::pi * p[0] * size, 0.0};
  }
  template <class T>
  void measured_motion_of(T& x, T& v, const T* /*p*/, const T* s) const {
    x = x + s[0];
    v = v + s[1];
  }
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    const T w = p[0] * (2.0 * std::numbers::pi);
    rate[0] = s[1];
    rate[1] = -(w * w * s[0] + 2.0 * p[3] * w * s[1] + p[1] * at.friction +
                p[2] * at.base_acceleration_m_s2);
  }
};

}  // namespace

const Effect& second_mode() {
  static const SecondMode effect;
  return effect;
}

}  // namespace stickslip::physics
