#include "tools/concealment/concealment.h"

#include <gtest/gtest.h>

#include <set>

#include "physics/effects/catalogue.h"
#include "tools/concealment/secret.h"

namespace stickslip::concealment {
namespace {

Order order_of(const std::string& id) {
  Order order;
  order.ids = {id};
  order.duration_s = 10.0;
  return order;
}

TEST(Concealment, CanHideEveryEffectThatTheContractLists) {
  std::set<std::string> listed;
  for (const physics::Effect* effect : physics::catalogue()) {
    if (effect->card().depends_on.empty()) listed.insert(std::string(effect->card().id));
  }
  std::set<std::string> hidden;
  for (const Secret& secret : all_secrets()) {
    if (secret.listed) hidden.insert(std::string(secret.id));
  }
  EXPECT_EQ(hidden, listed);
}

TEST(Concealment, EverySecretIsHiddenWithTheParametersThatTheContractNames) {
  for (const Secret& secret : all_secrets()) {
    ASSERT_FALSE(secret.worlds.empty()) << secret.id;
    for (const World world : secret.worlds) {
      Dice dice(3);
      Rig rig = draw_rig(world, secret.wishes, dice);
      Sizes sizes;
      sizes.spread.fill(0.01);
      sizes.largest.fill(0.02);
      const TrueEffect effect = hide(secret, 1.0, sizes, rig, Dice(5));
      ASSERT_EQ(effect.relations.size(), 1U) << secret.id;
      if (!secret.listed) {
        EXPECT_EQ(effect.id, "unlisted");
        EXPECT_FALSE(effect.depends_on.empty()) << secret.id;
        continue;
      }
      const physics::Effect* entry = physics::find_effect(effect.id);
      ASSERT_NE(entry, nullptr) << secret.id;
      EXPECT_EQ(effect.relations[0], physics::name_of(entry->card().relation)) << secret.id;
      EXPECT_EQ(effect.channel.has_value(), entry->card().relation == physics::Relation::sensor)
          << secret.id;
      for (const auto& [name, parameter] : effect.parameters) {
        const auto cards = entry->card().parameters;
        EXPECT_TRUE(std::any_of(cards.begin(), cards.end(),
                                [&](const auto& card) { return card.name == name; }))
            << secret.id << " " << name;
        EXPECT_NE(parameter.value, parameter.reference) << secret.id << " " << name;
      }
    }
  }
}

TEST(Concealment, IsTheSameForASeedAndAnotherForAnother) {
  const Case one = conceal(order_of("cubic_stiffness"), 17, "case-001");
  const Case again = conceal(order_of("cubic_stiffness"), 17, "case-001");
  const Case other = conceal(order_of("cubic_stiffness"), 18, "case-001");
  EXPECT_EQ(truth_text(one.truth), truth_text(again.truth));
  EXPECT_EQ(one.recording.frames, again.recording.frames);
  EXPECT_EQ(one.believed, again.believed);
  EXPECT_NE(one.recording.frames, other.recording.frames);
}

TEST(Concealment, WhatItHidesIsVisibleAndNotInTheModel) {
  for (const char* id : {"cubic_stiffness", "gain_error", "friction_memory", "passing_friction"}) {
    const Case made = conceal(order_of(id), 5, "case-001");
    ASSERT_EQ(made.truth.effects.size(), 1U);
    EXPECT_GE(made.truth.effects[0].snr, 4.0) << id;
    EXPECT_GE(made.truth.effects[0].snr_after_calibration, 1.2) << id;
    EXPECT_TRUE(made.believed.terms.empty());
    EXPECT_TRUE(physics::inconsistencies_of(made.believed).empty());
    EXPECT_NE(made.recording.frames.front(), made.validation.frames.front());
    EXPECT_EQ(made.truth.effects[0].when_s.empty(), std::string(id) != "passing_friction");
  }
}

TEST(Concealment, NothingHiddenIsConsistentByItsTruth) {
  Order order;
  order.kind = Order::Kind::nothing;
  order.duration_s = 10.0;
  const Case made = conceal(order, 4, "case-002");
  EXPECT_EQ(made.truth.verdict, "consistent");
  EXPECT_EQ(made.truth.kind, "null");
  EXPECT_TRUE(made.truth.effects.empty());
}

}  // namespace
}  // namespace stickslip::concealment
