// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/contact_laws.h"
#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {mu_card, stiffness_card, yield_spread_card};
constexpr std::array<std::string_view, 2> references = {
    "W. D. Iwan, A distributed-element model for hysteresis and its steady-state dynamic response, "
    "Journal of Applied Mechanics, 1966",
    "G. M. Jenkins, Analysis of the stress-strain relationships in reactor grade graphite, British "
    "Journal of Applied Physics, 1962"};
constexpr std::array example = {0.8, 60.0, 0.8};
constexpr auto includes = bristle_includes;
constexpr Card entry = {
    .id = "iwan",
    .relation = Relation::friction_law,
    .name = "Iwan's law",
    .sentence = "Parallel springs with sliders, which slip one after the other, carry the contact.",
    .equation =
        "f = sum of four elements i = 1 to 4 of stiffness stiffness_n_m / 4, which stick up "
        "to mu N / 4 (1 + yield_spread (2 i - 5) / 4)",
    .parameters = parameters,
    .experiment =
        "slow loops of several sizes: each branch is the first loading twice as large "
        "(Masing's rule)",
    .rivals = {},
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class Iwan final : public LawOf<Iwan> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    return {{start.mu, 5.0 * start.knee_n_m, 0.5},
            {start.mu, 30.0 * start.knee_n_m, 0.5},
            {start.mu, 200.0 * start.knee_n_m, 0.5}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction is that of parallel elements which slip in turn (Iwan): mu = " +
           number_text(p[0]) + ", a stiffness before slip of " + number_text(p[1]) + " N/m.";
  }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::bristle;
    structure.elements = parallel_elements;
  }
  int state_count() const override { return parallel_elements - 1; }
  // Up to the deflection at which an element of the mean slip force slips.
  StateSize state_size(int /*index*/, std::span<const double> p,
                       const Scales& scales) const override {
    return {0.7 * p[0] * scales.mean_load_n / p[1], 0.9 * p[0] * scales.mean_load_n / p[1]};
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.contact_stiffness = p[1];
    c.yield_spread = p[2] < 0.0 ? T(0.0) : (p[2] > 1.0 ? T(1.0) : p[2]);
  }
};

}  // namespace

const Effect& iwan_law() {
  static const Iwan effect;
  return effect;
}

}  // namespace stickslip::physics
