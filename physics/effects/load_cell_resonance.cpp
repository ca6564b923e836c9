#include <algorithm>
#include <array>
#include <numbers>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
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
constexpr Card entry = {
    .id = "load_cell_resonance",
    .relation = Relation::load_cell,
    .name = "ringing load cell",
    .sentence =
        "The load cell rings: what it reads is not the friction force alone but its own vibration "
        "too.",
    .equation =
        "m_l y'' + c_l y' + k_l y - f = -m_l b'' where the model had Eq. (1), k_l = m_l (2 pi "
        "frequency_hz)^2",
    .parameters = parameters,
    .experiment = "a tap on the load cell with the contact lifted",
    .rivals = rivals,
    .strength = std::nullopt,  // it replaces a law
};

class LoadCellResonance final : public EffectOf<LoadCellResonance> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.load_cell && model.load_cell->dynamics == LoadCellDynamics::quasi_static &&
           model.oscillator.excitation != Excitation::imposed;
  }
  void mark(Model& model) const override {
    if (model.load_cell) model.load_cell->dynamics = LoadCellDynamics::resonant;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{scales.cell_frequency_hz, std::max(0.005, scales.cell_damping_ratio)}};
  }
  std::string statement(std::span<const double> p) const override {
    return "The load cell is not stiff: it rings at " + number_text(p[0]) +
           " Hz with a damping ratio of " + number_text(p[1]) + " after every break-away.";
  }

  unsigned hooks() const override { return hook::coefficients; }
  void shape(Structure& structure) const override { structure.resonant = structure.load_cell; }
  template <class T>
  void set_coefficients(Coefficients<T>& c, const T* p) const {
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
