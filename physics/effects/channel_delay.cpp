// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "delay_s",
                                                 .unit = "s",
                                                 .meaning = "delay relative to the other channels",
                                                 .low = -0.03,
                                                 .high = 0.03,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.003}};
constexpr std::array<std::string_view, 2> rivals = {"differentiator_lag", "load_cell_resonance"};
constexpr std::array example = {0.02};
constexpr Card entry = {
    .id = "channel_delay",
    .relation = Relation::sensor,
    .name = "delayed channel",
    .sentence = "One channel lags the others by a constant time.",
    .equation = "reading(t) = quantity(t - delay_s)",
    .parameters = parameters,
    .experiment = "a tap that excites all channels simultaneously",
    .rivals = rivals,
    .example = example,
};

class ChannelDelay final : public EffectOf<ChannelDelay> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override { return !place.from && place.channel; }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{std::max(0.002, scales.sample_period_s)}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The " + channel_words(place.channel) + " is delayed by " + number_text(1.0e3 * p[0]) +
           " ms.";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].delay_s += p[0];
    laws.any_error = true;
    laws.any_delay = true;
  }
};

}  // namespace

const Effect& channel_delay() {
  static const ChannelDelay effect;
  return effect;
}

}  // namespace stickslip::physics
