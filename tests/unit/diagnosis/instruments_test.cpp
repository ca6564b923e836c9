// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/instruments.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/text.h"
#include "physics/sensor_chain.h"
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

// Of what a channel adds to the declared noise, most is too slow to be seen before a fit.
TEST(Instruments, NoiseIsAllowedToBeSlowAndMoreThanDeclared) {
  const auto truth = driven_mass();
  protocol::Recording recording = record(truth, 24.0);
  test::add_slow_error(recording, 4.0e-5, 5);
  Options options;
  options.threads = 2;
  const Diagnosis got = diagnose({recording}, truth, options);
  EXPECT_EQ(name_of(got.verdict), "consistent") << report_text(got);
  ASSERT_EQ(got.noise_level.size(), 1U) << report_text(got);
  EXPECT_NEAR(got.noise_level[0].second, std::hypot(2.0e-5, 4.0e-5) / 2.0e-5, 0.2);
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

constexpr double declared_cutoff_hz = 30.0;

/// Filter of the drive's channel.
physics::Filter low_pass(physics::Parameter cutoff_hz) {
  return {physics::FilterKind::butterworth_lowpass, 2, cutoff_hz};
}

/// Forces that the mass follows above and below its resonance, and their readings through a
/// low-pass, without noise of the channel.
protocol::Recording driven_through(double cutoff_hz) {
  constexpr std::array<std::array<double, 2>, 3> tones = {{{1.0, 2.3}, {40.0, 7.1}, {100.0, 11.9}}};
  const physics::Filter filter = low_pass({cutoff_hz});
  const physics::FilterChain chain({&filter, 1}, 1.0e-3);
  const auto force = [&](double time_s, bool filtered) {
    double sum = 0.0;
    for (const auto& [amplitude, frequency_hz] : tones) {
      const auto response = filtered ? chain.response(frequency_hz) : std::complex<double>(1.0);
      sum += amplitude * std::abs(response) *
             std::sin(2.0 * std::numbers::pi * frequency_hz * time_s + std::arg(response));
    }
    return sum;
  };
  protocol::Recording recording =
      record(driven_mass(), 24.0, 1, true, [&](double time_s) { return force(time_s, false); });
  for (Frame& frame : recording.frames) {
    const double time_s = 1.0e-9 * static_cast<double>(frame.time_ns);
    frame.set(Channel::drive_force, force(time_s, true));
  }
  return recording;
}

/// Fit of all windows to a recording whose drive's cut-off is 3 % above the declared one.
Fit fit_of_drive(physics::Parameter cutoff_hz, physics::Parameter delay_s) {
  physics::Model model = driven_mass();
  model.sensors[drive].filters = {low_pass(cutoff_hz)};
  model.sensors[drive].delay_s = delay_s;
  const std::vector<Experiment> experiments = {
      experiment_of(driven_through(1.03 * declared_cutoff_hz), model)};
  const Task task = test::all_windows(experiments);
  const Hypothesis hypothesis(model);
  FitOptions options;
  options.iterations = 20;
  return fit(task, hypothesis, std::vector<double>(hypothesis.unknowns().size(), 0.0),
             initial_states(task, hypothesis), options);
}

TEST(Instruments, ACutOffOfTheDriveIsMoreThanADelay) {
  constexpr double sigma_hz = 0.02 * declared_cutoff_hz;
  const Fit late = fit_of_drive({declared_cutoff_hz}, {0.0, 1.0e-3});
  EXPECT_GT(late.chi2_per_sample(), 1.3);
  const Fit filtered = fit_of_drive({declared_cutoff_hz, sigma_hz}, {0.0});
  EXPECT_NEAR(filtered.chi2_per_sample(), 1.0, 0.05);
  const double error = 0.03 * declared_cutoff_hz - sigma_hz * filtered.z.back();
  EXPECT_NEAR(error, 0.0, 0.002 * declared_cutoff_hz);
}

}  // namespace
}  // namespace stickslip::diagnosis
