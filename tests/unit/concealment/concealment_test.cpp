// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/concealment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "physics/catalogue.h"
#include "physics/model_consistency.h"
#include "tools/concealment/hidden_effect.h"

namespace stickslip::concealment {
namespace {

CaseRequest request_for(const std::string& id) {
  CaseRequest request;
  request.ids = {id};
  request.duration_s = 10.0;
  return request;
}

TEST(Concealment, CoversEveryListedEffect) {
  std::set<std::string> listed;
  for (const physics::Effect* effect : physics::catalogue()) {
    if (effect->hooks() == 0) continue;  // a number of the model, no term
    if (effect->card().depends_on.empty()) listed.insert(std::string(effect->card().id));
  }
  std::set<std::string> hidden;
  for (const HiddenEffect& each : hidden_effects()) {
    if (each.listed) hidden.insert(std::string(each.id));
  }
  EXPECT_EQ(hidden, listed);
}

TEST(Concealment, EveryHiddenEffectHasTheParametersOfTheCatalogue) {
  for (const HiddenEffect& each : hidden_effects()) {
    ASSERT_FALSE(each.benches.empty()) << each.id;
    for (const BenchKind kind : each.benches) {
      RandomSource random(3);
      Bench bench = draw_bench(kind, each.requirements, random);
      Sizes sizes;
      sizes.spread.fill(0.01);
      sizes.largest.fill(0.02);
      const TrueEffect effect = hide(each, 1.0, sizes, bench, RandomSource(5));
      ASSERT_EQ(effect.relations.size(), 1U) << each.id;
      if (!each.listed) {
        EXPECT_EQ(effect.id, "unlisted");
        EXPECT_FALSE(effect.depends_on.empty()) << each.id;
        continue;
      }
      const physics::Effect* entry = physics::find_effect(effect.id);
      ASSERT_NE(entry, nullptr) << each.id;
      EXPECT_EQ(effect.relations[0], physics::name_of(entry->card().relation)) << each.id;
      EXPECT_EQ(effect.channel.has_value(), entry->card().relation == physics::Relation::sensor)
          << each.id;
      for (const auto& [name, parameter] : effect.parameters) {
        const auto cards = entry->card().parameters;
        EXPECT_TRUE(std::any_of(cards.begin(), cards.end(),
                                [&](const auto& card) { return card.name == name; }))
            << each.id << " " << name;
        EXPECT_NE(parameter.value, parameter.reference) << each.id << " " << name;
      }
    }
  }
}

TEST(Concealment, DependsOnTheSeedOnly) {
  const Case one = conceal(request_for("cubic_stiffness"), 17, "case-001");
  const Case again = conceal(request_for("cubic_stiffness"), 17, "case-001");
  const Case other = conceal(request_for("cubic_stiffness"), 18, "case-001");
  EXPECT_EQ(truth_text(one.truth), truth_text(again.truth));
  EXPECT_EQ(one.recording.frames, again.recording.frames);
  EXPECT_EQ(one.declared, again.declared);
  EXPECT_NE(one.recording.frames, other.recording.frames);
}

TEST(Concealment, HiddenEffectsAreVisibleAndNotInTheModel) {
  for (const char* id : {"cubic_stiffness", "gain_error", "friction_memory", "passing_friction"}) {
    const Case made = conceal(request_for(id), 5, "case-001");
    ASSERT_EQ(made.truth.effects.size(), 1U);
    EXPECT_GE(made.truth.effects[0].snr, 4.0) << id;
    EXPECT_GE(made.truth.effects[0].snr_after_calibration, 1.2) << id;
    EXPECT_TRUE(made.declared.terms.empty());
    EXPECT_TRUE(physics::inconsistencies_of(made.declared).empty());
    EXPECT_NE(made.recording.frames.front(), made.validation.frames.front());
    EXPECT_EQ(made.truth.effects[0].when_s.empty(), std::string(id) != "passing_friction");
  }
}

TEST(Concealment, WeakEffectsHaveTheRequestedSize) {
  CaseRequest request = request_for("bias_force");
  request.snr = SnrRange{0.5, 1.0};
  const Case made = conceal(request, 21, "case-001");
  EXPECT_GE(made.truth.effects[0].snr, 0.5);
  EXPECT_LE(made.truth.effects[0].snr, 1.0);
  EXPECT_GE(made.truth.effects[0].snr_after_calibration, 0.15);
}

TEST(Concealment, ATripleHidesThreeDifferentEffects) {
  CaseRequest request;
  request.kind = CaseRequest::Kind::triple;
  request.duration_s = 10.0;
  const Case made = conceal(request, 6, "case-001");
  EXPECT_EQ(made.truth.kind, "triple");
  std::set<std::string> ids;
  for (const TrueEffect& effect : made.truth.effects) ids.insert(effect.id);
  EXPECT_EQ(ids.size(), 3U);
}

TEST(Concealment, ImperfectInstrumentsAreOfTheRigAndOfTheSecondModel) {
  CaseRequest request;
  request.kind = CaseRequest::Kind::nothing;
  request.duration_s = 10.0;
  request.imperfect_instruments = true;
  request.nuisances = {Nuisance::gain, Nuisance::gaps, Nuisance::jitter};
  const Case made = conceal(request, 4, "case-001");
  EXPECT_EQ(made.truth.nuisances.size(), 3U);
  EXPECT_EQ(made.states.size(), made.recording.frames.size());
  EXPECT_LT(made.recording.frames.size(), made.truth.duration_s * made.truth.sample_rate_hz);
  for (const Channel channel : all_channels) {
    EXPECT_FALSE(made.declared.sensors[index_of(channel)].gain);
  }
  ASSERT_TRUE(made.with_instruments);
  EXPECT_TRUE(made.with_instruments->sensors[index_of(Channel::displacement)].gain);
  EXPECT_EQ(truth_text(made.truth), truth_text(conceal(request, 4, "case-001").truth));
  request.imperfect_instruments = false;
  EXPECT_FALSE(conceal(request, 4, "case-001").with_instruments);
}

TEST(Concealment, WithoutHiddenEffectTheVerdictIsConsistent) {
  CaseRequest request;
  request.kind = CaseRequest::Kind::nothing;
  request.duration_s = 10.0;
  const Case made = conceal(request, 4, "case-002");
  EXPECT_EQ(made.truth.verdict, "consistent");
  EXPECT_EQ(made.truth.kind, "null");
  EXPECT_TRUE(made.truth.effects.empty());
  // The true states belong to the frames of the recording.
  ASSERT_EQ(made.states.size(), made.recording.frames.size());
  // The filters of the displacement cost some milliseconds: compared by the largest deflection.
  double true_most = 0.0;
  double read_most = 0.0;
  for (std::size_t k = 0; k < made.states.size(); ++k) {
    true_most = std::max(true_most, std::abs(made.states[k].displacement_m));
    read_most = std::max(read_most, std::abs(made.recording.frames[k][Channel::displacement]));
  }
  EXPECT_GT(true_most, 0.0);
  EXPECT_NEAR(read_most / true_most, 1.0, 0.1);
}

}  // namespace
}  // namespace stickslip::concealment
