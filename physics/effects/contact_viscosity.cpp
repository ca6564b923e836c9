// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "slope_s_m",
                  .unit = "s/m",
                  .meaning = "relative change of the friction per m/s",
                  .low = -10.0,
                  .high = 100.0,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"stribeck", "quadratic_drag"};
constexpr std::array<std::string_view, 1> depends_on = {"velocity"};
constexpr std::array<std::string_view, 1> references = {
    "B. Armstrong-H\u00e9louvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis "
    "tools and compensation methods for the control of machines with friction, Automatica, 1994"};
constexpr std::array example = {0.5};
constexpr Card entry = {
    .id = "contact_viscosity",
    .relation = Relation::friction_law,
    .name = "viscous contact",
    .sentence = "Friction changes linearly with the slip speed, as in a lubricated contact.",
    .equation = "mu (1 + slope_s_m abs(v))",
    .parameters = parameters,
    .experiment = "a wide range of slip speeds",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

class ContactViscosity final : public EffectOf<ContactViscosity> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction changes with the slip speed, by " + number_text(100.0 * p[0]) + " % per m/s.";
  }

  unsigned hooks() const override { return hook::slip_friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    using std::abs;
    f.backbone = f.backbone * (1.0 + p[0] * abs(at.slip));
  }
};

}  // namespace

const Effect& contact_viscosity() {
  static const ContactViscosity effect;
  return effect;
}

}  // namespace stickslip::physics
