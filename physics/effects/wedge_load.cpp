// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "slope_per_m",
                  .unit = "1/m",
                  .meaning = "relative change of the load per metre",
                  .low = -500.0,
                  .high = 500.0,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "curvature_per_m2",
                  .unit = "1/m2",
                  .meaning = "relative change per square metre, where the plates are bowed as well",
                  .low = -1.0e5,
                  .high = 1.0e5,
                  .positive = false,
                  .fixed_default = 0.0,
                  .estimated = true}};
constexpr std::array<std::string_view, 2> rivals = {"position_dependent_mu", "asymmetric_friction"};
constexpr std::array<std::string_view, 1> references = {
    "B. F. Feeny and F. C. Moon, Chaos in a forced dry-friction oscillator: experiments and "
    "numerical modelling, Journal of Sound and Vibration, 1994"};
constexpr std::array example = {36.0, 0.0};
constexpr Card entry = {
    .id = "wedge_load",
    .relation = Relation::normal_load,
    .name = "wedge",
    .sentence = "The plates are not parallel: the normal load changes with the displacement.",
    .equation =
        "N = load_n (1 + slope_per_m x + curvature_per_m2 x^2) in place of a "
        "constant load",
    .parameters = parameters,
    .experiment = "a slow sweep over the whole track with the normal-load bridge recorded",
    .rivals = rivals,
    .references = references,
    .example = example,
};

class WedgeLoad final : public EffectOf<WedgeLoad> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.normal_load && model.normal_load->law == NormalLoadLaw::constant;
  }
  void amend(Model& model) const override {
    if (model.normal_load) model.normal_load->law = NormalLoadLaw::wedge;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0, 0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The normal load is not constant: it changes by " + number_text(0.1 * p[0]) +
           " % per millimetre of displacement, as between plates that are not parallel.";
  }

  std::vector<LawCurve> law_curves(std::span<const double> p, std::span<const double> reference,
                                   double /*friction_n*/) const override {
    if (reference[0] == 0.0) return {};
    const double far = 0.7 / std::abs(reference[0]);
    return {{"displacement", "m", -far, far, "relative normal load", "1",
             [slope = p[0], curvature = p[1]](double at) {
               return std::max(0.0, 1.0 + slope * at + curvature * at * at);
             }}};
  }

  unsigned hooks() const override { return hook::coefficients; }
  void set_structure(Structure& structure) const override {
    structure.load_law = NormalLoadLaw::wedge;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.load_slope = p[0];
    c.load_curvature = p[1];
  }
};

}  // namespace

const Effect& wedge_load() {
  static const WedgeLoad effect;
  return effect;
}

}  // namespace stickslip::physics
