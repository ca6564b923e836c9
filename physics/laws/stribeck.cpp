// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {mu_card, mu_static_card, stribeck_speed_card, viscosity_card,
                                   transition_speed_card};
constexpr std::array<std::string_view, 2> references = {
    "R. Stribeck, Die wesentlichen Eigenschaften der Gleit- und Rollenlager, Zeitschrift des "
    "Vereines deutscher Ingenieure, 1902",
    "B. Armstrong-H\u00e9louvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis "
    "tools and compensation methods for the control of machines with friction, Automatica, 1994"};
constexpr std::array example = {0.6, 0.8, 0.05, 0.05, 0.0025};
constexpr std::array<std::string_view, 2> includes = {"stribeck", "contact_viscosity"};
constexpr Card entry = {
    .id = "stribeck",
    .relation = Relation::friction_law,
    .name = "Stribeck curve",
    .sentence =
        "Friction falls from a static level to a kinetic one with the slip speed, then "
        "grows in proportion to it.",
    .equation =
        "f = N g(v) (mu + (mu_static - mu) exp(-(v / stribeck_speed_m_s)^2)) + "
        "viscosity_n_s_m v, g(v) = tanh(v / transition_speed_m_s)",
    .parameters = parameters,
    .experiment =
        "slow steady sliding in both directions, from below the Stribeck speed to far "
        "above it",
    .rivals = {},
    .transition_speed = 4,
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class StribeckLaw final : public LawOf<StribeckLaw> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    const double transition = start.transition_speed_m_s;
    return {
        {start.mu, 1.2 * start.mu, 0.05 * scales.velocity_m_s, start.viscosity_n_s_m, transition},
        {start.mu, 1.2 * start.mu, 0.3 * scales.velocity_m_s, start.viscosity_n_s_m, transition}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction follows a Stribeck curve from mu_static = " + number_text(p[1]) +
           " to mu = " + number_text(p[0]) + " above about " + number_text(p[2]) + " m/s.";
  }
  unsigned hooks() const override { return hook::coefficients | hook::slip_friction; }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.contact_viscosity = p[3];
    c.transition_speed = p[4];
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    f.backbone = f.backbone * stribeck_factor(at.slip, p[0], p[1], p[2]);
  }
};

}  // namespace

const Effect& stribeck_law() {
  static const StribeckLaw effect;
  return effect;
}

}  // namespace stickslip::physics
