// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr ParameterCard direct_card = {
    .name = "direct_effect",
    .unit = "1",
    .meaning = "Dieterich's a: immediate change of the coefficient per e-fold of the slip speed",
    .low = 0.0005,
    .high = 0.3,
    .positive = true,
    .fixed_default = std::nullopt};
constexpr ParameterCard evolution_card = {
    .name = "evolution_effect",
    .unit = "1",
    .meaning = "Dieterich's b: change of the coefficient per e-fold of the contacts' age",
    .low = -0.3,
    .high = 0.3,
    .positive = false,
    .fixed_default = std::nullopt};
constexpr ParameterCard slip_length_card = {.name = "slip_length_m",
                                            .unit = "m",
                                            .meaning = "slip over which contacts are renewed, Dc",
                                            .low = 1e-07,
                                            .high = 0.01,
                                            .positive = true,
                                            .fixed_default = std::nullopt};
constexpr ParameterCard reference_speed_card = {
    .name = "reference_speed_m_s",
    .unit = "m/s",
    .meaning = "speed of the steady sliding in which the coefficient is mu",
    .low = 1e-06,
    .high = 1.0,
    .positive = true,
    .fixed_default = 0.001};
constexpr std::array parameters = {mu_card, direct_card, evolution_card, slip_length_card,
                                   reference_speed_card};
constexpr std::array<std::string_view, 3> references = {
    "J. H. Dieterich, Modeling of rock friction: 1. Experimental results and constitutive "
    "equations, Journal of Geophysical Research, 1979",
    "A. Ruina, Slip instability and state variable friction laws, Journal of Geophysical Research, "
    "1983",
    "N. Lapusta, J. R. Rice, Y. Ben-Zion and G. Zheng, Elastodynamic analysis for slow tectonic "
    "loading with spontaneous rupture episodes, Journal of Geophysical Research, 2000"};
constexpr std::array example = {0.6, 0.02, 0.03, 1.0e-4, 0.01};
constexpr std::array<std::string_view, 6> includes = {
    "contact_compliance", "friction_memory",      "stribeck",
    "contact_viscosity",  "logarithmic_friction", "dwell_strengthening"};
constexpr Card entry = {
    .id = "rate_and_state",
    .relation = Relation::friction_law,
    .name = "rate-and-state law",
    .sentence =
        "Friction responds to the logarithm of the slip speed, then evolves with the age of "
        "the contacts, which slip renews.",
    .equation =
        "f / N = direct_effect asinh(v / (2 reference_speed_m_s) exp((mu + evolution_effect "
        "ln(reference_speed_m_s age / slip_length_m)) / direct_effect)): mu + direct_effect "
        "ln(v / reference_speed_m_s) + evolution_effect ln(reference_speed_m_s age / "
        "slip_length_m) in sliding; age' = 1 - age abs(v) / slip_length_m",
    .parameters = parameters,
    .experiment = "steps of the slip speed, up and down, and holds of 0.1 s to 30 s between them",
    .rivals = {},
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class RateAndStateLaw final : public LawOf<RateAndStateLaw> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    // A round number, since mu is the coefficient at this speed.
    const double reference = std::pow(10.0, std::round(std::log10(0.1 * scales.velocity_m_s)));
    std::vector<std::vector<double>> starts;
    for (const double share : {3.0e-4, 3.0e-3, 3.0e-2}) {
      starts.push_back(
          {start.mu, 0.03 * start.mu, 0.04 * start.mu, share * scales.displacement_m, reference});
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction depends on the slip speed and on the age of the contacts: mu = " +
           number_text(p[0]) + " at " + number_text(p[4]) + " m/s, a = " + number_text(p[1]) +
           ", b = " + number_text(p[2]) + ", renewed over " + number_text(1.0e6 * p[3]) + " um.";
  }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::ageing;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.direct_share = p[1] / p[0];
    c.evolution_share = p[2] / p[0];
    c.slip_length = p[3];
    c.reference_speed = p[4];
  }
};

}  // namespace

const Effect& rate_and_state_law() {
  static const RateAndStateLaw effect;
  return effect;
}

}  // namespace stickslip::physics
