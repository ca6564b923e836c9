// SPDX-License-Identifier: Apache-2.0
// Whole diagnoses of small campaigns.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/text.h"
#include "tests/unit/diagnosis/bench.h"
#include "tests/unit/diagnosis/campaigns.h"

namespace stickslip::diagnosis {
namespace {

using physics::SharedNumber;
using physics::Sharing;
using test::driven_mass;
using test::record;
using test::under_loads;
using test::with_term;

constexpr const char* stiffness = "oscillator.stiffness_n_m";
constexpr const char* friction = "physics.dry_friction.friction_force_n";

/// A campaign with friction in proportion to the load.
std::vector<protocol::Recording> rubbing(const std::vector<double>& loads_n, double coefficient) {
  std::vector<protocol::Recording> out;
  for (const double load_n : loads_n) {
    const auto truth =
        with_term(driven_mass(), "dry_friction", {{"friction_force_n", {coefficient * load_n}}});
    out.push_back(record(truth, 12.0, out.size() + 1));
  }
  return out;
}

/// With a coefficient of friction that is known within a third.
physics::Model under_constant_load() {
  physics::Model model = driven_mass();
  model.normal_load.emplace().load_n = {1.5};
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.3, 0.1};
  model.friction.transition_speed_m_s = {1.0e-3};
  return model;
}

Diagnosis diagnosed(const std::vector<protocol::Recording>& recordings,
                    const physics::Campaign& campaign,
                    const physics::Model& declared = driven_mass()) {
  Options options;
  options.threads = 2;
  options.campaign = std::make_shared<physics::Campaign>(campaign);
  return diagnose(recordings, declared, options);
}

const Comparison* comparison_at(const Diagnosis& diagnosis, const std::string& path) {
  for (const Comparison& each : diagnosis.campaign->comparisons) {
    if (each.number.path == path) return &each;
  }
  return nullptr;
}

TEST(Campaign, GivesOneCoefficientAndPredictsALoadThatIsHeldOut) {
  const std::vector<double> loads{1.0, 2.0, 1.5};
  physics::Campaign campaign = under_loads(loads);
  campaign.runs[2].held_out = true;
  const Diagnosis got = diagnosed(rubbing(loads, 0.3), campaign);
  ASSERT_EQ(got.findings.size(), 1U) << report::report_text(got);
  EXPECT_EQ(got.findings[0].effect->card().id, "dry_friction");
  EXPECT_EQ(got.findings[0].shared.sharing, Sharing::proportional) << report::report_text(got);
  for (const Trial& each : got.trials) {
    EXPECT_NE(each.id, "dry_friction in each recording")
        << "of two recordings, that is the same as a value that follows the load";
  }
  const Comparison* found = comparison_at(got, friction);
  ASSERT_NE(found, nullptr);
  ASSERT_TRUE(found->trend.has_value());
  EXPECT_NEAR(found->trend->value, 0.3, 0.01);
  EXPECT_TRUE(found->tenable);
  ASSERT_EQ(found->own.size(), 2U);
  EXPECT_NEAR(found->own[0].value, 0.3, 0.02);
  EXPECT_NEAR(found->own[1].value, 0.6, 0.02);
  ASSERT_EQ(got.campaign->held_out.size(), 1U);
  const auto channel = index_of(Channel::displacement);
  const HeldOutRecording& held_out = got.campaign->held_out[0];
  EXPECT_LT(*held_out.augmented->rmse[channel], 0.2 * *held_out.baseline.rmse[channel]);
  EXPECT_LT(held_out.augmented->chi2_per_sample, 1.2);
  const auto json = report::report_json(got, {});
  EXPECT_EQ(json["campaign"]["comparisons"][0]["recordings"][0]["name"], "1");
}

TEST(Campaign, NamesTheRecordingThatDisagreesWhereNoneDoesAlone) {
  std::vector<protocol::Recording> recordings;
  for (const double stiffness_n_m : {158.0, 158.0, 165.0, 158.0}) {
    physics::Model truth = driven_mass();
    truth.oscillator.stiffness_n_m->value = stiffness_n_m;
    recordings.push_back(record(truth, 8.0, recordings.size() + 1));
  }
  Options alone;
  alone.threads = 2;
  EXPECT_EQ(diagnose({recordings[2]}, driven_mass(), alone).verdict, Verdict::consistent);
  const Diagnosis got = diagnosed(recordings, under_loads({1.0, 1.0, 1.0, 1.0}));
  ASSERT_EQ(got.findings.size(), 1U) << report::report_text(got);
  EXPECT_EQ(got.findings[0].parameter, stiffness);
  EXPECT_EQ(got.findings[0].shared.sharing, Sharing::own);
  const Comparison* found = comparison_at(got, stiffness);
  ASSERT_NE(found, nullptr);
  EXPECT_FALSE(found->tenable);
  for (const OwnValue& each : found->own) EXPECT_EQ(each.disagrees, each.recording == 2);
}

// In each recording the load is constant, and nothing is missing.
TEST(Campaign, NamesACoefficientThatDependsOnTheLoad) {
  const std::vector<double> loads{1.0, 1.5, 2.5};
  const physics::Model declared = under_constant_load();
  std::vector<protocol::Recording> recordings;
  for (const double load_n : loads) {
    physics::Model truth = declared;
    truth.normal_load->load_n.value = load_n;
    truth.friction.mu.value *= std::pow(load_n / loads[1], -0.4);
    recordings.push_back(record(truth, 8.0, recordings.size() + 1));
  }
  const Diagnosis got = diagnosed(recordings, under_loads(loads), declared);
  ASSERT_EQ(got.findings.size(), 1U) << report::report_text(got);
  EXPECT_EQ(got.findings[0].effect->card().id, "load_dependent_mu") << report::report_text(got);
  EXPECT_NEAR(got.findings[0].parameters[0].value, -0.4, 0.1);
}

TEST(Campaign, ReportsTheSpreadOfANumberThatVaries) {
  std::vector<protocol::Recording> recordings;
  const std::vector<double> values{155.0, 158.5, 161.0, 157.0};
  for (const double stiffness_n_m : values) {
    physics::Model truth = driven_mass();
    truth.oscillator.stiffness_n_m->value = stiffness_n_m;
    recordings.push_back(record(truth, 8.0, recordings.size() + 1));
  }
  const Diagnosis got =
      diagnosed(recordings, under_loads({1.0, 1.0, 1.0, 1.0}, {{stiffness, Sharing::varies}}));
  EXPECT_EQ(got.verdict, Verdict::consistent) << report::report_text(got);
  const Comparison* found = comparison_at(got, stiffness);
  ASSERT_NE(found, nullptr);
  ASSERT_TRUE(found->spread.has_value());
  EXPECT_NEAR(found->value, 157.875, 0.2);
  EXPECT_NEAR(found->spread->value, 2.54, 0.2);  // their standard deviation
  EXPECT_LT(found->spread->low, 2.54);
  EXPECT_GT(found->spread->high, 2.54);
}

TEST(Campaign, OfOneRecordingIsItsDiagnosis) {
  const auto truth = with_term(driven_mass(), "quadratic_drag", {{"drag_n_s2_m2", {2.0}}});
  const std::vector<protocol::Recording> recordings{record(truth, 10.0)};
  Options options;
  options.threads = 2;
  auto alone = report::report_json(diagnose(recordings, driven_mass(), options), {});
  auto campaign = report::report_json(diagnosed(recordings, under_loads({1.0})), {});
  EXPECT_TRUE(campaign.contains("campaign"));
  EXPECT_FALSE(alone.contains("campaign"));
  campaign.erase("campaign");
  EXPECT_EQ(alone.dump(), campaign.dump());
}

}  // namespace
}  // namespace stickslip::diagnosis
