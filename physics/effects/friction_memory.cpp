// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "gamma_per_s",
                  .unit = "1/s",
                  .meaning = "rate at which theta approaches the backbone",
                  .low = 1.0,
                  .high = 5000.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "spread",
                  .unit = "1",
                  .meaning = "separation of two relaxation processes, with rates (1 +- spread) "
                             "gamma; 0: one process",
                  .low = 1.0e-3,
                  .high = 0.8,
                  .positive = true,
                  .fixed_default = 0.0,
                  .estimated = true}};
constexpr std::array<std::string_view, 3> rivals = {"contact_compliance", "channel_delay",
                                                    "load_cell_resonance"};
constexpr std::array<std::string_view, 2> references = {
    "B. F. Feeny and F. C. Moon, Chaos in a forced dry-friction oscillator: experiments and "
    "numerical modelling, Journal of Sound and Vibration, 1994",
    "A. Polycarpou and A. Soom, Transitions between sticking and slipping at lubricated line "
    "contacts, ASME Winter Annual Meeting, 1992"};
constexpr std::array example = {50.0, 0.0};
constexpr Card entry = {
    .id = "friction_memory",
    .relation = Relation::friction_law,
    .name = "friction with memory",
    .sentence = "The friction force follows its law with a delay: it relaxes towards g(v).",
    .equation =
        "theta' = -gamma (theta - g(v)) in place of theta = g(v); with a spread, theta is "
        "the sum of two such processes with rates (1 +- spread) gamma and shares (1 +- spread) / "
        "2, "
        "so that 1 / gamma is the mean lag",
    .parameters = parameters,
    .experiment =
        "reversals at several speeds: a memory opens the friction-velocity loop in proportion to "
        "the acceleration, a compliant contact in proportion to the deflection",
    .rivals = rivals,
    .strength = std::nullopt,  // it replaces a law
    .references = references,
    .example = example,
};

class FrictionMemory final : public EffectOf<FrictionMemory> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law == FrictionLaw::coulomb;
  }
  void amend(Model& model) const override { model.friction.law = FrictionLaw::state_variable; }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double fastest = 0.5 / scales.sample_period_s;
    return {{std::min(30.0, fastest), 0.3}, {std::min(200.0, fastest), 0.3}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction has a memory: it relaxes towards its law with rate gamma = " +
           number_text(p[0]) + " 1/s instead of following the velocity immediately.";
  }

  std::vector<LawCurve> law_curves(std::span<const double> p, std::span<const double> reference,
                                   double /*friction_n*/) const override {
    return {{"time after a reversal", "s", 0.0, 5.0 / reference[0], "friction over mu N", "1",
             [rate = p[0], spread = p[1]](double at) {
               return 1.0 - (1.0 + spread) * std::exp(-(1.0 + spread) * rate * at) -
                      (1.0 - spread) * std::exp(-(1.0 - spread) * rate * at);
             }}};
  }

  unsigned hooks() const override { return hook::coefficients; }
  void set_structure(Structure& structure) const override {
    structure.kinetics = Kinetics::relaxing;
    structure.two_processes = true;
  }
  // Theta of the slow process, integrated by the rig together with the contact.
  int state_count() const override { return 1; }
  StateSize state_size(int /*index*/, std::span<const double> /*p*/,
                       const Scales& /*scales*/) const override {
    return {0.7, 0.0};
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.rate = p[0];
    c.rate_spread = p[1];
    if (c.rate_spread > 0.8) c.rate_spread = T(0.8);
  }
};

}  // namespace

const Effect& friction_memory() {
  static const FrictionMemory effect;
  return effect;
}

}  // namespace stickslip::physics
