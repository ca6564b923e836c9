// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "coefficient",
                  .unit = "unit of this channel over that of the other",
                  .meaning = "reading per unit of the other channel",
                  .low = -100.0,
                  .high = 100.0,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 2> rivals = {"gain_error", "second_mode"};
constexpr std::array example = {0.01};
constexpr Card entry = {
    .id = "crosstalk",
    .relation = Relation::sensor,
    .name = "crosstalk",
    .sentence = "One channel picks up a fraction of another one.",
    .equation = "reading + coefficient times the other channel",
    .parameters = parameters,
    .experiment = "excite only the other sensor",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .example = example,
};

class Crosstalk final : public EffectOf<Crosstalk> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override {
    const auto mechanical = [](const std::optional<Channel>& channel) {
      return channel && index_of(*channel) <= index_of(Channel::normal_load);
    };
    return mechanical(place.channel) && mechanical(place.from) && place.channel != place.from;
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The " + channel_words(place.channel) + " picks up " +
           (place.from ? "the " + channel_words(place.from) : "another one") +
           ", with a coefficient of " + number_text(p[0]) + ".";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    ReadingLaw<T>& law = laws.of[index_of(*place.channel)];
    law.crosstalk = p[0];
    law.crosstalk_from = place.from;
    laws.any_error = true;
  }
};

}  // namespace

const Effect& crosstalk() {
  static const Crosstalk effect;
  return effect;
}

}  // namespace stickslip::physics
