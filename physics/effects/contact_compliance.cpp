// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "contact_stiffness_n_m",
                  .unit = "N/m",
                  .meaning = "tangential stiffness of the contact",
                  .low = 1.0,
                  .high = 1000000.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.65},
    ParameterCard{.name = "contact_damping_n_s_m",
                  .unit = "N s/m",
                  .meaning = "damping of the deflection",
                  .low = 1.0e-6,
                  .high = 100.0,
                  .positive = true,
                  .fixed_default = 1.0e-6,
                  .estimated = true},
    ParameterCard{.name = "elastic_share",
                  .unit = "1",
                  .meaning = "how elastic the contact is before it breaks away: slip sets in "
                             "at 2 - 1/elastic_share of that deflection, below 1/2 at once. 0: "
                             "Dahl's bristle, near 1: Jenkins' element",
                  .low = 0.0,
                  .high = 1.0,
                  .positive = false,
                  .fixed_default = 0.0,
                  .estimated = true}};
constexpr std::array<std::string_view, 3> rivals = {"friction_memory", "hysteresis", "stribeck"};
constexpr std::array<std::string_view, 4> references = {
    "P. R. Dahl, A solid friction model, The Aerospace Corporation, 1968",
    "G. M. Jenkins, Analysis of the stress-strain relationships in reactor grade graphite, British "
    "Journal of Applied Physics, 1962",
    "C. Canudas de Wit, H. Olsson, K. J. \u00c5str\u00f6m and P. Lischinsky, A new model for "
    "control of systems with friction, IEEE Transactions on Automatic Control, 1995",
    "P. Dupont, V. Hayward, B. Armstrong and F. Altpeter, Single state elastoplastic friction "
    "models, IEEE Transactions on Automatic Control, 2002"};
constexpr std::array example = {60.0, 0.1, 0.7};
constexpr Card entry = {
    .id = "contact_compliance",
    .relation = Relation::friction_law,
    .name = "compliant contact",
    .sentence = "The contact is elastic: it deflects along the surface before it slips.",
    .equation =
        "f = k_c z + contact_damping_n_s_m z', z' = v - abs(v) z k_c / (mu N): a tangential spring "
        "that slips at mu N",
    .parameters = parameters,
    .experiment = "small amplitudes without break-away, where the contact stiffness is visible",
    .rivals = rivals,
    .formula_residual = 0.017,
    .strength = std::nullopt,  // it replaces the law
    .references = references,
    .example = example,
};

class ContactCompliance final : public EffectOf<ContactCompliance> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law == FrictionLaw::coulomb ||
           model.friction.law == FrictionLaw::state_variable;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double knee = scales.friction_n / scales.displacement_m;
    const auto damping = [&](double stiffness) {
      return 0.1 * std::sqrt(stiffness * scales.mass_kg);
    };
    std::vector<std::vector<double>> starts;
    for (const double times : {5.0, 15.0, 60.0}) {
      for (const double elastic_share : {0.3, 0.6, 0.9}) {
        starts.push_back({times * knee, damping(times * knee), elastic_share});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The contact deflects elastically before it slips, with a tangential stiffness of " +
           number_text(p[0]) + " N/m.";
  }

  std::vector<LawCurve> law_curves(std::span<const double> p, std::span<const double> reference,
                                   double friction_n) const override {
    if (!(friction_n > 0.0)) return {};
    const double far = 2.5 * friction_n / reference[0];
    return {{"deflection of the contact", "m", -far, far, "friction force", "N",
             [stiffness = p[0], friction_n](double at) {
               return std::clamp(stiffness * at, -friction_n, friction_n);
             }}};
  }

  unsigned hooks() const override { return hook::coefficients; }
  void set_structure(Structure& structure) const override {
    structure.kinetics = Kinetics::bristle;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.contact_stiffness = p[0];
    c.contact_damping = p[1];
    c.contact_elastic_share = p[2];
  }
};

}  // namespace

const Effect& contact_compliance() {
  static const ContactCompliance effect;
  return effect;
}

}  // namespace stickslip::physics
