// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/contact_renewal.h"
#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "share",
                  .unit = "1",
                  .meaning = "share of a relative change of the load that friction follows only "
                             "with slip",
                  .low = -2.0,
                  .high = 2.0,
                  .positive = false,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "slip_length_m",
                  .unit = "m",
                  .meaning = "slip over which friction follows the load",
                  .low = 1e-06,
                  .high = 0.1,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "reference_load_n",
                  .unit = "N",
                  .meaning = "typical load, for scaling only",
                  .low = 1e-03,
                  .high = 1000.0,
                  .positive = true,
                  .fixed_default = 1.0}};
constexpr std::array<std::string_view, 3> rivals = {"load_dependent_mu", "channel_delay",
                                                    "friction_memory"};
constexpr std::array<std::string_view, 2> depends_on = {"normal_load", "displacement"};
constexpr std::array<std::string_view, 1> references = {
    "M. F. Linker and J. H. Dieterich, Effects of variable normal stress on rock friction: "
    "observations and constitutive equations, Journal of Geophysical Research, 1992"};
constexpr std::array example = {1.0, 0.02, 0.15};
constexpr Card entry = {
    .id = "load_history",
    .relation = Relation::friction_law,
    .name = "delayed response of friction to the load",
    .sentence = "When the load changes, friction follows only after some slip.",
    .equation = "mu (1 - share (ln(N / N0) - s)), s' = abs(v) / slip_length_m (ln(N / N0) - s)",
    .parameters = parameters,
    .experiment = "steps of the normal load while the contact slips steadily",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .references = references,
    .example = example,
};

// Linker and Dieterich (1992): a step of the normal stress offsets the state of the contacts, and
// slip restores it.
class LoadHistory final : public EffectOf<LoadHistory> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none && model.normal_load.has_value() &&
           model.normal_load->law != NormalLoadLaw::constant;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const double load = std::max(scales.mean_load_n, 1.0e-9);
    return {{0.0, 0.003 * scales.velocity_m_s, load}, {0.0, 0.03 * scales.velocity_m_s, load}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "Friction responds to a change of the load with a delay: " + number_text(100.0 * p[0]) +
           " % of it only after " + number_text(1.0e3 * p[1]) + " mm of slip.";
  }

  unsigned hooks() const override { return hook::friction; }
  int state_count() const override { return 1; }
  StateSize state_size(int /*index*/, std::span<const double> /*p*/,
                       const Scales& scales) const override {
    const double low = std::max(scales.lowest_load_n, 1.0e-2 * scales.highest_load_n);
    return {
        0.5 * std::log(std::max(scales.highest_load_n, 1.0e-12) / std::max(low, 1.0e-12)) + 0.05,
        0.0};
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* s) const {
    f.mu = f.mu * (1.0 - p[0] * (logarithm(at.load, p[2]) - s[0]));
  }
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    using std::abs;
    rate[0] = decay_per_s(T(logarithm(at.load, p[2]) - s[0]), T(abs(at.slip)), p[1]);
  }

 private:
  // Logarithm of the relative load, regularised at loss of contact.
  template <class T>
  static T logarithm(const T& load, const T& reference) {
    using std::log;
    return log(load / reference + 0.02);
  }
};

}  // namespace

const Effect& load_history() {
  static const LoadHistory effect;
  return effect;
}

}  // namespace stickslip::physics
