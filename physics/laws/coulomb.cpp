// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {mu_card, transition_speed_card};
constexpr std::array<std::string_view, 1> references = {
    "J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Transactions "
    "of the ASME, 1931"};
constexpr std::array example = {0.8, 0.0025};
constexpr Card entry = {
    .id = "coulomb",
    .relation = Relation::friction_law,
    .name = "Coulomb's law",
    .sentence = "Friction opposes the slip with a force that does not depend on its speed.",
    .equation =
        "theta = g(v) = tanh(v / transition_speed_m_s); 0: sign(v), and any value in "
        "[-1, 1] while v = 0",
    .parameters = parameters,
    .experiment = "a free decay: the same amplitude is lost in every cycle",
    .rivals = {},
    .transition_speed = 1,
    .references = references,
    .example = example,
    .law = true,
};

class Coulomb final : public LawOf<Coulomb> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    return {{start.mu, start.transition_speed_m_s}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction follows Coulomb's law with mu = " + number_text(p[0]) + ".";
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.transition_speed = p[1];
  }
};

}  // namespace

const Effect& coulomb_law() {
  static const Coulomb effect;
  return effect;
}

}  // namespace stickslip::physics
