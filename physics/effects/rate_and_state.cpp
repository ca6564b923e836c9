// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/contact_renewal.h"
#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "direct_effect",
                  .unit = "1",
                  .meaning = "immediate relative change per e-fold of the slip speed",
                  .low = -0.3,
                  .high = 0.3,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "evolution_effect",
                  .unit = "1",
                  .meaning = "relative change per e-fold of the contacts' age",
                  .low = -0.3,
                  .high = 0.3,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "slip_length_m",
                  .unit = "m",
                  .meaning = "slip over which contacts are renewed",
                  .low = 1e-07,
                  .high = 0.01,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "reference_speed_m_s",
                  .unit = "m/s",
                  .meaning = "slip speed at which both changes vanish",
                  .low = 1e-06,
                  .high = 1.0,
                  .positive = true,
                  .fixed_default = 0.003}};
constexpr std::array<std::string_view, 3> rivals = {"dwell_strengthening", "stribeck",
                                                    "logarithmic_friction"};
constexpr std::array<std::string_view, 2> depends_on = {"velocity", "time"};
constexpr std::array<std::string_view, 2> references = {
    "J. H. Dieterich, Modeling of rock friction: 1. Experimental results and constitutive "
    "equations, Journal of Geophysical Research, 1979",
    "A. Ruina, Slip instability and state variable friction laws, Journal of Geophysical Research, "
    "1983"};
constexpr std::array example = {0.02, 0.03, 1.0e-4, 0.003};
constexpr Card entry = {
    .id = "rate_and_state",
    .relation = Relation::friction_law,
    .name = "rate and state dependence",
    .sentence =
        "Friction responds immediately to the logarithm of the slip speed and then evolves with "
        "the "
        "age of the contacts, which slip renews.",
    .equation =
        "mu (1 + direct_effect ln(1 + abs(v) / reference_speed_m_s) + evolution_effect ln(1 + age "
        "reference_speed_m_s / slip_length_m)), age' = 1 - age abs(v) / slip_length_m",
    .parameters = parameters,
    .experiment = "steps of the slip speed, up and down, and holds of 0.1 s to 30 s between them",
    .rivals = rivals,
    .depends_on = depends_on,
    .strength = 1,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

// Dieterich's (1979) and Ruina's (1983) law with ageing, regularised at rest.
class RateAndState final : public EffectOf<RateAndState> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double reference = std::max(scales.transition_speed_m_s, 1.0e-2 * scales.velocity_m_s);
    return {{0.0, 0.05, 3.0e-3 * scales.velocity_m_s, reference},
            {0.0, 0.05, 3.0e-2 * scales.velocity_m_s, reference}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction depends on the slip speed and on the age of the contacts: " +
           number_text(100.0 * p[0]) + " % per e-fold of the speed, " + number_text(100.0 * p[1]) +
           " % per e-fold of the age, which " + number_text(1.0e6 * p[2]) + " um of slip renew.";
  }

  unsigned hooks() const override { return hook::slip_friction; }
  int state_count() const override { return 1; }
  StateSize state_size(int /*index*/, std::span<const double> p,
                       const Scales& /*scales*/) const override {
    return {p[2] / p[3], 0.0};
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* s) const {
    using std::abs;
    using std::log;
    f.backbone = f.backbone * (1.0 + p[0] * log(1.0 + abs(at.slip) / p[3]) +
                               p[1] * log(1.0 + s[0] * p[3] / p[2]));
  }
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    using std::abs;
    rate[0] = 1.0 - decay_per_s(s[0], T(abs(at.slip)), p[2]);
  }
  template <class T>
  void confine_of(T* s, const T* /*p*/) const {
    if (s[0] < 0.0) s[0] = T(0.0);
  }
};

}  // namespace

const Effect& rate_and_state() {
  static const RateAndState effect;
  return effect;
}

}  // namespace stickslip::physics
