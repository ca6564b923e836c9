// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "frequency_hz",
                                                 .unit = "Hz",
                                                 .meaning = "natural frequency of the load cell",
                                                 .low = 5.0,
                                                 .high = 500.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.003},
                                   ParameterCard{.name = "damping_ratio",
                                                 .unit = "1",
                                                 .meaning = "its damping ratio",
                                                 .low = 0.001,
                                                 .high = 0.5,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 3> rivals = {"channel_delay", "contact_compliance",
                                                    "second_mode"};
constexpr std::array<std::string_view, 1> references = {
    "J. L. Streator and D. B. Bogy, Accounting for transducer dynamics in the measurement of "
    "friction, Journal of Tribology, 1992"};
constexpr std::array example = {19.3, 0.016};
constexpr Card entry = {
    .id = "load_cell_resonance",
    .relation = Relation::load_cell,
    .name = "resonant load cell",
    .sentence =
        "The load cell resonates: its reading contains its own vibration besides the friction "
        "force.",
    .equation =
        "m_l y'' + c_l y' + k_l y - f = -m_l b'' in place of Eq. (1), k_l = m_l (2 pi "
        "frequency_hz)^2",
    .parameters = parameters,
    .experiment = "a tap on the load cell with the contact lifted",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .strength = std::nullopt,  // it replaces a law
    .frequency = Frequency{.parameter = 0},
    .references = references,
    .example = example,
};

class LoadCellResonance final : public EffectOf<LoadCellResonance> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.load_cell && model.load_cell->dynamics == LoadCellDynamics::quasi_static &&
           model.oscillator.excitation != Excitation::imposed;
  }
  void amend(Model& model) const override {
    if (model.load_cell) model.load_cell->dynamics = LoadCellDynamics::resonant;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{scales.cell_frequency_hz, std::max(0.005, scales.cell_damping_ratio)}};
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "The load cell is not stiff: it rings at " + number_text(p[0]) +
           " Hz with a damping ratio of " + number_text(p[1]) + " after every break-away.";
  }

  std::vector<LawCurve> law_curves(std::span<const double> p, std::span<const double> reference,
                                   double /*friction_n*/) const override {
    return {{"frequency", "Hz", 0.0, 2.5 * reference[0], "reading over force", "1",
             [own_hz = p[0], damping = p[1]](double at) {
               const double r = at / own_hz;
               return 1.0 / std::hypot(1.0 - r * r, 2.0 * damping * r);
             }}};
  }

  unsigned hooks() const override { return hook::coefficients; }
  void set_structure(Structure& structure) const override {
    structure.resonant = structure.load_cell;
  }
  template <class T>
  void coefficients_of(Coefficients<T>& c, const T* p) const {
    const T frequency_rad_s = p[0] * (2.0 * std::numbers::pi);
    c.cell_stiffness = c.cell_mass * frequency_rad_s * frequency_rad_s;
    c.cell_damping = 2.0 * p[1] * c.cell_mass * frequency_rad_s;
  }
};

}  // namespace

const Effect& load_cell_resonance() {
  static const LoadCellResonance effect;
  return effect;
}

}  // namespace stickslip::physics
