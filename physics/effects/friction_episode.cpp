// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/episode.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "share",
                                                 .unit = "1",
                                                 .meaning = "relative change of the friction",
                                                 .low = -1.0,
                                                 .high = 5.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt},
                                   begin_parameter, end_parameter};
constexpr std::array<std::string_view, 1> rivals = {"friction_drift"};
constexpr std::array<std::string_view, 1> depends_on = {"time"};
constexpr std::array example = {0.2, 12.0, 17.0};
constexpr Card entry = {
    .id = "friction_episode",
    .relation = Relation::friction_law,
    .name = "episode of changed friction",
    .sentence =
        "For a limited time the coefficient of friction differs, as from dust or a drop of oil.",
    .equation = "mu (1 + share) from begin_s to end_s",
    .parameters = parameters,
    .experiment = "the same run repeated: an episode does not recur",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .episode = Episode{.begin_s = 1, .end_s = 2},
    .example = example,
};

class FrictionEpisode final : public EffectOf<FrictionEpisode> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.friction.law != FrictionLaw::none;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<std::vector<double>> starts;
    for (const auto& [begin, end] : scales.episodes_s) starts.push_back({0.02, begin, end});
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "From " + number_text(p[1]) + " s to " + number_text(p[2]) + " s friction differs by " +
           number_text(100.0 * p[0]) + " %.";
  }

  unsigned hooks() const override { return hook::friction; }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    const T factor = 1.0 + p[0] * during(at.time_s, p[1], p[2]);
    f.mu = f.mu * (factor > 0.0 ? factor : T(0.0));
  }
};

}  // namespace

const Effect& friction_episode() {
  static const FrictionEpisode effect;
  return effect;
}

}  // namespace stickslip::physics
