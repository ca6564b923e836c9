// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "gain",
                                                 .unit = "1",
                                                 .meaning = "reading over true value",
                                                 .low = 0.2,
                                                 .high = 5.0,
                                                 .positive = true,
                                                 .fixed_default = std::nullopt,
                                                 .neutral = 1.0}};
constexpr std::array<std::string_view, 2> rivals = {"load_dependent_mu", "cubic_stiffness"};
constexpr std::array example = {1.1};
constexpr Card entry = {
    .id = "gain_error",
    .relation = Relation::sensor,
    .name = "wrong gain",
    .sentence =
        "The calibration of one channel is off: it reads a fixed multiple of the true value.",
    .equation = "reading = gain times the true value",
    .parameters = parameters,
    .experiment = "a calibration of this channel with a known standard",
    .rivals = rivals,
    .formula_residual = exact_formula,
    .example = example,
};

class GainError final : public EffectOf<GainError> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override { return !place.from && place.channel; }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{1.0}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The " + channel_words(place.channel) + " reads " + number_text(p[0]) +
           " times the true value.";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].gain *= p[0];
    laws.any_error = true;
  }
};

}  // namespace

const Effect& gain_error() {
  static const GainError effect;
  return effect;
}

}  // namespace stickslip::physics
