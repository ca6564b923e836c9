// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "cutoff_hz",
                                                 .unit = "Hz",
                                                 .meaning = "-3 dB frequency of the differentiator",
                                                 .low = 1.0,
                                                 .high = 1000.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"channel_delay", "gain_error"};
constexpr std::array example = {40.0};
constexpr Card entry = {
    .id = "differentiator_lag",
    .relation = Relation::kinematics,
    .name = "slow differentiator",
    .sentence =
        "The differentiator of the velocity channel rolls off at a lower frequency than declared.",
    .equation =
        "a first-order low-pass at cutoff_hz behind the differentiator, in place of the declared "
        "one",
    .parameters = parameters,
    .experiment = "a chirp: velocity over displacement against frequency",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .strength = std::nullopt,  // it vanishes as the frequency grows
    .example = example,
};

class DifferentiatorLag final : public EffectOf<DifferentiatorLag> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{100.0}, {30.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The velocity lags behind the displacement: its differentiator rolls off at " +
           number_text(p[0]) + " Hz.";
  }

  std::vector<LawCurve> law_curves(std::span<const double> p, std::span<const double> reference,
                                   double /*friction_n*/) const override {
    return {{"frequency", "Hz", 0.0, 4.0 * reference[0], "velocity reading over velocity", "1",
             [cutoff_hz = p[0]](double at) { return 1.0 / std::hypot(1.0, at / cutoff_hz); }}};
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& /*place*/, const T* p) const {
    laws.velocity_cutoff_hz = p[0];
    laws.any_error = true;
  }
};

}  // namespace

const Effect& differentiator_lag() {
  static const DifferentiatorLag effect;
  return effect;
}

}  // namespace stickslip::physics
