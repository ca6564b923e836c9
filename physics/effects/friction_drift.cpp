// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "rate_per_s",
                  .unit = "1/s",
                  .meaning = "relative change per second",
                  .low = -0.1,
                  .high = 0.1,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "approach_s",
                  .unit = "s",
                  .meaning = "time constant of the approach to a final value; much longer than "
                             "the recording: linear drift",
                  .low = 0.01,
                  .high = 1.0e6,
                  .positive = true,
                  .fixed_default = 1.0e6,
                  .estimated = true}};
constexpr std::array<std::string_view, 2> rivals = {"load_dependent_mu", "sensor_drift"};
constexpr std::array example = {0.005, 30.0};
constexpr Card entry = {
    .id = "friction_drift",
    .relation = Relation::friction_law,
    .name = "drifting friction",
    .sentence = "The coefficient of friction drifts during the recording.",
    .equation =
        "mu (1 + rate_per_s approach_s (1 - exp(-t / approach_s))), initially mu (1 + rate_per_s "
        "t)",
    .parameters = parameters,
    .experiment = "a longer run with a pause: wear stays, warming recovers",
    .rivals = rivals,
    .example = example,
};

class FrictionDrift final : public EffectOf<FrictionDrift> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{0.0, 5.0 * scales.duration_s}, {0.0, 0.3 * scales.duration_s}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The coefficient of friction drifts by " + number_text(100.0 * p[0]) +
           " % of its initial value per second initially, with a time constant of " +
           number_text(p[1]) + " s.";
  }

  unsigned hooks() const override { return hook::friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    using std::exp;
    const T factor = 1.0 + p[0] * p[1] * (1.0 - exp(-at.time_s / p[1]));
    f.mu = f.mu * (factor > 0.0 ? factor : T(0.0));
  }
};

}  // namespace

const Effect& friction_drift() {
  static const FrictionDrift effect;
  return effect;
}

}  // namespace stickslip::physics
