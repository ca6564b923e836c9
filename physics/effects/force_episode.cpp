// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "physics/effect.h"
#include "physics/episode.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr std::array parameters = {ParameterCard{.name = "force_n",
                                                 .unit = "N",
                                                 .meaning = "force towards +x",
                                                 .low = -1000.0,
                                                 .high = 1000.0,
                                                 .positive = false,
                                                 .fixed_default = std::nullopt},
                                   begin_parameter, end_parameter};
constexpr std::array<std::string_view, 1> rivals = {"bias_force"};
constexpr std::array<std::string_view, 1> depends_on = {"time"};
constexpr std::array example = {0.05, 12.0, 17.0};
constexpr Card entry = {
    .id = "force_episode",
    .relation = Relation::force_balance,
    .name = "episode of an extra force",
    .sentence = "For a limited time a constant force acts on the mass, as from a cable or a touch.",
    .equation = "force_n on the mass from begin_s to end_s",
    .parameters = parameters,
    .experiment = "the same run repeated: an episode does not recur",
    .rivals = rivals,
    .depends_on = depends_on,
    .tier = Tier::formula,
    .episode = Episode{.begin_s = 1, .end_s = 2},
    .example = example,
};

class ForceEpisode final : public EffectOf<ForceEpisode> {
 public:
  const Card& card() const override { return entry; }

  bool can_be_missing_from(const Model& model) const override {
    return model.oscillator.excitation != Excitation::imposed;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<std::vector<double>> starts;
    for (const auto& [begin, end] : scales.episodes_s)
      starts.push_back({0.02 * scales.force_n, begin, end});
    return starts;
  }
  std::string statement(std::span<const double> p, const Place& /*place*/) const override {
    return "From " + number_text(p[1]) + " s to " + number_text(p[2]) + " s a force of " +
           number_text(p[0]) + " N acts on the mass.";
  }

  unsigned hooks() const override { return hook::force; }
  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    return -(p[0] * during(at.time_s, p[1], p[2]));
  }
};

}  // namespace

const Effect& force_episode() {
  static const ForceEpisode effect;
  return effect;
}

}  // namespace stickslip::physics
