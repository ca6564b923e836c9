// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "friction_force_n",
                  .unit = "N",
                  .meaning = "level of the friction force",
                  .low = 0.001,
                  .high = 1000.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{
        .name = "transition_speed_m_s",
        .unit = "m/s",
        .meaning =
            "speed over which g(v) = tanh(v / transition_speed_m_s) changes sign; 0: set-valued",
        .low = 1e-6,
        .high = 0.1,
        .positive = true,
        .fixed_default = 0.0,
        .estimated = true,
        // Not identifiable below about a hundredth of the rms speed: without this prior a fit
        // would diverge towards the set-valued limit.
        .start_sigma = 0.7}};
constexpr std::array<std::string_view, 3> rivals = {"hysteresis", "quadratic_drag",
                                                    "contact_compliance"};
constexpr std::array<std::string_view, 1> references = {
    "J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Transactions "
    "of the ASME, 1931"};
constexpr std::array example = {0.12, 0.0025};
constexpr Card entry = {
    .id = "dry_friction",
    .relation = Relation::friction_law,
    .name = "dry friction",
    .sentence = "Dry friction opposes the motion with a force that does not depend on speed.",
    .equation = "f = friction_force_n g(v) where the model has none",
    .parameters = parameters,
    .experiment =
        "a free decay: dry friction takes the same amplitude from every cycle, viscous damping the "
        "same fraction",
    .rivals = rivals,
    .transition_speed = 1,
    .references = references,
    .example = example,
};

class DryFriction final : public EffectOf<DryFriction> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law == FrictionLaw::none;
  }
  void amend(Model& model) const override { model.friction.law = FrictionLaw::coulomb; }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{0.05 * scales.force_n}};
  }
  std::vector<double> fixed(const Scales& scales) const override {
    return {0.02 * scales.velocity_m_s};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Dry friction opposes the motion with a force of " + number_text(p[0]) +
           " N, independent of the speed.";
  }

  std::vector<LawCurve> law_curves(std::span<const double> p, std::span<const double> reference,
                                   double /*friction_n*/) const override {
    const double far = reference[1] > 0.0 ? 8.0 * reference[1] : 0.1;
    return {{"velocity", "m/s", -far, far, "friction force", "N",
             [force_n = p[0], speed = p[1]](double at) {
               const double sign = at > 0.0 ? 1.0 : (at < 0.0 ? -1.0 : 0.0);
               return force_n * (speed > 0.0 ? std::tanh(at / speed) : sign);
             }}};
  }

  unsigned hooks() const override { return hook::coefficients; }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.loaded = false;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.transition_speed = p[1];
  }
};

}  // namespace

const Effect& dry_friction() {
  static const DryFriction effect;
  return effect;
}

}  // namespace stickslip::physics
