#include <array>
#include <cmath>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
#include "physics/effects/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "contact_stiffness_n_m",
                                                 .unit = "N/m",
                                                 .meaning = "tangential stiffness of the contact",
                                                 .low = 1.0,
                                                 .high = 1000000.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 3> rivals = {"friction_memory", "hysteresis", "stribeck"};
constexpr Card entry = {
    .id = "contact_compliance",
    .relation = Relation::friction_law,
    .name = "compliant contact",
    .sentence = "The contact is elastic: it deflects along the surface before it slips.",
    .equation = "f = k_c z, z' = v - abs(v) z k_c / (mu N): a tangential spring that slips at mu N",
    .parameters = parameters,
    .experiment =
        "small amplitudes that never break away: a compliant contact shows its stiffness there",
    .rivals = rivals,
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
    return {{10.0 * knee}, {60.0 * knee}};
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
  }
};

}  // namespace

const Effect& contact_compliance() {
  static const ContactCompliance effect;
  return effect;
}

}  // namespace stickslip::physics
