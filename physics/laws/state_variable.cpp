// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr ParameterCard rate_card = {.name = "rate_per_s",
                                     .unit = "1/s",
                                     .meaning = "rate gamma at which theta follows g(v)",
                                     .low = 1.0,
                                     .high = 10000.0,
                                     .positive = true,
                                     .fixed_default = std::nullopt};
constexpr std::array parameters = {mu_card, transition_speed_card, rate_card};
constexpr std::array<std::string_view, 1> references = {
    "B. F. Feeny and F. C. Moon, Chaos in a forced dry-friction oscillator: experiments and "
    "numerical modelling, Journal of Sound and Vibration, 1994"};
constexpr std::array example = {0.8, 0.0025, 150.0};
constexpr Card entry = {
    .id = "state_variable",
    .relation = Relation::friction_law,
    .name = "state-variable law",
    .sentence = "Friction relaxes towards Coulomb's law at a rate of its own.",
    .equation = "theta' = -rate_per_s (theta - g(v)), g(v) = tanh(v / transition_speed_m_s)",
    .parameters = parameters,
    .experiment =
        "reversals at several speeds: the loop of friction over velocity opens in "
        "proportion to the acceleration",
    .rivals = {},
    .transition_speed = 1,
    .references = references,
    .example = example,
    .law = true,
};

class StateVariable final : public LawOf<StateVariable> {
 public:
  const Card& card() const override { return entry; }

  void amend(Model& model) const override { model.friction.law = FrictionLaw::state_variable; }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    const double fastest = 0.5 / scales.sample_period_s;
    return {{start.mu, start.transition_speed_m_s, std::min(30.0, fastest)},
            {start.mu, start.transition_speed_m_s, std::min(200.0, fastest)}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction relaxes towards Coulomb's law, mu = " + number_text(p[0]) + ", at a rate of " +
           number_text(p[2]) + " 1/s.";
  }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::relaxing;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.transition_speed = p[1];
    c.rate = p[2];
  }
};

}  // namespace

const Effect& state_variable_law() {
  static const StateVariable effect;
  return effect;
}

}  // namespace stickslip::physics
