#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
#include "physics/effects/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "stiffness_n_m",
                  .unit = "N/m",
                  .meaning = "stiffness of the slipping spring before it slips",
                  .low = 0.1,
                  .high = 10000000.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "slip_force_n",
                  .unit = "N",
                  .meaning = "force at which it slips",
                  .low = 0.001,
                  .high = 10000.0,
                  .positive = true,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"contact_compliance", "dry_friction"};
constexpr Card entry = {
    .id = "hysteresis",
    .relation = Relation::force_balance,
    .name = "hysteretic spring",
    .sentence =
        "Part of the restoring force comes from a spring that slips: the structure itself is "
        "hysteretic.",
    .equation = "h added to the restoring force, h' = stiffness_n_m (v - abs(v) h / slip_force_n)",
    .parameters = parameters,
    .experiment = "slow loading loops of several sizes: the loops do not shrink with the speed",
    .rivals = rivals,
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
    return {{0.3 * k, 0.1 * f}, {0.3 * k, 0.4 * f}, {2.0 * k, 0.1 * f}};
  }
  std::string statement(std::span<const double> p) const override {
    return "The structure is hysteretic: part of its spring, " + number_text(p[0]) +
           " N/m, slips at " + number_text(p[1]) + " N, whatever the speed.";
  }

  unsigned hooks() const override { return hook::force; }
  int state_count() const override { return 1; }
  template <class T>
  T force_of(const Instant<T>& /*at*/, const T* /*p*/, const T* s) const {
    return s[0];
  }
  template <class T>
  void rates_of(T* rate, const Instant<T>& at, const T* p, const T* s) const {
    using std::abs;
    rate[0] = p[0] * (at.v - abs(at.v) * s[0] / p[1]);
  }
  // A stiff spring slips within less than a step; its force never exceeds the slip force.
  template <class T>
  void confine_of(T* s, const T* p) const {
    if (s[0] > p[1]) s[0] = p[1];
    if (s[0] < -p[1]) s[0] = -p[1];
  }
};

}  // namespace

const Effect& hysteresis() {
  static const Hysteresis effect;
  return effect;
}

}  // namespace stickslip::physics
