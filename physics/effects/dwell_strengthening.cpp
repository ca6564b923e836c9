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
    ParameterCard{.name = "beta",
                  .unit = "1",
                  .meaning = "relative growth per e-fold of the time at rest",
                  .low = 0.005,
                  .high = 1.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "tau_s",
                  .unit = "s",
                  .meaning = "time at rest beyond which friction grows",
                  .low = 0.0001,
                  .high = 10.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "stuck_speed_m_s",
                  .unit = "m/s",
                  .meaning = "slip speed below which the contact counts as at rest",
                  .low = 1e-06,
                  .high = 0.1,
                  .positive = true,
                  .fixed_default = 0.003},
    ParameterCard{.name = "slip_length_m",
                  .unit = "m",
                  .meaning = "slip over which the strengthening is lost",
                  .low = 1e-09,
                  .high = 0.01,
                  .positive = true,
                  .fixed_default = 1e-4,
                  .estimated = true}};
constexpr std::array<std::string_view, 3> rivals = {"stribeck", "friction_memory",
                                                    "contact_compliance"};
constexpr std::array<std::string_view, 1> references = {
    "J. H. Dieterich, Time-dependent friction in rocks, Journal of Geophysical Research, 1972"};
constexpr std::array example = {0.05, 0.001, 0.003, 1.0e-4};
constexpr Card entry = {
    .id = "dwell_strengthening",
    .relation = Relation::friction_law,
    .name = "strengthening at rest",
    .sentence =
        "Friction grows while the contact sticks: the break-away force increases with the time at "
        "rest.",
    .equation =
        "g(v) (1 + beta ln(1 + t_stuck / tau_s)); slip at v reduces t_stuck at the "
        "relative rate abs(v) / slip_length_m",
    .parameters = parameters,
    .experiment = "holds of 0.1 s to 30 s between slips",
    .rivals = rivals,
    .references = references,
    .example = example,
};

class DwellStrengthening final : public EffectOf<DwellStrengthening> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double stuck = std::max(2.0 * scales.transition_speed_m_s, 1.0e-2 * scales.velocity_m_s);
    // Less slip than a sensor resolves.
    const double length = 2.0e-3 * scales.velocity_m_s;
    return {{0.1, 0.01, stuck, length}, {0.1, 0.1, stuck, length}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The contact strengthens at rest: break-away friction grows by " +
           number_text(100.0 * p[0]) + " % per e-fold of the time at rest beyond " +
           number_text(p[1]) + " s.";
  }

  unsigned hooks() const override { return hook::friction; }
  int state_count() const override { return 1; }
  StateSize state_size(int /*index*/, std::span<const double> p,
                       const Scales& /*scales*/) const override {
    return {2.0 * p[1], 0.0};
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& /*at*/, const T* p,
                         const T* s) const {
    using std::log;
    f.backbone = f.backbone * (1.0 + p[0] * log(1.0 + s[0] / p[1]));
  }
  // State: the time at rest (Dieterich 1979).
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    using std::abs;
    using std::exp;
    const T ratio = at.slip / p[2];
    const T slips = abs(at.slip) * (1.0 - exp(-(ratio * ratio)));
    rate[0] = 1.0 - decay_per_s(s[0], slips, p[3]);
  }
  template <class T>
  void confine_of(T* s, const T* /*p*/) const {
    if (s[0] < 0.0) s[0] = T(0.0);
  }
};

}  // namespace

const Effect& dwell_strengthening() {
  static const DwellStrengthening effect;
  return effect;
}

}  // namespace stickslip::physics
