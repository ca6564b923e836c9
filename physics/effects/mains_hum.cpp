// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

// Amplitude modulation by a harmonic of the duration of the recording, relative to the mean.
constexpr ParameterCard modulation(std::string_view name) {
  return {.name = name,
          .unit = "1",
          .meaning = "modulation of the amplitude by a harmonic of the recording's duration",
          .low = -1.0,
          .high = 1.0,
          .fixed_default = 0.0,
          .estimated = true};
}

constexpr std::array parameters = {
    ParameterCard{.name = "frequency_hz",
                  .unit = "Hz",
                  .meaning = "frequency of the hum",
                  .low = 10.0,
                  .high = 500.0,
                  .positive = true,
                  .fixed_default = std::nullopt,
                  .formula_uncertainty = 0.003},
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
                  .fixed_default = std::nullopt},
    modulation("wander_cos_1"),
    modulation("wander_sin_1"),
    modulation("wander_cos_2"),
    modulation("wander_sin_2"),
    modulation("wander_cos_3"),
    modulation("wander_sin_3"),
    modulation("wander_cos_4"),
    modulation("wander_sin_4"),
    ParameterCard{.name = "wander_over_s",
                  .unit = "s",
                  .meaning = "period of the first harmonic of the modulation",
                  .low = 1.0e-3,
                  .high = 1.0e6,
                  .positive = true,
                  .fixed_default = 30.0}};
constexpr std::array<std::string_view, 2> rivals = {"ambient_vibration", "second_mode"};
constexpr std::array example = {50.0, 2.0e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 30.0};
constexpr Card entry = {
    .id = "mains_hum",
    .relation = Relation::sensor,
    .name = "hum",
    .sentence = "One channel picks up a sine, as from the mains or a motor.",
    .equation =
        "reading + amplitude (1 + w(t)) sin(2 pi frequency_hz t + phase_rad); w, of mean 0, "
        "consists of four harmonics of the recording's duration",
    .parameters = parameters,
    .experiment = "a recording with the rig at rest",
    .rivals = rivals,
    .strength = 1,
    .frequency = Frequency{.parameter = 0, .tone = true},
    .example = example,
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
    return {{line.frequency_hz, line.amplitude, line.phase_rad, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
             0.0, scales.duration_s}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    double square = 0.0;
    for (std::size_t i = 3; i < 11; ++i) square += 0.5 * p[i] * p[i];
    const double modulation = std::sqrt(square);
    return "The " + channel_words(place.channel) + " picks up a hum of " + number_text(p[0]) +
           " Hz with an amplitude of " + reading_text(p[1], place) +
           (modulation > 0.02 ? ", modulated by " + number_text(100.0 * modulation) + " %" : "") +
           ".";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    ReadingLaw<T>& law = laws.of[index_of(*place.channel)];
    law.hum_frequency_hz = p[0];
    law.hum_amplitude = p[1];
    law.hum_phase_rad = p[2];
    for (std::size_t i = 0; i < law.hum_modulation.size(); ++i) law.hum_modulation[i] = p[3 + i];
    law.hum_modulation_s = value_of(p[3 + law.hum_modulation.size()]);
    laws.any_error = true;
  }
};

}  // namespace

const Effect& mains_hum() {
  static const MainsHum effect;
  return effect;
}

}  // namespace stickslip::physics
