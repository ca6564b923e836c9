// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "k5_n_m5",
                  .unit = "N/m^5",
                  .meaning = "quintic stiffness; positive: hardening",
                  .low = -1.0e13,
                  .high = 1.0e13,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"cubic_stiffness", "end_stop"};
constexpr std::array<std::string_view, 1> depends_on = {"displacement"};
constexpr std::array<std::string_view, 1> references = {
    "A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations, Wiley, 1979"};
constexpr std::array example = {2.0e7};
constexpr Card entry = {
    .id = "quintic_stiffness",
    .relation = Relation::force_balance,
    .name = "spring that hardens at large deflections",
    .sentence = "The spring is linear up to large deflections, where it hardens or softens.",
    .equation = "k5_n_m5 x^5 added to the restoring force",
    .parameters = parameters,
    .experiment = "stepped amplitudes: the resonance moves with the fourth power of the amplitude",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

class QuinticStiffness final : public EffectOf<QuinticStiffness> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    const std::string_view way = p[0] > 0.0 ? "hardens" : "softens";
    return "The spring " + std::string(way) +
           " at large deflections: a force k5 x^5 with k5 = " + number_text(p[0]) + " N/m5.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    const T square = at.x * at.x;
    return p[0] * square * square * at.x;
  }
};

}  // namespace

const Effect& quintic_stiffness() {
  static const QuinticStiffness effect;
  return effect;
}

}  // namespace stickslip::physics
