// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <numbers>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "share",
                                                 .unit = "1",
                                                 .meaning = "relative height of the ripple",
                                                 .low = 0.001,
                                                 .high = 1.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt},
                                   ParameterCard{.name = "wavelength_m",
                                                 .unit = "m",
                                                 .meaning = "its wavelength",
                                                 .low = 1e-05,
                                                 .high = 1.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt},
                                   ParameterCard{.name = "phase_rad",
                                                 .unit = "rad",
                                                 .meaning = "its phase at x = 0",
                                                 .low = -6.3,
                                                 .high = 6.3,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"position_dependent_mu", "stribeck"};
constexpr std::array<std::string_view, 1> depends_on = {"displacement"};
constexpr std::array example = {0.1, 0.008, 0.0};
constexpr Card entry = {
    .id = "periodic_friction",
    .relation = Relation::friction_law,
    .name = "periodic friction along the track",
    .sentence = "Friction varies periodically along the track, as from machining marks or a weave.",
    .equation = "mu (1 + share sin(2 pi x / wavelength_m + phase_rad))",
    .parameters = parameters,
    .experiment = "a slow sweep over the whole track",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .example = example,
};

class PeriodicFriction final : public EffectOf<PeriodicFriction> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<std::vector<double>> starts;
    for (const double share : {2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25}) {
      for (const double turn : {0.0, 0.5, 1.0, 1.5}) {
        starts.push_back({0.1, share * scales.displacement_m, turn * std::numbers::pi});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction varies periodically by " + number_text(100.0 * p[0]) +
           " % along the track, with a wavelength of " + number_text(1.0e3 * p[1]) + " mm.";
  }

  unsigned hooks() const override { return hook::friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    using std::sin;
    const T factor = 1.0 + p[0] * sin(at.x * (2.0 * std::numbers::pi) / p[1] + p[2]);
    f.mu = f.mu * (factor > 0.0 ? factor : T(0.0));
  }
};

}  // namespace

const Effect& periodic_friction() {
  static const PeriodicFriction effect;
  return effect;
}

}  // namespace stickslip::physics
