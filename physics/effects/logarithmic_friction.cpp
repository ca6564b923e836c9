// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "coefficient",
                  .unit = "1",
                  .meaning = "relative change per e-fold of the speed",
                  .low = -0.3,
                  .high = 0.3,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "reference_speed_m_s",
                  .unit = "m/s",
                  .meaning = "speed below which friction is constant",
                  .low = 1e-06,
                  .high = 1.0,
                  .positive = true,
                  .fixed_default = 0.003}};
constexpr std::array<std::string_view, 2> rivals = {"stribeck", "dwell_strengthening"};
constexpr std::array<std::string_view, 1> depends_on = {"velocity"};
constexpr std::array<std::string_view, 1> references = {
    "J. H. Dieterich, Modeling of rock friction: 1. Experimental results and constitutive "
    "equations, Journal of Geophysical Research, 1979"};
constexpr std::array example = {0.05, 0.003};
constexpr Card entry = {
    .id = "logarithmic_friction",
    .relation = Relation::friction_law,
    .name = "logarithmic rate dependence",
    .sentence = "Friction changes with the logarithm of the slip speed.",
    .equation = "mu (1 + coefficient ln(1 + abs(v) / reference_speed_m_s))",
    .parameters = parameters,
    .experiment = "a wide range of slip speeds, down to creep",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

class LogarithmicFriction final : public EffectOf<LogarithmicFriction> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{0.0, std::max(scales.transition_speed_m_s, 1.0e-2 * scales.velocity_m_s)}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction changes by " + number_text(100.0 * p[0]) +
           " % per e-fold of the slip speed beyond " + number_text(p[1]) + " m/s.";
  }

  unsigned hooks() const override { return hook::slip_friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    using std::abs;
    using std::log;
    f.backbone = f.backbone * (1.0 + p[0] * log(1.0 + abs(at.slip) / p[1]));
  }
};

}  // namespace

const Effect& logarithmic_friction() {
  static const LogarithmicFriction effect;
  return effect;
}

}  // namespace stickslip::physics
