// SPDX-License-Identifier: Apache-2.0
// The smoother compared with the truth and with the filter.
#include "observer/smoother.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>

#include "observer/kalman_filter.h"
#include "tests/unit/heap_count/heap_count.h"
#include "tests/unit/observer/smoothed.h"

namespace stickslip::observer {
namespace {

using test::frames_of;
using test::Law;
using test::paper_rig;
using test::Sample;
using test::smoothed;

double theta_error(const Sample& m) { return m.estimate.theta - m.truth.theta; }
double force_error(const Sample& m) {
  return m.estimate.friction_force_n - m.truth.friction_force_n;
}
double velocity_error(const Sample& m) { return m.estimate.velocity_m_s - m.truth.velocity_m_s; }

physics::Model with_sigmas(physics::Model model) {
  model.friction.mu.sigma = 0.2;
  if (model.friction.law == physics::FrictionLaw::state_variable) {
    model.friction.rate_per_s.sigma = 30.0;
  }
  return model;
}

class Smoothed : public testing::TestWithParam<Law> {};

TEST_P(Smoothed, IsMoreAccurateThanTheFilter) {
  physics::Model assumed = with_sigmas(paper_rig(GetParam()));
  assumed.friction.mu.value *= 1.2;
  test::RunOptions options;
  options.duration_s = 6.0;
  const auto filtered = test::run_observer(paper_rig(GetParam()), assumed, options);
  const auto after = smoothed(filtered, assumed);
  // Including the start, where the filter has not converged.
  EXPECT_LT(test::rms(after, 0.5, theta_error), 0.7 * test::rms(filtered, 0.5, theta_error));
  EXPECT_LT(test::rms(after, 2.0, velocity_error), 0.5 * test::rms(filtered, 2.0, velocity_error));
  EXPECT_LT(test::rms(after, 2.0, force_error), 1.05 * test::rms(filtered, 2.0, force_error));
  const auto mu_error = [](const Sample& m) { return m.estimate.mu - 0.8; };
  EXPECT_LT(test::rms(after, 0.0, mu_error), 0.3 * test::rms(filtered, 0.0, mu_error));
}

TEST_P(Smoothed, HasAConsistentCovariance) {
  const physics::Model model = with_sigmas(paper_rig(GetParam()));
  const auto after = smoothed(test::run_observer(model, model, {.duration_s = 5.0}), model);
  const auto normalised = [](double error, const Sample& m, Quantity quantity) {
    return error / m.estimate.standard_deviation(quantity);
  };
  const double velocity = test::rms(after, 0.5, [&](const Sample& m) {
    return normalised(velocity_error(m), m, Quantity::velocity);
  });
  EXPECT_GT(velocity, 0.4);
  EXPECT_LT(velocity, 1.4);
  const double force = test::rms(after, 0.5, [&](const Sample& m) {
    return normalised(force_error(m), m, Quantity::friction_force);
  });
  EXPECT_GT(force, 0.1);
  EXPECT_LT(force, 1.4);
}

INSTANTIATE_TEST_SUITE_P(Laws, Smoothed, testing::Values(Law::coulomb, Law::state_variable));

TEST(Smoother, IsIndependentOfItsWindows) {
  const physics::Model model = with_sigmas(paper_rig(Law::state_variable));
  const auto filtered = test::run_observer(model, model, {.duration_s = 4.0});
  const auto whole = smoothed(filtered, model);
  const auto in_windows = smoothed(filtered, model, {.keep_s = 0.5, .ahead_s = 1.0});
  for (std::size_t i = 500; i < whole.size(); i += 7) {
    const double deviation = whole[i].estimate.standard_deviation(Quantity::velocity);
    EXPECT_NEAR(in_windows[i].estimate.velocity_m_s, whole[i].estimate.velocity_m_s,
                0.5 * deviation);
  }
}

TEST(Smoother, CarriesNoInformationAcrossAGap) {
  const physics::Model model = with_sigmas(paper_rig(Law::coulomb));
  const auto filtered = test::run_observer(model, model, {.duration_s = 3.0});
  auto frames = frames_of(filtered);
  for (std::size_t i = 1500; i < frames.size(); ++i) frames[i].time_ns += 1'000'000'000;
  // The first segment depends on frames after the gap only through the parameters of the second
  // pass.
  std::vector<FrictionEstimate> one;
  std::vector<FrictionEstimate> other;
  smooth(model, 1.0e-3, frames, [&](const FrictionEstimate& e) { one.push_back(e); });
  for (std::size_t i = 1500; i < frames.size(); ++i) {
    frames[i].value[index_of(Channel::displacement)] += 2.0e-4;
  }
  smooth(model, 1.0e-3, frames, [&](const FrictionEstimate& e) { other.push_back(e); });
  ASSERT_EQ(one.size(), frames.size());
  ASSERT_EQ(other.size(), frames.size());
  for (std::size_t i = 200; i < 1500; ++i) {
    EXPECT_NEAR(one[i].displacement_m, other[i].displacement_m,
                0.1 * one[i].standard_deviation(Quantity::displacement));
  }
  EXPECT_NE(one[2000].displacement_m, other[2000].displacement_m);
}

TEST(Smoother, BridgesMissingFramesAndSkipsRepeatedOnes) {
  const physics::Model model = with_sigmas(paper_rig(Law::coulomb));
  const auto filtered = test::run_observer(model, model, {.duration_s = 2.0});
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < filtered.size(); ++i) {
    if (i % 100 > 94) continue;
    frames.push_back(filtered[i].frame);
    if (i % 50 == 7) frames.push_back(filtered[i].frame);
  }
  std::size_t next = 0;
  double worst = 0.0;
  smooth(model, 1.0e-3, frames, [&](const FrictionEstimate& e) {
    while (filtered[next].frame.time_ns < e.time_ns) ++next;
    ASSERT_EQ(filtered[next].frame.time_ns, e.time_ns);
    if (e.valid)
      worst = std::max(worst, std::abs(e.displacement_m - filtered[next].truth.displacement_m));
  });
  EXPECT_EQ(next, 1994U);
  EXPECT_GT(worst, 0.0);
  EXPECT_LT(worst, 5.0e-4);
}

TEST(Smoother, ReportsTheQualityOfPredictions) {
  const physics::Model model = paper_rig(Law::coulomb);
  const auto frames = frames_of(test::run_observer(model, model, {.duration_s = 4.0}));
  const auto ignore = [](const FrictionEstimate&) {};
  const PredictionQuality right = smooth(model, 1.0e-3, frames, ignore);
  EXPECT_EQ(right.restarts, 0U);
  EXPECT_GT(right.readings, 15000);
  EXPECT_NEAR(right.normalised_squares / static_cast<double>(right.readings), 1.0, 0.15);
  physics::Model wrong = model;
  wrong.oscillator.natural_frequency_hz->value *= 1.2;
  const PredictionQuality worse = smooth(wrong, 1.0e-3, frames, ignore);
  EXPECT_GT(worse.negative_log_likelihood, right.negative_log_likelihood);
}

// The last pass is linearised about the estimated parameters, so the values that were declared
// for them have no effect.
TEST(Smoother, DoesNotDependOnErrorsOfDeclaredParameters) {
  physics::Model real = with_sigmas(paper_rig(Law::coulomb, true));
  real.normal_load->slope_per_m = {100.0, 8.0};
  real.normal_load->load_n.sigma = 0.01;
  real.oscillator.mass_kg.sigma = 6.0e-4;
  real.oscillator.natural_frequency_hz->sigma = 0.05;
  physics::Model off = real;
  off.normal_load->slope_per_m.value += 12.0;
  off.oscillator.mass_kg.value += 9.0e-4;
  off.oscillator.natural_frequency_hz->value -= 0.07;
  const auto filtered = test::run_observer(real, real, {.duration_s = 4.0});
  const auto one = smoothed(filtered, real);
  const auto other = smoothed(filtered, off);
  // The last second is the filter's, which has no later readings.
  for (std::size_t i = 1000; i + 1000 < one.size(); i += 50) {
    const FrictionEstimate& a = one[i].estimate;
    const FrictionEstimate& b = other[i].estimate;
    EXPECT_NEAR(a.mu, b.mu, 0.2 * a.standard_deviation(Quantity::mu));
    EXPECT_NEAR(a.normal_load_n, b.normal_load_n,
                0.5 * a.standard_deviation(Quantity::normal_load) + 1.0e-5);
    EXPECT_NEAR(a.mu, 0.8, 3.0 * a.standard_deviation(Quantity::mu));
  }
}

#ifdef STICKSLIP_HEAP_IS_COUNTED
/// Most heap memory in use when estimates are passed on, for a period of the windows of both
/// stages, of which the first has 4 s [bytes].
double heap_per_period(const physics::Model& model, double seconds) {
  const std::vector<Sample> samples = test::run_observer(model, model, {.duration_s = seconds});
  const std::vector<Frame> frames = frames_of(samples);
  constexpr SmoothingWindow window{.keep_s = 0.5, .ahead_s = 0.5};
  const auto in_use = [] {
    const struct mallinfo2 heap = mallinfo2();
    return static_cast<double>(heap.uordblks + heap.hblkhd);
  };
  const double before = in_use();
  double most = before;
  const auto take = [&](const FrictionEstimate&) { most = std::max(most, in_use()); };
  smooth(model, 1.0e-3, frames, take, window);
  return (most - before) * 1.0e-3 / (4.0 + window.keep_s + window.ahead_s);
}

TEST(Smoother, NeedsMemoryForItsWindowsOnly) {
  physics::Model model = with_sigmas(paper_rig(Law::state_variable));
  model.oscillator.mass_kg.sigma = 0.001;
  const double few = heap_per_period(model, 5.5);
  const double many = heap_per_period(model, 8.5);
  EXPECT_LT(many, 1.02 * few);
  // Of a filter step with 30 states: no dense matrix but the covariance and the sensitivities.
  EXPECT_LT(many, 10.0e3);
}
#endif

// The smoother's repeated passes rest on it.
TEST(KalmanFilter, IsTheSameLinearisedAboutItsOwnEstimates) {
  const physics::Model model = with_sigmas(paper_rig(Law::coulomb));
  KalmanFilter own(model, 1.0e-3);
  KalmanFilter about(model, 1.0e-3);
  for (const Frame& frame : frames_of(test::run_observer(model, model, {.duration_s = 1.0}))) {
    const double deviation = own.estimate().slip_velocity_std_m_s;
    const LinearisationPoint before{own.mean(), deviation * deviation};
    const bool started = own.estimate().status != EstimateStatus::waiting;
    own.update(frame);
    about.linearise_about(started ? &before : nullptr, nullptr);
    about.update(frame);
    ASSERT_LT((own.mean() - about.mean()).norm(), 1.0e-6 * own.mean().norm()) << frame.time_ns;
  }
}

TEST(Smoother, RejectsUnsupportedModels) {
  EXPECT_THROW(smooth(paper_rig(Law::coulomb), 0.1, {}, [](const FrictionEstimate&) {}),
               std::invalid_argument);
  EXPECT_THROW(smooth(paper_rig(Law::coulomb), 0.0, {}, [](const FrictionEstimate&) {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace stickslip::observer
