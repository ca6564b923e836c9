// SPDX-License-Identifier: Apache-2.0
// An effect that is not part of Stickslip: the periodic position-dependent force of a linear motor.
#include <array>
#include <cmath>
#include <numbers>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "force_n",
                                                 .unit = "N",
                                                 .meaning = "amplitude",
                                                 .low = -100.0,
                                                 .high = 100.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt},
                                   ParameterCard{.name = "pitch_m",
                                                 .unit = "m",
                                                 .meaning = "distance between poles",
                                                 .low = 1.0e-4,
                                                 .high = 1.0,
                                                 .positive = true,
                                                 .fixed_default = 0.03}};
constexpr std::array<std::string_view, 1> depends_on = {"displacement"};
constexpr std::array example = {0.2, 0.03};
constexpr Card entry = {
    .id = "cogging",
    .relation = Relation::force_balance,
    .name = "cogging",
    .sentence = "The force on the mass varies periodically with the displacement.",
    .equation = "force_n sin(2 pi x / pitch_m) added to the restoring force",
    .parameters = parameters,
    .experiment = "a slow sweep over the whole range of the displacement",
    .rivals = {},
    .depends_on = depends_on,
    .tier = Tier::formula,
    .example = example,
};

class Cogging final : public EffectOf<Cogging> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "A cogging force of " + number_text(p[0]) + " N acts on the mass, with a pitch of " +
           number_text(1.0e3 * p[1]) + " mm.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    using std::sin;
    return p[0] * sin(at.x * (2.0 * std::numbers::pi) / p[1]);
  }
};

}  // namespace

const Effect& cogging() {
  static const Cogging effect;
  return effect;
}

}  // namespace stickslip::physics
