// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "stiffness_n_m",
                  .unit = "N/m",
                  .meaning = "stiffness of the slipping spring before it slips",
                  .low = 0.1,
                  .high = 10000000.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.3},
    ParameterCard{.name = "slip_force_n",
                  .unit = "N",
                  .meaning = "force at which it slips",
                  .low = 0.001,
                  .high = 10000.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.4},
    ParameterCard{.name = "loop_shape",
                  .unit = "1",
                  .meaning = "0: slips equally in loading and unloading; below -1: no slip in "
                             "loading (Bouc and Wen's delta over gamma)",
                  .low = -2.0,
                  .high = 2.0,
                  .positive = false,
                  .fixed_default = 0.0,
                  .estimated = true,
                  .start_sigma = 1.0},
    ParameterCard{.name = "sharpness",
                  .unit = "1",
                  .meaning = "1: yields gradually; larger: nearly linear until it slips (Bouc "
                             "and Wen's exponent)",
                  .low = 0.5,
                  .high = 10.0,
                  .positive = true,
                  .fixed_default = 1.0,
                  .estimated = true}};
constexpr std::array<std::string_view, 3> rivals = {"contact_compliance", "dry_friction",
                                                    "bias_force"};
constexpr std::array<std::string_view, 3> references = {
    "W. D. Iwan, A distributed-element model for hysteresis and its steady-state dynamic response, "
    "Journal of Applied Mechanics, 1966",
    "R. Bouc, Forced vibration of mechanical systems with hysteresis, 1967",
    "Y.-K. Wen, Method for random vibration of hysteretic systems, Journal of the Engineering "
    "Mechanics Division (ASCE), 1976"};
constexpr std::array example = {20.0, 0.05, 0.5, 1.0};
constexpr Card entry = {
    .id = "hysteresis",
    .relation = Relation::force_balance,
    .name = "hysteretic spring",
    .sentence =
        "Part of the restoring force comes from a spring that slips: the structure itself is "
        "hysteretic.",
    .equation =
        "h added to the restoring force, "
        "h' = stiffness_n_m (v - (abs(v) r + loop_shape v abs(r)) abs(r)^(sharpness - 1)), "
        "r = h / slip_force_n",
    .parameters = parameters,
    .experiment = "slow loading loops of several sizes: their area does not fall with the speed",
    .rivals = rivals,
    .formula_residual = 0.005,
    .references = references,
    .example = example,
};

class Hysteresis final : public EffectOf<Hysteresis> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double k = std::max(scales.stiffness_n_m, scales.force_n / scales.displacement_m);
    const double f = k * scales.displacement_m;
    return {{0.3 * k, 0.1 * f, 0.0, 1.5},
            {0.3 * k, 0.4 * f, 0.0, 1.5},
            {2.0 * k, 0.1 * f, 0.0, 1.0},
            {0.3 * k, 0.2 * f, -1.0, 1.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The structure is hysteretic: part of its spring, " + number_text(p[0]) +
           " N/m, slips at " + number_text(p[1]) + " N at any speed.";
  }

  unsigned hooks() const override { return hook::force; }
  int state_count() const override { return 1; }
  // Bounded by the slip force and by the spring's force over the range of the motion.
  StateSize state_size(int /*index*/, std::span<const double> p,
                       const Scales& scales) const override {
    const double size = 0.7 * std::min(p[1], 2.0 * p[0] * scales.displacement_m);
    return {size, size};
  }
  template <class T>
  T force_of(const OperatingPoint<T>& /*at*/, const T* /*p*/, const T* s) const {
    return s[0];
  }
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    using std::abs;
    using std::pow;
    const T share = s[0] / p[1];
    T yields = abs(at.v) * share + p[2] * at.v * abs(share);
    // 1e-6: the power has no derivative at zero force.
    yields = yields * pow(share * share + 1.0e-6, 0.5 * (p[3] - 1.0));
    rate[0] = p[0] * (at.v - yields);
  }
  // A stiff spring slips within less than a step: its force is limited to the slip force, as far as
  // it slips in loading.
  template <class T>
  void confine_of(T* s, const T* p) const {
    using std::pow;
    if (!(value_of(p[2]) > -0.9)) return;
    const T most = p[1] * pow(1.0 / (1.0 + p[2]), 1.0 / p[3]);
    if (s[0] > most) s[0] = most;
    if (s[0] < -most) s[0] = -most;
  }
};

}  // namespace

const Effect& hysteresis() {
  static const Hysteresis effect;
  return effect;
}

}  // namespace stickslip::physics
