// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/campaign.h"

#include <gtest/gtest.h>

#include <set>

#include "config/campaign.h"

namespace stickslip::concealment {
namespace {

constexpr double seconds = 3.0;

TEST(ConcealedCampaign, IsTheSameForTheSameSeed) {
  for (const CampaignEffect effect : all_campaign_effects) {
    SCOPED_TRACE(std::string(name_of(effect)));
    const CampaignCase one = conceal_campaign(effect, seconds, 7, "a");
    const CampaignCase other = conceal_campaign(effect, seconds, 7, "a");
    EXPECT_EQ(truth_text(one.truth), truth_text(other.truth));
    ASSERT_EQ(one.recordings.size(), 4U);
    EXPECT_EQ(one.recordings[2].frames.back().time_ns, other.recordings[2].frames.back().time_ns);
    EXPECT_EQ(one.truth.verdict, "missing_physics");
    ASSERT_EQ(one.truth.effects.size(), 1U);
  }
}

TEST(ConcealedCampaign, HidesNothingWhereNothingIsAskedFor) {
  const CampaignCase made = conceal_campaign(std::nullopt, seconds, 7, "a");
  EXPECT_EQ(made.truth.verdict, "consistent");
  EXPECT_TRUE(made.truth.effects.empty());
}

TEST(ConcealedCampaign, DiffersInTheLoadWhereThatShowsTheEffect) {
  const auto loads = [](CampaignEffect effect) {
    std::set<double> out;
    for (const physics::Run& run : conceal_campaign(effect, seconds, 7, "a").campaign.runs) {
      out.insert(run.conditions.at("load_n"));
    }
    return out.size();
  };
  EXPECT_EQ(loads(CampaignEffect::load_dependent_mu), 4U);
  EXPECT_EQ(loads(CampaignEffect::run_drift), 1U);
}

TEST(ConcealedCampaign, ItsFileIsACampaign) {
  const CampaignCase made = conceal_campaign(CampaignEffect::run_drift, seconds, 7, "a");
  const config::CampaignFile read = config::parse_campaign(campaign_text(made), "campaign.toml");
  ASSERT_EQ(read.recordings.size(), 4U);
  EXPECT_EQ(read.recordings[3].file, "run-4/recording.csv");
}

}  // namespace
}  // namespace stickslip::concealment
