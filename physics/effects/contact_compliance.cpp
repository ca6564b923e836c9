#include <array>
#include <cmath>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
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
                  .fixed_default = std::nullopt},
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
                  .meaning = "share of the break-away deflection within which nothing slips; 0: "
                             "Dahl's bristle, near 1: Jenkins' element",
                  .low = 0.0,
                  .high = 1.0,
                  .positive = false,
                  .fixed_default = 0.0,
                  .estimated = true}};
constexpr std::array<std::string_view, 3> rivals = {"friction_memory", "hysteresis", "stribeck"};
constexpr Card entry = {
    .id = "contact_compliance",
    .relation = Relation::friction_law,
    .name = "compliant contact",
    .sentence = "The contact is elastic: it deflects along the surface before it slips.",
    .equation =
        "f = k_c z + contact_damping_n_s_m z', z' = v - abs(v) z k_c / (mu N): a tangential spring "
        "that slips at mu N",
    .parameters = parameters,
    .experiment =
        "small amplitudes that never break away: a compliant contact shows its stiffness there",
    .rivals = rivals,
    .strength = std::nullopt,  // it replaces a law
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
      for (const double elastic_share : {0.0, 0.5, 0.9}) {
        starts.push_back({times * knee, damping(times * knee), elastic_share});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p) const override {
    return "The contact gives way elastically before it slips, with a tangential stiffness of " +
           number_text(p[0]) + " N/m.";
  }

  unsigned hooks() const override { return hook::coefficients; }
  void shape(Structure& structure) const override { structure.kinetics = Kinetics::bristle; }
  template <class T>
  void set_coefficients(Coefficients<T>& c, const T* p) const {
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
