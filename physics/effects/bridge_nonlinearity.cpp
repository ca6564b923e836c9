// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {
    ParameterCard{.name = "curvature",
                  .unit = "1/unit of the channel",
                  .meaning = "relative change of the gain per unit of the reading",
                  .low = -1000.0,
                  .high = 1000.0,
                  .positive = false,
                  .fixed_default = std::nullopt}};
constexpr std::array<std::string_view, 3> rivals = {"gain_error", "clipping",
                                                    "quadratic_stiffness"};
// The channels that a bridge can read; a report names the one concerned.
constexpr std::array<std::string_view, 3> depends_on = {"displacement", "friction_force",
                                                        "normal_load"};
constexpr std::array example = {15.0};
constexpr Card entry = {
    .id = "bridge_nonlinearity",
    .relation = Relation::sensor,
    .name = "nonlinear bridge",
    .sentence = "An unbalanced bridge overestimates large readings on one side.",
    .equation = "reading = r (1 + curvature r)",
    .parameters = parameters,
    .experiment = "a calibration of this channel at five loads on both sides of zero",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .example = example,
};

// One active arm of a Wheatstone bridge: e (1 + e / 2)^-1, to second order.
class BridgeNonlinearity final : public EffectOf<BridgeNonlinearity> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& /*model*/) const override { return true; }
  bool acts_on(const Place& place) const override {
    return !place.from && place.channel &&
           (*place.channel == Channel::displacement || *place.channel == Channel::friction_force ||
            *place.channel == Channel::normal_load);
  }
  std::vector<std::vector<double>> starts(const Scales& /*scales*/) const override {
    return {{0.0}};
  }
  std::string statement(std::span<const double> p, const Place& place) const override {
    return "The " + channel_words(place.channel) + " is nonlinear: its gain changes by " +
           number_text(100.0 * p[0]) + " % at a reading of " + reading_text(1.0, place) + ".";
  }

  unsigned hooks() const override { return hook::reading; }
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    laws.of[index_of(*place.channel)].curvature = p[0];
    laws.any_error = true;
  }
};

}  // namespace

const Effect& bridge_nonlinearity() {
  static const BridgeNonlinearity effect;
  return effect;
}

}  // namespace stickslip::physics
