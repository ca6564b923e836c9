// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/instruments.h"

#include <gtest/gtest.h>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/text.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using report::report_text;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::undeclared_instruments;

constexpr std::size_t x = index_of(Channel::displacement);
constexpr std::size_t drive = index_of(Channel::drive_force);

TEST(Instruments, AllowForWhatACarefulLaboratoryLeaves) {
  const auto recording = record(undeclared_instruments(), 10.0);
  const Experiment e = experiment_of(recording, undeclared_instruments());
  const physics::Model model = with_instruments(undeclared_instruments(), e);
  EXPECT_EQ(model.sensors[x].gain->sigma, 0.005);
  EXPECT_NEAR(model.sensors[x].offset->sigma, 0.01 * e.channel_std[x], 1.0e-12);
  EXPECT_NEAR(model.sensors[x].delay_s->sigma, std::numbers::sqrt2 * 0.3 * e.period_s, 1.0e-9);
  EXPECT_EQ(model.sensors[drive].gain->sigma, 0.005);
  EXPECT_FALSE(model.sensors[drive].delay_s) << "delays count from the drive";
}

TEST(Instruments, KeepWhatIsDeclared) {
  auto declared = undeclared_instruments();
  declared.sensors[x].gain = physics::Parameter{1.0};
  const Experiment e = experiment_of(record(declared, 10.0), declared);
  const physics::Model model = with_instruments(declared, e);
  EXPECT_EQ(model.sensors[x].gain->sigma, 0.0) << "exact";
  EXPECT_GT(model.sensors[x].offset->sigma, 0.0);
}

Diagnosis diagnosed(const physics::Model& truth) {
  Options options;
  options.threads = 2;
  return diagnose({record(truth, 24.0)}, undeclared_instruments(), options);
}

// None of what a careful laboratory leaves is a finding.
TEST(Instruments, AreNoFindingWithinTheirUncertainty) {
  auto truth = undeclared_instruments();
  truth.sensors[x].gain = physics::Parameter{1.006};
  truth.sensors[x].offset = physics::Parameter{-1.0e-4};
  truth.sensors[x].delay_s = physics::Parameter{0.0021};  // 0.42 samples
  truth.sensors[drive].gain = physics::Parameter{0.993};
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "consistent") << report_text(got);
  EXPECT_NEAR(got.baseline.chi2_per_sample, 1.0, 0.1);
}

// The model that calls the same zero exact is contradicted.
TEST(Instruments, AreFindingsWhereTheyAreDeclaredExact) {
  auto truth = driven_mass();
  truth.sensors[x].offset = physics::Parameter{-4.0e-4};
  Options options;
  options.threads = 2;
  const Diagnosis got = diagnose({record(truth, 24.0)}, driven_mass(), options);
  EXPECT_EQ(name_of(got.verdict), "missing_physics") << report_text(got);
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
}

// A delay far beyond a fraction of a sample.
TEST(Instruments, AreFindingsBeyondIt) {
  auto truth = undeclared_instruments();
  truth.sensors[x].delay_s = physics::Parameter{0.012};
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "missing_physics") << report_text(got);
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  EXPECT_EQ(got.findings[0].effect->card().id, "channel_delay");
}

}  // namespace
}  // namespace stickslip::diagnosis
