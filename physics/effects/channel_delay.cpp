#include <algorithm>
#include <array>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "delay_s",
                                                 .unit = "s",
                                                 .meaning = "how much later",
                                                 .low = -0.03,
                                                 .high = 0.03,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.003}};
constexpr std::array<std::string_view, 2> rivals = {"differentiator_lag", "load_cell_resonance"};
constexpr Card entry = {
    .id = "channel_delay",
    .relation = Relation::sensor,
    .name = "late channel",
    .sentence = "One channel arrives later than the others.",
    .equation = "reading(t) = quantity(t - delay_s)",
    .parameters = parameters,
    .experiment = "a tap that all channels feel at once",
    .rivals = rivals,
};

class ChannelDelay final : public EffectOf<ChannelDelay> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override { return !place.from && place.channel; }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{std::max(0.002, scales.sample_period_s)}};
  }
  std::string statement(std::span<const double> p) const override {
    return "The channel is late by " + number_text(1.0e3 * p[0]) + " ms.";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void misread_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].delay_s = p[0];
    laws.wrong = true;
    laws.late = true;
  }
};

}  // namespace

const Effect& channel_delay() {
  static const ChannelDelay effect;
  return effect;
}

}  // namespace stickslip::physics
