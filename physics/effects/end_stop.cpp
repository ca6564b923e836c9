// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "gap_m",
                  .unit = "m",
                  .meaning = "travel to the stop",
                  .low = 1e-05,
                  .high = 1.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{
        .name = "stiffness_n_m",
        .unit = "N/m",
        .meaning = "stiffness of the stop, at a depth of 0.3 gap_m where exponent is not 1",
        .low = 0.1,
        .high = 10000000.0,
        .positive = true,
        .fixed_default = std::nullopt},
    ParameterCard{.name = "side",
                  .unit = "1",
                  .meaning = "0: stops on both sides, 1: at +gap_m only, -1: at -gap_m only",
                  .low = -1.0,
                  .high = 1.0,
                  .positive = false,
                  .fixed_default = 0.0},
    ParameterCard{.name = "exponent",
                  .unit = "1",
                  .meaning = "1: a spring, 1.5: a sphere (Hertz)",
                  .low = 0.7,
                  .high = 4.0,
                  .positive = true,
                  .fixed_default = 1.0,
                  .estimated = true}};
constexpr std::array<std::string_view, 2> rivals = {"cubic_stiffness", "bias_force"};
constexpr std::array<std::string_view, 2> references = {
    "K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in "
    "vibroimpact, Journal of Applied Mechanics, 1975",
    "S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear oscillator, Journal of "
    "Sound and Vibration, 1983"};
constexpr std::array example = {0.012, 100.0, 0.0, 1.0};
constexpr double reference_depth = 0.3;  // over the gap; that of usual contacts
constexpr Card entry = {
    .id = "end_stop",
    .relation = Relation::force_balance,
    .name = "end stop",
    .sentence = "The mass runs into a stop at the end of its travel.",
    .equation =
        "stiffness_n_m d (d / (0.3 gap_m))^(exponent - 1) sign(x), d = abs(x) - gap_m, beyond "
        "the gap, on both sides or on one",
    .parameters = parameters,
    .experiment = "amplitudes just below and just above the assumed gap",
    .rivals = rivals,
    .strength = 1,
    .references = references,
    .example = example,
};

class EndStop final : public EffectOf<EndStop> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double k = std::max(scales.stiffness_n_m, scales.force_n / scales.displacement_m);
    std::vector<std::vector<double>> starts;
    for (const double side : {0.0, 1.0, -1.0}) {
      // Soft, so that a single step of a fit already shows the gain.
      for (const double share : {0.6, 0.75, 0.85, 0.93, 0.97}) {
        starts.push_back({share * scales.displacement_m, 0.3 * k, side, 1.0});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    const char* where =
        p[2] > 0.5 ? "on the +x side" : (p[2] < -0.5 ? "on the -x side" : "on both sides");
    return "The mass hits a stop " + std::string(where) + " after " + number_text(1.0e3 * p[0]) +
           " mm, with a stiffness of " + number_text(p[1]) + " N/m.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    const double side = value_of(p[2]);
    if (at.x > p[0] && side > -0.5) return contact(at.x - p[0], p);
    if (at.x < -p[0] && side < 0.5) return -contact(-at.x - p[0], p);
    return T(0.0);
  }

 private:
  template <class T>
  static T contact(const T& depth, const T* p) {
    using std::pow;
    return p[1] * depth * pow(depth / (reference_depth * p[0]), p[3] - 1.0);
  }
};

}  // namespace

const Effect& end_stop() {
  static const EndStop effect;
  return effect;
}

}  // namespace stickslip::physics
