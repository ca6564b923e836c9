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
  std::string statement(std::span<const double> p) const override {
    return "The normal load is not constant: it changes by " + number_text(0.1 * p[0]) +
           " % per millimetre of displacement, as between plates that are not parallel.";
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
