// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/imperfect_instruments.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "physics/model_consistency.h"
#include "tools/concealment/noiseless_run.h"

namespace stickslip::concealment {
namespace {

Bench regular_bench() {
  RandomSource random(3);
  Bench bench = draw_bench(BenchKind::regular, {}, random);
  for (Instrument& instrument : bench.rig.instrument) instrument.noise_std = 0.01;
  return bench;
}
Sizes even_sizes() {
  Sizes sizes;
  sizes.spread.fill(0.01);
  sizes.largest.fill(0.02);
  return sizes;
}
Imperfections drawn(Bench& bench, const std::vector<Nuisance>& nuisances, std::uint64_t seed = 7) {
  RandomSource random(seed);
  return make_imperfect(bench, nuisances, even_sizes(), {}, random);
}

TEST(Nuisance, HasAName) {
  for (const Nuisance each : all_nuisances) EXPECT_EQ(nuisance_named(name_of(each)), each);
  EXPECT_EQ(nuisance_named("gravity"), std::nullopt);
}

TEST(Nuisance, OneToFourThatGoTogetherAreDrawn) {
  std::set<Nuisance> seen;
  std::set<std::size_t> counts;
  RandomSource random(1);
  const Bench bench = regular_bench();
  for (int k = 0; k < 200; ++k) {
    const std::vector<Nuisance> some = draw_nuisances(bench, random);
    counts.insert(some.size());
    seen.insert(some.begin(), some.end());
    EXPECT_EQ(std::set<Nuisance>(some.begin(), some.end()).size(), some.size());
    EXPECT_FALSE(std::count(some.begin(), some.end(), Nuisance::jitter) == 1 &&
                 std::count(some.begin(), some.end(), Nuisance::clock) == 1);
  }
  EXPECT_EQ(seen.size(), all_nuisances.size());
  EXPECT_EQ(counts, (std::set<std::size_t>{1, 2, 3, 4}));
}

TEST(Nuisance, NeedsItsChannels) {
  RandomSource random(3);
  const Bench force = draw_bench(BenchKind::force, {}, random);
  const Bench imposed = draw_bench(BenchKind::imposed, {}, random);
  EXPECT_FALSE(is_applicable(Nuisance::rates, force));
  EXPECT_TRUE(is_applicable(Nuisance::noisy_drive, force));
  EXPECT_FALSE(is_applicable(Nuisance::noisy_drive, imposed));
}

TEST(Imperfections, StayWithinTheirTolerancesAndOutOfTheModel) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Bench bench = regular_bench();
    const Bench ideal = bench;
    const Imperfections made =
        drawn(bench, {Nuisance::gain, Nuisance::offset, Nuisance::cutoff, Nuisance::skew}, seed);
    EXPECT_EQ(bench.declared, ideal.declared);
    for (const Channel channel : {Channel::displacement, Channel::velocity}) {
      const Instrument& instrument = bench.rig.instrument[index_of(channel)];
      const double nominal_hz =
          bench.declared.sensors[index_of(channel)].filters[0].cutoff_hz.value;
      EXPECT_NEAR(instrument.gain, 1.0, 3.0 * 0.005);
      EXPECT_NEAR(instrument.offset, 0.0, 3.0 * 1.0e-4);
      EXPECT_NEAR(instrument.filters[0].cutoff_hz.value / nominal_hz, 1.0, 3.0 * 0.024);
      EXPECT_GE(instrument.delay_s, 0.0);
      EXPECT_LE(instrument.delay_s, 0.6 / bench.sample_rate_hz);
      EXPECT_EQ(made.drawn["gain"][std::string(info(channel).stem)], instrument.gain);
    }
  }
}

TEST(Imperfections, DeclaredModelGetsTheirUncertainties) {
  const Bench bench = regular_bench();
  const physics::Model model = with_declared_instruments(bench, even_sizes());
  const physics::Sensor& sensor = model.sensors[index_of(Channel::velocity)];
  EXPECT_EQ(*sensor.gain, (physics::Parameter{1.0, 0.005}));
  EXPECT_EQ(*sensor.offset, (physics::Parameter{0.0, 1.0e-4}));
  EXPECT_EQ(*sensor.delay_s, (physics::Parameter{0.0, 0.3 / bench.sample_rate_hz}));
  EXPECT_EQ(sensor.filters[0].cutoff_hz, (physics::Parameter{150.0, 3.6}));
  EXPECT_FALSE(model.sensors[index_of(Channel::drive_force)].gain);
  EXPECT_TRUE(physics::inconsistencies_of(model).empty());
}

TEST(Imperfections, HalvedNoiseIsDeclaredExceptThatOfANoisyDrive) {
  Bench bench = regular_bench();
  drawn(bench, {Nuisance::noisy_drive, Nuisance::half_noise});
  const auto noise = [&](Channel channel) {
    return bench.rig.instrument[index_of(channel)].noise_std;
  };
  const auto declared = [&](Channel channel) {
    return *bench.declared.sensors[index_of(channel)].noise_std;
  };
  EXPECT_EQ(declared(Channel::velocity), 0.5 * noise(Channel::velocity));
  EXPECT_EQ(declared(Channel::base_displacement), noise(Channel::base_displacement));
  EXPECT_GE(noise(Channel::base_displacement), 0.01 * 0.01);
}

TEST(SampleTimes, JitterIsStatedAndAClockIsRounded) {
  RandomSource random(2);
  const SampleTimes even = sample_times({500.0}, 2.0, random);
  EXPECT_EQ(even.sampled_s.size(), 1000U);
  EXPECT_EQ(even.written_ns[7], 14'000'000);
  const SampleTimes uneven = sample_times({.rate_hz = 500.0, .jitter = 0.15}, 2.0, random);
  double square = 0.0;
  for (std::size_t k = 0; k < uneven.sampled_s.size(); ++k) {
    EXPECT_NEAR(1.0e-9 * static_cast<double>(uneven.written_ns[k]), uneven.sampled_s[k], 1.0e-12);
    if (k > 0) {
      EXPECT_GT(uneven.sampled_s[k], uneven.sampled_s[k - 1]);
    }
    square += std::pow(500.0 * uneven.sampled_s[k] - static_cast<double>(k) - 0.5, 2);
  }
  EXPECT_NEAR(std::sqrt(square / 1000.0), 0.15, 0.02);
  const SampleTimes odd = sample_times({.rate_hz = 493.7, .written_to_s = 1.0e-4}, 2.0, random);
  EXPECT_EQ(odd.written_ns[1], 2'000'000);  // 2.0255 ms
  EXPECT_EQ(odd.written_ns[900] % 100'000, 0);
  EXPECT_NEAR(odd.sampled_s[900], 900.0 / 493.7, 1.0e-12);
}

TEST(Imperfections, RowsAndCellsAreLeftOut) {
  Bench bench = regular_bench();
  const Imperfections made = drawn(bench, {Nuisance::gaps, Nuisance::rates});
  protocol::Recording recording;
  for (std::size_t row = 0; row < 15000; ++row) {
    Frame frame;
    frame.time_ns = static_cast<std::int64_t>(row) * 2'000'000;
    for (const Channel channel : all_channels) frame.set(channel, 1.0);
    recording.frames.push_back(frame);
  }
  protocol::Recording validation = recording;
  std::vector<physics::RigTruth> states(15000);
  leave_out(made, true, recording, &states);
  leave_out(made, false, validation, nullptr);
  std::size_t missing = 0;
  for (const auto& [first, count] : made.gaps) missing += count;
  EXPECT_TRUE(made.gaps.size() == 5 || made.gaps.size() == 6);
  EXPECT_EQ(recording.frames.size(), 15000 - missing);
  EXPECT_EQ(states.size(), recording.frames.size());
  EXPECT_EQ(validation.frames.size(), 15000U);
  const auto filled = [&](Channel channel) {
    return std::count_if(validation.frames.begin(), validation.frames.end(),
                         [&](const Frame& frame) { return frame.has(channel); });
  };
  EXPECT_EQ(filled(*made.slow_channel), 1875);
  EXPECT_EQ(filled(Channel::displacement), 15000);
}

TEST(NoiselessRun, IsSampledAtTheVeryTimes) {
  const Bench bench = regular_bench();
  // Between two steps of 25 us, and at steps beside them.
  const double step = reference_step_s;
  const std::vector<double> times = {0.1, 0.2 + 0.4 * step, 0.3};
  const std::vector<double> around = {0.1, 0.2, 0.2 + step, 0.3};
  const NoiselessRun run = simulate(bench.rig, times, false);
  const NoiselessRun other = simulate(bench.rig, around, false);
  const std::size_t x = index_of(Channel::displacement);
  EXPECT_EQ(run.readings[0][x], other.readings[0][x]);
  EXPECT_NEAR(run.readings[1][x], 0.6 * other.readings[1][x] + 0.4 * other.readings[2][x], 1.0e-12);
  EXPECT_EQ(run.readings[2][x], other.readings[3][x]);
}

TEST(Tolerance, ErrorOfASoundInstrumentIsNoFinding) {
  TrueEffect effect;
  effect.id = "gain_error";
  effect.parameters["gain"] = {1.015, 0.3, 1.0, true, false};
  EXPECT_FALSE(is_beyond_tolerance(effect, even_sizes(), 500.0));
  effect.parameters["gain"].value = 0.97;
  EXPECT_TRUE(is_beyond_tolerance(effect, even_sizes(), 500.0));
  effect.id = "stribeck";
  EXPECT_TRUE(is_beyond_tolerance(effect, even_sizes(), 500.0));
}

}  // namespace
}  // namespace stickslip::concealment
