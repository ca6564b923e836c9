// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/contact_laws.h"
#include "physics/laws/law.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr ParameterCard attraction_card = {
    .name = "attraction_per_s",
    .unit = "1/s",
    .meaning = "rate at which the level follows the Stribeck curve: Al-Bender's C over mu N",
    .low = 1.0,
    .high = 1000.0,
    .positive = true,
    .fixed_default = std::nullopt};
constexpr int level = parallel_elements - 1;
constexpr std::array parameters = {mu_card,        mu_static_card,    stribeck_speed_card,
                                   stiffness_card, yield_spread_card, attraction_card,
                                   viscosity_card};
constexpr std::array<std::string_view, 2> references = {
    "F. Al-Bender, V. Lampaert and J. Swevers, The generalized Maxwell-slip model: a novel model "
    "for "
    "friction simulation and compensation, IEEE Transactions on Automatic Control, 2005",
    "V. Lampaert, F. Al-Bender and J. Swevers, A generalized Maxwell-slip friction model "
    "appropriate for control purposes, IEEE Conference on Physics and Control, 2003"};
constexpr std::array example = {0.6, 0.8, 0.05, 60.0, 0.5, 100.0, 0.05};
constexpr auto includes = bristle_and_stribeck_include;
constexpr Card entry = {
    .id = "gms",
    .relation = Relation::friction_law,
    .name = "generalised Maxwell-slip law",
    .sentence =
        "Parallel elements stick until they slip, at a level that follows a Stribeck curve "
        "with a lag.",
    .equation =
        "f = viscosity_n_s_m v + sum of four elements of stiffness stiffness_n_m / 4, which "
        "stick up to shares mu N s (1 + yield_spread (2 i - 5) / 4) / 4; in slip F' = "
        "sign(v) share attraction_per_s mu N (1 - s / g(v)): s' = attraction_per_s (1 - s "
        "/ g(v)), g(v) = 1 + (mu_static / mu - 1) exp(-(v / stribeck_speed_m_s)^2)",
    .parameters = parameters,
    .experiment =
        "small loops before slip, slow steady sliding, and a fast sinusoid of positive "
        "velocity, which shows the lag",
    .rivals = {},
    .references = references,
    .example = example,
    .law = true,
    .includes = includes,
};

class GeneralisedMaxwellSlip final : public LawOf<GeneralisedMaxwellSlip> {
 public:
  const Card& card() const override { return entry; }

  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const LawStart start(scales);
    std::vector<std::vector<double>> starts;
    for (const double times : {5.0, 30.0, 200.0}) {
      for (const double share : {0.05, 0.3}) {
        starts.push_back({start.mu, 1.2 * start.mu, share * scales.velocity_m_s,
                          times * start.knee_n_m, 0.5, 100.0, start.viscosity_n_s_m});
      }
    }
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction is that of parallel elements whose level lags behind a Stribeck curve (GMS): "
           "from mu_static = " +
           number_text(p[1]) + " to mu = " + number_text(p[0]) + " above about " +
           number_text(p[2]) + " m/s.";
  }
  unsigned hooks() const override { return hook::coefficients | hook::friction; }
  void set_structure(Structure& structure) const override {
    structure.friction = true;
    structure.kinetics = Kinetics::bristle;
    structure.elements = parallel_elements;
  }
  // The deflections of the elements after the first, then the excess s - 1 of the level.
  int state_count() const override { return parallel_elements; }
  StateSize state_size(int index, std::span<const double> p, const Scales& scales) const override {
    if (index == level) return {std::abs(p[1] / p[0] - 1.0) + 0.01, 0.0};
    const double most = p[0] * scales.mean_load_n / p[3];
    return {0.7 * most, 0.9 * most};
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    c.mu = p[0];
    c.contact_stiffness = p[3];
    c.yield_spread = p[4] < 0.0 ? T(0.0) : (p[4] > 1.0 ? T(1.0) : p[4]);
    c.contact_viscosity = p[6];
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& /*at*/, const T* /*p*/,
                         const T* s) const {
    f.backbone = f.backbone * (1.0 + s[level]);
  }
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    constexpr double fastest_per_s = 1000.0;  // what an integration step, and any sensor, resolves
    const T attraction = p[5] / (1.0 + p[5] * (1.0 / fastest_per_s));
    rate[level] =
        attraction * (1.0 - (1.0 + s[level]) / stribeck_factor(at.slip, p[0], p[1], p[2]));
  }
  template <class T>
  void confine_of(T* s, const T* p) const {
    const T most = p[1] / p[0] - 1.0;
    const bool rises = value_of(most) > 0.0;
    const T low = rises ? T(0.0) : most;
    const T high = rises ? most : T(0.0);
    if (s[level] < low) s[level] = low;
    if (s[level] > high) s[level] = high;
  }
};

}  // namespace

const Effect& gms_law() {
  static const GeneralisedMaxwellSlip effect;
  return effect;
}

}  // namespace stickslip::physics
