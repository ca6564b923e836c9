#include <array>
#include <cmath>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
#include "physics/effects/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "frequency_hz",
                  .unit = "Hz",
                  .meaning = "frequency of the hum",
                  .low = 10.0,
                  .high = 500.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_doubt = 0.003},
    ParameterCard{.name = "amplitude",
                  .unit = "unit of the channel",
                  .meaning = "its amplitude",
                  .low = 1e-12,
                  .high = 1000000.0,
                  .positive = true,
                  .fixed_default = std::nullopt},
    ParameterCard{.name = "phase_rad",
                  .unit = "rad",
                  .meaning = "its phase at the beginning of the recording",
                  .low = -6.3,
                  .high = 6.3,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"ambient_vibration", "second_mode"};
constexpr Card entry = {
    .id = "mains_hum",
    .relation = Relation::sensor,
    .name = "mains hum",
    .sentence = "A sine of the line frequency rides on one channel.",
    .equation = "reading + amplitude sin(2 pi frequency_hz t + phase_rad)",
    .parameters = parameters,
    .experiment = "a recording with the rig at rest",
    .rivals = rivals,
};

class MainsHum final : public EffectOf<MainsHum> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override {
    return !place.from && place.channel &&
           index_of(*place.channel) <= index_of(Channel::normal_load);
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    const Line& line = scales.channel.line;
    if (!(line.amplitude > 0.0)) return {};
    return {{line.frequency_hz, line.amplitude, line.phase_rad}};
  }
  std::string statement(std::span<const double> p) const override {
    return "A hum of " + number_text(p[0]) + " Hz with an amplitude of " + number_text(p[1]) +
           " rides on the channel.";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void misread_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    ReadingLaw<T>& law = laws.of[index_of(*place.channel)];
    law.hum_frequency_hz = p[0];
    law.hum_amplitude = p[1];
    law.hum_phase_rad = p[2];
    laws.wrong = true;
  }
};

}  // namespace

const Effect& mains_hum() {
  static const MainsHum effect;
  return effect;
}

}  // namespace stickslip::physics
