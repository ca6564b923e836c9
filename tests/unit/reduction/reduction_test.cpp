// SPDX-License-Identifier: Apache-2.0
#include "tools/reduction/reduction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "config/rig.h"
#include "physics/problem.h"
#include "tools/figures/sweep.h"

namespace stickslip::reduction {
namespace {

config::Rig preset(const std::string& name) {
  return config::load_rig(STICKSLIP_SOURCE_DIR "/config/" + name + ".toml");
}

protocol::Recording recording_of(const config::Rig& rig, double rate_hz) {
  figures::Sweep sweep;
  sweep.frequency_hz = rig.excitation.carrier_hz;
  sweep.amplitude_m = rig.excitation.amplitude;
  sweep.modulation_hz = rig.excitation.modulation_hz;
  sweep.modulation_depth = rig.excitation.modulation_depth;
  sweep.transient_s = 20.0;
  sweep.duration_s = 10.2;
  sweep.rate_hz = rate_hz;
  return figures::record(rig.simulated.truth, sweep);
}

Reduction reduced(const std::string& name, Method method) {
  const config::Rig rig = preset(name);
  Options options;
  options.method = method;
  return reduce(recording_of(rig, method == Method::paper ? 80.0 : 1000.0), rig.model, options);
}

/// A short recording of Beam I, for tests that do not depend on its content.
const protocol::Recording& short_recording() {
  static const protocol::Recording recording = [] {
    figures::Sweep sweep;
    sweep.duration_s = 3.0;
    return figures::record(preset("beam-1").model, sweep);
  }();
  return recording;
}

TEST(Reduction, IsRefusedWithoutALoadToDivideBy) {
  protocol::Recording recording = short_recording();
  recording.source = "run.csv";
  for (Frame& frame : recording.frames) frame.set(Channel::normal_load, 0.0);
  for (const Method method : {Method::paper, Method::deconvolved}) {
    Options options;
    options.method = method;
    options.samples = 100;
    try {
      reduce(recording, preset("beam-1").model, options);
      ADD_FAILURE() << "no refusal";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("run.csv: has a mean normal_load_n of "));
    }
  }
}

// Recordings with and without instrument errors reduce to the same numbers where the model declares
// the errors.
TEST(Reduction, RemovesDeclaredInstrumentErrors) {
  physics::Model model = preset("beam-1").model;
  const Reduction plain = reduce(short_recording(), model, {});
  protocol::Recording recording = short_recording();
  for (Frame& frame : recording.frames) {
    frame.set(Channel::friction_force, 1.2 * frame[Channel::friction_force]);
    frame.set(Channel::normal_load, frame[Channel::normal_load] + 0.05);
  }
  // Velocity read two samples late.
  for (std::size_t i = recording.frames.size() - 1; i >= 2; --i) {
    recording.frames[i].set(Channel::velocity, recording.frames[i - 2][Channel::velocity]);
  }
  model.sensors[index_of(Channel::friction_force)].gain = physics::Parameter{1.2};
  model.sensors[index_of(Channel::normal_load)].offset = physics::Parameter{0.05};
  model.sensors[index_of(Channel::velocity)].delay_s = physics::Parameter{2.0 * plain.period_s};
  const Reduction got = reduce(recording, model, {});
  ASSERT_EQ(got.samples.size(), plain.samples.size());
  EXPECT_NEAR(got.load_n, plain.load_n, 1e-9);
  EXPECT_NEAR(got.sliding_mu.high, plain.sliding_mu.high, 1e-9);
  for (std::size_t i = 0; i + 100 < got.samples.size(); i += 50) {
    EXPECT_NEAR(got.samples[i].velocity_m_s, plain.samples[i].velocity_m_s, 1e-9);
  }
}

// The statements of the paper on each preset's figure: the normal load, and for Beams I and II the
// range of the coefficient of sliding friction. Its numbers have one digit; so have these
// tolerances.
struct PaperNumbers {
  const char* preset;
  Range load_n;
  Range sliding_mu;
};

class PaperMethod : public testing::TestWithParam<PaperNumbers> {};

TEST_P(PaperMethod, FindsTheLoadsOfThePaper) {
  const auto& paper = GetParam();
  const Reduction got = reduced(paper.preset, Method::paper);
  EXPECT_EQ(got.samples.size(), 800U);
  EXPECT_NEAR(got.normal_load_n.low, paper.load_n.low, 0.015);
  EXPECT_NEAR(got.normal_load_n.high, paper.load_n.high, 0.015);
  if (paper.sliding_mu.high > 0.0) {
    EXPECT_NEAR(got.sliding_mu.low, paper.sliding_mu.low, 0.1);
    EXPECT_NEAR(got.sliding_mu.high, paper.sliding_mu.high, 0.1);
  }
}

INSTANTIATE_TEST_SUITE_P(Figures, PaperMethod,
                         testing::Values(PaperNumbers{"beam-1", {0.12, 0.17}, {0.6, 1.0}},
                                         PaperNumbers{"beam-2", {0.10, 0.16}, {0.2, 0.5}},
                                         PaperNumbers{"beam-3-paper", {0.04, 0.19}, {}},
                                         PaperNumbers{"beam-3-titanium", {0.16, 0.47}, {}},
                                         PaperNumbers{"beam-4", {0.20, 0.25}, {}}),
                         [](const auto& info) {
                           std::string name = info.param.preset;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(PaperMethod, FindsSkewedPlatesLinearAndParallelOnesFlatter) {
  const Reduction skewed = reduced("beam-3-titanium", Method::paper);
  EXPECT_GT(skewed.linear_share, 0.99);
  EXPECT_NEAR(skewed.slope_per_m / preset("beam-3-titanium").model.normal_load->slope_per_m.value,
              1.0, 0.02);
  const Reduction parallel = reduced("beam-1", Method::paper);
  EXPECT_LT(parallel.slope_per_m, 0.1 * skewed.slope_per_m);
}

// The spread that the paper reports appears although mu is one number: the load cell rings, which
// Eq. (1) ignores. Deconvolution recovers the number.
TEST(DeconvolvedMethod, FindsTheOneCoefficientBehindThePapersSpread) {
  for (const char* name : {"beam-1", "beam-2"}) {
    const double mu = preset(name).model.friction.mu.value;
    const Range as_in_the_paper = reduced(name, Method::paper).sliding_mu;
    const Range today = reduced(name, Method::deconvolved).sliding_mu;
    EXPECT_NEAR(today.low, mu, 0.06 * mu) << name;
    EXPECT_NEAR(today.high, mu, 0.03 * mu) << name;
    EXPECT_GT(as_in_the_paper.high - as_in_the_paper.low, 6.0 * (today.high - today.low)) << name;
  }
}

// A friction force of correlated noise only: the truth is 0 in each cell, and the cells must miss
// it as often as their errors predict. Errors from independent samples would be too small by half.
TEST(Surface, GivesEachCellACorrectError) {
  protocol::Recording recording;
  recording.source = "made";
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  double noise = 0.0;
  for (int i = 0; i < 40000; ++i) {
    const double t = 1.0e-3 * i;
    noise = 0.9 * noise + normal(random);
    const double swing = 1.0e-3 * (1.2 + std::sin(0.7 * t)) * std::sin(2.0 * M_PI * 2.5 * t);
    Frame frame;
    frame.time_ns = 1000000LL * i;
    frame.set(Channel::displacement, swing);
    frame.set(Channel::velocity, 1.0e-2 * std::cos(2.0 * M_PI * 2.5 * t));
    frame.set(Channel::friction_force, 0.01 * noise);
    frame.set(Channel::normal_load, 0.15);
    frame.set(Channel::base_displacement, 0.0);
    recording.frames.push_back(frame);
  }
  Options options;
  options.method = Method::paper;
  options.samples = recording.frames.size();
  options.bins = 16;
  int cells = 0;
  int missed = 0;
  double naive = 0.0;
  for (const Cell& cell : reduce(recording, preset("beam-1").model, options).surface) {
    if (cell.visits < 12) continue;
    ++cells;
    if (std::abs(cell.mu) > 2.0 * cell.standard_error) ++missed;
    naive += cell.scatter / std::sqrt(static_cast<double>(cell.samples)) / cell.standard_error;
  }
  ASSERT_GT(cells, 100);
  EXPECT_LT(missed, 0.09 * cells) << missed << " of " << cells;  // two sigma: one in twenty
  EXPECT_GT(missed, 0.01 * cells) << missed << " of " << cells;
  EXPECT_LT(naive / cells, 0.6);
}

TEST(Surface, CountsEachSampleOnceAndEachVisitOnce) {
  const Reduction got = reduced("beam-1", Method::deconvolved);
  std::size_t samples = 0;
  for (const Cell& cell : got.surface) {
    samples += cell.samples;
    EXPECT_LE(cell.visits, cell.samples);
    EXPECT_GE(cell.visits, 1U);
  }
  EXPECT_EQ(samples, got.samples.size());
}

// Eq. (1) by hand: the inertia of the load cell alone is no friction.
TEST(PaperMethod, SubtractsTheInertiaOfTheLoadCell) {
  physics::Model model = preset("beam-1").model;
  const double cell_mass = model.load_cell->mass_kg.value;
  protocol::Recording recording;
  recording.source = "made";
  const double omega = 2.0 * M_PI * 4.0;
  for (int i = 0; i < 800; ++i) {
    const double t = 0.0125 * i;
    Frame frame;
    frame.time_ns = std::llround(t * 1.0e9);
    const double base = 5.0e-3 * std::cos(omega * t);
    const auto put = [&](Channel channel, double value) { frame.set(channel, value); };
    put(Channel::displacement, 1.0e-3 * std::sin(omega * t));
    put(Channel::velocity, 1.0e-3 * omega * std::cos(omega * t));
    // k_l y = f - m_l b'', with f = 0; and an offset that drifts.
    put(Channel::friction_force, cell_mass * omega * omega * base + 0.02 + 0.001 * t);
    put(Channel::normal_load, 0.15);
    put(Channel::base_displacement, base + 0.003);
    recording.frames.push_back(frame);
    recording.channels |= frame.valid;
  }
  Options options;
  options.method = Method::paper;
  const Reduction got = reduce(recording, model, options);
  EXPECT_NEAR(got.drive_hz, 4.0, 0.03);
  for (const Sample& sample : got.samples) EXPECT_LT(std::abs(sample.mu), 0.02 * 0.0398 / 0.15);
}

TEST(Reduce, TakesTheLongestStretchWithoutAGap) {
  protocol::Recording recording = short_recording();
  recording.frames.erase(recording.frames.begin() + 700, recording.frames.begin() + 705);
  recording.frames[2500].invalidate(Channel::displacement);
  const physics::Model model = preset("beam-1").model;
  const Reduction got = reduce(recording, model);
  EXPECT_EQ(got.first, 700U + 100U);  // a tenth of a second after the gap
  EXPECT_EQ(got.samples.size(), 2500U - 700U - 200U);
  Options options;
  options.first = 2600;
  EXPECT_EQ(reduce(recording, model, options).first, 2601U);
  options.first = 2500;
  options.samples = 450;
  EXPECT_THROW(reduce(recording, model, options), InputError);
}

// The pictures join samples by lines: none may cross a clock that was set.
TEST(Reduce, AStepOfTheTimeIsAGap) {
  protocol::Recording recording = short_recording();
  for (std::size_t i = 700; i < recording.frames.size(); ++i) {
    recording.frames[i].time_ns += 5'000'000'000;
  }
  const Reduction got = reduce(recording, preset("beam-1").model);
  EXPECT_EQ(got.first, 700U + 100U);
  for (std::size_t i = 1; i < got.samples.size(); ++i) {
    ASSERT_LT(got.samples[i].time_s - got.samples[i - 1].time_s, 0.002) << i;
  }
}

TEST(Reduce, ReportsMissingInput) {
  using testing::HasSubstr;
  using testing::ThrowsMessage;
  const physics::Model model = preset("beam-1").model;
  protocol::Recording without_load = short_recording();
  for (Frame& frame : without_load.frames) frame.invalidate(Channel::normal_load);
  EXPECT_THAT([&] { reduce(without_load, model); },
              ThrowsMessage<InputError>(HasSubstr("normal_load_n")));
  physics::Model rigid = model;
  rigid.load_cell.reset();
  EXPECT_THAT([&] { reduce(short_recording(), rigid); },
              ThrowsMessage<InputError>(HasSubstr("[load_cell]")));
  physics::Model forced = model;
  forced.oscillator.excitation = physics::Excitation::force;
  EXPECT_THAT([&] { reduce(short_recording(), forced); },
              ThrowsMessage<InputError>(HasSubstr("excitation")));
  Options options;
  options.samples = 5000;
  EXPECT_THAT([&] { reduce(short_recording(), model, options); },
              ThrowsMessage<InputError>(HasSubstr("5000")));
}

}  // namespace
}  // namespace stickslip::reduction
