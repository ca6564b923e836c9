// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "curvature_per_m2",
                  .unit = "1/m^2",
                  .meaning = "relative change of the load per square metre",
                  .low = -100000.0,
                  .high = 100000.0,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 1> rivals = {"wedge_load"};
constexpr std::array<std::string_view, 1> depends_on = {"displacement"};
constexpr std::array example = {500.0};
constexpr Card entry = {
    .id = "load_curvature",
    .relation = Relation::normal_load,
    .name = "bowed plates",
    .sentence =
        "The plates are bowed: the normal load changes with the square of the displacement.",
    .equation = "N (1 + curvature_per_m2 x^2)",
    .parameters = parameters,
    .experiment = "a slow sweep over the whole track with the normal-load bridge recorded",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .example = example,
};

class LoadCurvature final : public EffectOf<LoadCurvature> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.normal_load && model.normal_load->law != NormalLoadLaw::measured;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The normal load changes with the square of the displacement, by " +
           number_text(1.0e-4 * p[0]) + " % at a millimetre.";
  }

  unsigned hooks() const override { return hook::load; }
  template <class T>
  void scale_load_of(T& load, const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    load = load * (1.0 + p[0] * at.x * at.x);
  }
};

}  // namespace

const Effect& load_curvature() {
  static const LoadCurvature effect;
  return effect;
}

}  // namespace stickslip::physics
