#include "diagnosis/suspects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/score.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::experiment_of;
using test::record;

std::vector<std::string> names_of(const std::vector<Suspect>& suspects) {
  std::vector<std::string> names;
  for (const Suspect& suspect : suspects) names.push_back(suspect.name());
  return names;
}

bool holds(const std::vector<std::string>& names, const char* name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

TEST(Suspects, AreThoseThatTheModelCouldLackAndTheChannelsCouldShow) {
  const std::vector<Experiment> experiments{
      experiment_of(record(driven_mass(), 8.0), driven_mass())};
  const auto names = names_of(suspects_of(driven_mass(), experiments));
  EXPECT_TRUE(holds(names, "dry_friction"));
  EXPECT_TRUE(holds(names, "gain_error of displacement"));
  EXPECT_TRUE(holds(names, "gain_error of drive_force"));
  EXPECT_TRUE(holds(names, "force_over_velocity"));
  EXPECT_FALSE(holds(names, "stribeck")) << "there is no friction yet";
  EXPECT_FALSE(holds(names, "gain_error of velocity")) << "it is not recorded";
  EXPECT_FALSE(holds(names, "crosstalk of displacement from velocity"));
  EXPECT_FALSE(holds(names, "load_cell_resonance"));
}

// What the declared model leaves of a recording of `truth`.
Hints hints_for(const physics::Model& truth) {
  const std::vector<Experiment> experiments{experiment_of(record(truth, 24.0), driven_mass())};
  const Task task = test::all_windows(experiments);
  const Hypothesis declared(driven_mass());
  const std::vector<double> z(declared.unknowns().size(), 0.0);
  FitOptions states_only;
  states_only.parameters_free = false;
  const Fit fitted = fit(task, declared, z, guessed_states(task, declared), states_only);
  return hints_of(task, declared, fitted);
}

TEST(Hints, KnowTheLineOfAHum) {
  physics::Model truth = driven_mass();
  truth.terms.push_back(
      {"mains_hum",
       Channel::displacement,
       {{"frequency_hz", {50.0}}, {"amplitude", {2.0e-4}}, {"phase_rad", {0.8}}}});
  const Hints hints = hints_for(truth);
  const physics::Line& line = hints.line[index_of(Channel::displacement)];
  EXPECT_NEAR(line.frequency_hz, 50.0, 0.02);
  EXPECT_NEAR(line.amplitude, 2.0e-4, 3.0e-5);
  EXPECT_GT(std::cos(line.phase_rad - 0.8), 0.8);
}

TEST(Hints, KnowWhenAnEpisodeLasts) {
  const auto truth = test::with_term(driven_mass(), "force_episode",
                                     {{"force_n", {2.0}}, {"begin_s", {9.0}}, {"end_s", {14.0}}});
  const Hints hints = hints_for(truth);
  ASSERT_FALSE(hints.episodes_s.empty());
  double nearest = 10.0;
  for (const auto& [begin, end] : hints.episodes_s) {
    nearest = std::min(nearest, std::abs(begin - 9.0) + std::abs(end - 14.0));
  }
  EXPECT_LT(nearest, 2.0);
}

// A base-excited mass whose base is read with noise that moves it more than the gauge's noise.
TEST(BaseDoubt, IsPartOfWhatResidualsAreWeighedWith) {
  physics::Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4};
  model.oscillator.damping_ratio = physics::Parameter{0.05};
  model.sensors[index_of(Channel::displacement)].noise_std = 1.0e-5;
  model.sensors[index_of(Channel::base_displacement)].noise_std = 1.0e-4;
  physics::SimulationOptions options;
  options.step_s = 5.0e-4;
  physics::RigSimulator rig(model, options);
  protocol::Recording recording;
  recording.source = "base.csv";
  recording.channels =
      (1U << index_of(Channel::displacement)) | (1U << index_of(Channel::base_displacement));
  const auto base = [](double time_s) {
    const double a = 2.0 * std::numbers::pi * 3.1;
    const double b = 2.0 * std::numbers::pi * 1.3;
    physics::Input input;
    input.base_displacement_m = 0.004 * std::sin(a * time_s) + 0.002 * std::sin(b * time_s);
    input.base_acceleration_m_s2 =
        -0.004 * a * a * std::sin(a * time_s) - 0.002 * b * b * std::sin(b * time_s);
    return input;
  };
  for (int k = 0; k <= 4000; ++k) {
    for (int part = 1; k > 0 && part <= 10; ++part) {
      rig.advance(5.0e-4, base((k - 1) * 5.0e-3 + part * 5.0e-4));
    }
    Frame frame = rig.read();
    frame.time_ns = std::int64_t{5'000'000} * k;
    frame.valid &= recording.channels;
    recording.frames.push_back(frame);
  }
  std::vector<Experiment> experiments{experiment_of(recording, model)};
  Task task = test::all_windows(experiments);
  task.sigma = noise_sigma(experiments);
  const Hypothesis truth(model);
  ASSERT_GT(experiments[0].base_doubt_m_s2, 0.0);
  const double doubted = fit_states(task, truth, {}).chi2_per_sample();
  experiments[0].base_doubt_m_s2 = 0.0;
  const double believed = fit_states(task, truth, {}).chi2_per_sample();
  EXPECT_GT(believed, 1.3);
  EXPECT_LT(doubted, 1.1);
  EXPECT_GT(doubted, 0.8);
}

}  // namespace
}  // namespace stickslip::diagnosis
