// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {mu_card, stiffness_card};
constexpr std::array<std::string_view, 1> references = {
    "P. R. Dahl, A solid friction model, The Aerospace Corporation, 1968"};
constexpr std::array example = {0.8, 60.0};
constexpr auto includes = bristle_includes;
constexpr Card entry = {
    .id = "dahl",
    .relation = Relation::friction_law,
    .name = "Dahl's law",
    .sentence =
        "The contact deflects like a solid before it slips, more easily the nearer it is "
        "to slipping.",
    .equation = "f = stiffness_n_m z, z' = v - abs(v) z stiffness_n_m / (mu N)",
    .parameters = parameters,
    .experiment = "slow loops of several sizes below and above the break-away deflection",
    .rivals = {},
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class Dahl final : public LawOf<Dahl> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    return {{start.mu, 5.0 * start.knee_n_m},
            {start.mu, 30.0 * start.knee_n_m},
            {start.mu, 200.0 * start.knee_n_m}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction follows Dahl's law with mu = " + number_text(p[0]) +
           " and a stiffness before slip of " + number_text(p[1]) + " N/m.";
  }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::bristle;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.contact_stiffness = p[1];
  }
};

}  // namespace

const Effect& dahl_law() {
  static const Dahl effect;
  return effect;
}

}  // namespace stickslip::physics
