// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::all_windows;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::with_fitted_states;
using ::testing::Each;
using ::testing::Field;
using ::testing::IsEmpty;
using ::testing::Lt;
using ::testing::Not;

// Regions of the true model, with its readings modified by `corrupt`.
template <class Corrupt>
std::vector<Region> found(double duration_s, std::uint64_t seed, Corrupt&& corrupt,
                          const std::function<double(double)>& force = test::swelling_force_n) {
  Experiment e = experiment_of(record(driven_mass(), duration_s, seed, true, force), driven_mass());
  for (std::size_t k = 0; k < e.samples; ++k) corrupt(e, k, e.reading[k][0]);
  const std::vector<Experiment> experiments = {std::move(e)};
  const Task task = all_windows(experiments);
  const Hypothesis hypothesis(driven_mass());
  const Fit fitted = with_fitted_states(task, hypothesis);
  return regions_of(task, hypothesis, fitted, 1);
}

const Region* first_of(const std::vector<Region>& regions, Aspect aspect) {
  const auto at = std::find_if(regions.begin(), regions.end(),
                               [aspect](const Region& r) { return r.aspect == aspect; });
  return at == regions.end() ? nullptr : &*at;
}

TEST(Regions, AreRareForNoiseAlone) {
  int reported = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    reported += found(16.0, seed, [](const Experiment&, std::size_t, double&) {}).empty() ? 0 : 1;
  }
  EXPECT_LE(reported, 2);  // one in twenty, of twenty
}

TEST(Regions, ReportTimes) {
  const auto regions = found(32.0, 1, [](const Experiment& e, std::size_t k, double& reading) {
    const double t = e.time_s(k);
    if (t >= 8.0 && t < 12.0) reading += 2.0e-4 * std::sin(2.0 * std::numbers::pi * 9.0 * t);
  });
  const Region* when = first_of(regions, Aspect::time);
  ASSERT_NE(when, nullptr);
  EXPECT_NEAR(when->from, 8.0, 0.1);
  EXPECT_NEAR(when->to, 12.0, 0.1);
  EXPECT_GT(when->energy, 5.0 * when->energy_outside);
  EXPECT_EQ(when->words, "at times from 8 to 12 s");
}

TEST(Regions, ReportDeflections) {
  // Additional noise beyond 10 mm, which the states cannot follow.
  const auto regions = found(32.0, 1, [](const Experiment& e, std::size_t k, double& reading) {
    if (e.guess[k].displacement_m > 0.01) reading += (k * 7919 % 13 < 6 ? 1.0e-4 : -1.0e-4);
  });
  const Region* where = first_of(regions, Aspect::displacement);
  ASSERT_NE(where, nullptr);
  EXPECT_GT(where->to, 0.01);
  EXPECT_GT(where->energy, 2.0 * where->energy_outside);
  EXPECT_THAT(regions, Each(Field(&Region::p_value, Lt(0.05))));
}

TEST(Regions, ReportTheBand) {
  const auto regions = found(16.0, 1, [](const Experiment& e, std::size_t k, double& reading) {
    reading += 4.0e-5 * std::sin(2.0 * std::numbers::pi * 50.0 * e.time_s(k));
  });
  const Region* band = first_of(regions, Aspect::band);
  ASSERT_NE(band, nullptr);
  EXPECT_EQ(band->from, 32.0);
  EXPECT_EQ(band->to, 64.0);
}

TEST(Regions, ReportPhasesOfADriveThatHasAFrequency) {
  // Noise wherever the drive pushes.
  const auto corrupt = [](const Experiment& e, std::size_t k, double& reading) {
    const double force = e.input[k * static_cast<std::size_t>(e.substeps)].drive_force_n;
    if (force > 0.3) reading += (k * 7919 % 13 < 6 ? 1.0e-4 : -1.0e-4);
  };
  EXPECT_NE(first_of(found(32.0, 1, corrupt), Aspect::drive_phase), nullptr);
  // From point to point: pushes of many lengths, with rests between.
  const auto moves = [](double t) {
    const double within = std::fmod(t, 4.1);
    if (within > 2.9) return 0.0;
    const double length = 0.15 + 0.3 * std::fmod(std::floor(t / 4.1) * 0.37, 1.0);
    return std::fmod(within, 2.0 * length) < length ? 0.6 : (within > 1.7 ? 0.0 : -0.6);
  };
  const std::vector<Region> regions = found(32.0, 1, corrupt, moves);
  EXPECT_THAT(regions, Not(IsEmpty()));
  EXPECT_EQ(first_of(regions, Aspect::drive_phase), nullptr);
}

TEST(Regions, ReportTheStateOfMotion) {
  const auto regions = found(32.0, 1, [](const Experiment& e, std::size_t k, double& reading) {
    if (e.guess[k].velocity_m_s < 0.0) reading += (k * 7919 % 13 < 6 ? 6.0e-5 : -6.0e-5);
  });
  const auto backwards = std::find_if(regions.begin(), regions.end(), [](const Region& r) {
    return r.words == "while it moves backwards";
  });
  ASSERT_NE(backwards, regions.end());
  EXPECT_GT(backwards->energy, 2.0 * backwards->energy_outside);
  EXPECT_TRUE(std::none_of(regions.begin(), regions.end(),
                           [](const Region& r) { return r.words == "while it moves forwards"; }));
}

TEST(Regions, AreDeterministicForASeed) {
  const auto corrupt = [](const Experiment& e, std::size_t k, double& reading) {
    if (e.guess[k].displacement_m > 0.01) reading += (k % 3 == 0 ? 1.0e-4 : -5.0e-5);
  };
  const auto once = found(16.0, 2, corrupt);
  const auto again = found(16.0, 2, corrupt);
  ASSERT_THAT(once, Not(IsEmpty()));
  ASSERT_EQ(once.size(), again.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].words, again[i].words);
    EXPECT_EQ(once[i].p_value, again[i].p_value);
  }
}

}  // namespace
}  // namespace stickslip::diagnosis
