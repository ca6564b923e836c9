// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr ParameterCard damping_card = {.name = "damping_n_s_m",
                                        .unit = "N s/m",
                                        .meaning = "damping of the bristles' deflection",
                                        .low = 1.0e-6,
                                        .high = 100.0,
                                        .positive = true,
                                        .fixed_default = 0.0,
                                        .estimated = true,
                                        .start_sigma = 2.0};
constexpr std::array parameters = {mu_card,        mu_static_card, stribeck_speed_card,
                                   stiffness_card, damping_card,   viscosity_card};
constexpr std::array<std::string_view, 1> references = {
    "C. Canudas de Wit, H. Olsson, K. J. \u00c5str\u00f6m and P. Lischinsky, A new model for "
    "control of systems with friction, IEEE Transactions on Automatic Control, 1995"};
constexpr std::array example = {0.6, 0.8, 0.05, 60.0, 0.1, 0.05};
constexpr auto includes = bristle_and_stribeck_include;
constexpr Card entry = {
    .id = "lugre",
    .relation = Relation::friction_law,
    .name = "LuGre law",
    .sentence =
        "Bristles in the contact deflect, damp, and slip at a level that falls with the "
        "speed.",
    .equation =
        "f = stiffness_n_m z + damping_n_s_m z' + viscosity_n_s_m v, "
        "z' = v - abs(v) z stiffness_n_m / (N g(v)), "
        "g(v) = mu + (mu_static - mu) exp(-(v / stribeck_speed_m_s)^2)",
    .parameters = parameters,
    .experiment =
        "break-away at several loading rates, small loops before slip, and slow steady "
        "sliding",
    .rivals = {},
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class LuGre final : public LawOf<LuGre> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    std::vector<std::vector<double>> starts;
    for (const double times : {5.0, 30.0, 200.0}) {
      for (const double share : {0.05, 0.3}) {
        const double stiffness = times * start.knee_n_m;
        starts.push_back({start.mu, 1.2 * start.mu, share * scales.velocity_m_s, stiffness,
                          0.1 * std::sqrt(stiffness * scales.mass_kg), start.viscosity_n_s_m});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction follows the LuGre law: from mu_static = " + number_text(p[1]) +
           " to mu = " + number_text(p[0]) + " above about " + number_text(p[2]) +
           " m/s, with a stiffness before slip of " + number_text(p[3]) + " N/m.";
  }
  unsigned hooks() const override { return hook::coefficients | hook::slip_friction; }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::bristle;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.contact_stiffness = p[3];
    c.contact_damping = p[4];
    c.contact_viscosity = p[5];
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    f.backbone = f.backbone * stribeck_factor(at.slip, p[0], p[1], p[2]);
  }
};

}  // namespace

const Effect& lugre_law() {
  static const LuGre effect;
  return effect;
}

}  // namespace stickslip::physics
