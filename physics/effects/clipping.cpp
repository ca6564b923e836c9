// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "limit",
                                                 .unit = "unit of the channel",
                                                 .meaning = "largest magnitude of the reading",
                                                 .low = 1e-09,
                                                 .high = 1000000000.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt,
                                                 .formula_uncertainty = 0.003}};
constexpr std::array<std::string_view, 2> rivals = {"gain_error", "end_stop"};
constexpr std::array example = {0.015};
constexpr Card entry = {
    .id = "clipping",
    .relation = Relation::sensor,
    .name = "clipping",
    .sentence = "One channel saturates: larger magnitudes are read as its limit.",
    .equation = "reading = the true value, limited to +-limit",
    .parameters = parameters,
    .experiment = "a run at half the amplitude, or with the next larger range of the amplifier",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .strength = std::nullopt,  // it vanishes as the limit grows
    .example = example,
};

class Clipping final : public EffectOf<Clipping> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override {
    return !place.from && place.channel &&
           index_of(*place.channel) <= index_of(Channel::normal_load);
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    return {{0.98 * scales.channel.largest}, {scales.channel.pile}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The " + channel_words(place.channel) + " saturates at " + reading_text(p[0], place) +
           ".";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].limit = p[0];
    laws.any_error = true;
  }
};

}  // namespace

const Effect& clipping() {
  static const Clipping effect;
  return effect;
}

}  // namespace stickslip::physics
