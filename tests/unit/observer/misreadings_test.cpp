// Sensor effects that a diagnosis has added to the model: a rig whose channels are read wrongly is
// followed about as well as one whose channels are not, by an observer that knows of it.
#include "observer/misreadings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <ostream>
#include <string>

#include "observer/kalman_filter.h"
#include "observer/reading_states.h"
#include "tests/unit/observer/smoothed.h"

namespace stickslip::observer {
namespace {

using test::Law;
using test::Moment;
using test::paper_rig;
using test::rms;
using test::smoothed;

double theta_error(const Moment& m) { return m.estimate.theta - m.truth.theta; }
double velocity_error(const Moment& m) { return m.estimate.velocity_m_s - m.truth.velocity_m_s; }

struct Case {
  std::string name;
  std::vector<physics::Term> terms;
  double worse = 1.15;  ///< at most, than with sound readings
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

physics::Term wrong(std::string id, Channel channel,
                    std::map<std::string, physics::Parameter> parameters,
                    std::optional<Channel> from = {}) {
  return {std::move(id), channel, std::move(parameters), from};
}

physics::Term hum(Channel channel, double amplitude) {
  return wrong("mains_hum", channel,
               {{"frequency_hz", {50.0}}, {"amplitude", {amplitude}}, {"phase_rad", {0.7}}});
}

std::vector<Case> cases() {
  using enum Channel;
  const auto late = [](Channel channel, double by_s) {
    return wrong("channel_delay", channel, {{"delay_s", {by_s}}});
  };
  const auto gain = [](Channel channel, double by) {
    return wrong("gain_error", channel, {{"gain", {by}}});
  };
  const physics::Term drift = wrong("sensor_drift", velocity, {{"rate_per_s", {0.002}}});
  // What is late is also known later: the filter cannot be as good as with all channels in time.
  constexpr double late_is_less = 1.4;
  return {
      {"WrongGain", {gain(friction_force, 1.3)}},
      {"TwoWrongGains", {gain(displacement, 0.8), gain(base_displacement, 1.2)}},
      {"LateForce", {late(friction_force, 0.006)}, late_is_less},
      {"LateDisplacement", {late(displacement, 0.0123)}},
      {"LateVelocity", {late(velocity, 0.0045)}},
      {"LateBase", {late(base_displacement, 0.008)}},
      {"VeryLateVelocity", {late(velocity, 0.03)}, late_is_less},
      {"EarlyForce", {late(friction_force, -0.002)}},
      {"EarlyVelocity", {late(velocity, -0.002)}},
      {"SlowDifferentiator", {{"differentiator_lag", {}, {{"cutoff_hz", {12.0}}}}}},
      {"Leaks",
       {wrong("crosstalk", friction_force, {{"coefficient", {3.0}}}, displacement),
        wrong("crosstalk", displacement, {{"coefficient", {0.01}}}, friction_force)}},
      {"LeaksThatMultiplyToOne",
       {wrong("crosstalk", friction_force, {{"coefficient", {20.0}}}, displacement),
        wrong("crosstalk", displacement, {{"coefficient", {0.05}}}, friction_force)}},
      {"LeakOfWhatIsLate",
       {wrong("crosstalk", friction_force, {{"coefficient", {20.0}}}, displacement),
        late(displacement, 0.006)}},
      // What the leaking channel itself gets wrong behind its chain does not leak.
      {"LeakOfWhatHumsAndWanders",
       {wrong("crosstalk", friction_force, {{"coefficient", {20.0}}}, displacement),
        hum(displacement, 0.0005),
        wrong("sensor_drift", displacement, {{"rate_per_s", {0.0002}}})}},
      {"CurvedBridge", {wrong("bridge_nonlinearity", friction_force, {{"curvature", {1.5}}})}},
      {"Drift", {drift}},
      {"Hum", {hum(friction_force, 0.02)}},
      {"Clipped", {wrong("clipping", velocity, {{"limit", {0.1}}})}},
      {"LateWeakAndWandering",
       {late(friction_force, 0.006), gain(friction_force, 0.7), drift},
       late_is_less},
  };
}

class Misread : public testing::TestWithParam<Case> {};

TEST_P(Misread, RigsAreFollowedAboutAsWellByWhoKnows) {
  const physics::Model sound = paper_rig(Law::state_variable);
  physics::Model misread = sound;
  misread.terms = GetParam().terms;
  const test::Watch how{.duration_s = 8.0};
  const auto reference = test::watch(sound, sound, how);
  const auto aware = test::watch(misread, misread, how);
  EXPECT_EQ(aware.back().estimate.restarts, 0U);
  for (const auto& error : {theta_error, velocity_error}) {
    EXPECT_LT(rms(aware, 3.0, error), GetParam().worse * rms(reference, 3.0, error));
  }
  // It doubts its readings about as much as they are off; more where it looks ahead along a line.
  const bool early = GetParam().name.starts_with("Early");
  EXPECT_GT(test::mean_nis(aware, 3.0), early ? 0.6 : 0.85);
  EXPECT_LT(test::mean_nis(aware, 3.0), 1.05);
  const auto unaware = test::watch(misread, sound, how);
  EXPECT_TRUE(rms(unaware, 3.0, theta_error) > 2.0 * rms(aware, 3.0, theta_error) ||
              rms(unaware, 3.0, velocity_error) > 2.0 * rms(aware, 3.0, velocity_error));
}

INSTANTIATE_TEST_SUITE_P(Channels, Misread, testing::ValuesIn(cases()),
                         [](const auto& info) { return info.param.name; });

// Of a whole recording nothing is late; but the smoother goes along the filter's way, and that is
// not quite as near the truth.
TEST(Misreadings, AreTakenBackByTheSmootherToo) {
  const physics::Model sound = paper_rig(Law::state_variable);
  const auto reference = smoothed(test::watch(sound, sound, {.duration_s = 4.0}), sound);
  for (const Case& one : cases()) {
    if (one.name != "LateForce" && one.name != "Leaks" && one.name != "Hum") continue;
    physics::Model misread = sound;
    misread.terms = one.terms;
    const auto aware = smoothed(test::watch(misread, misread, {.duration_s = 4.0}), misread);
    for (const auto& error : {theta_error, velocity_error}) {
      EXPECT_LT(rms(aware, 2.0, error), 1.25 * rms(reference, 2.0, error)) << one.name;
    }
  }
}

// Beside other physics, which the thorough prediction follows.
TEST(Misreadings, AreTakenBackFromRigsWithOtherPhysicsToo) {
  physics::Model sound = paper_rig(Law::coulomb);
  sound.terms = {{"cubic_stiffness", {}, {{"k3_n_m3", {2.0e4}}}}};
  physics::Model misread = sound;
  misread.terms.push_back(wrong("channel_delay", Channel::velocity, {{"delay_s", {0.006}}}));
  misread.terms.push_back(wrong("gain_error", Channel::friction_force, {{"gain", {1.4}}}));
  misread.terms.push_back(hum(Channel::displacement, 0.001));
  const auto reference = test::watch(sound, sound, {.duration_s = 8.0});
  const auto aware = test::watch(misread, misread, {.duration_s = 8.0});
  EXPECT_EQ(aware.back().estimate.restarts, 0U);
  for (const auto& error : {theta_error, velocity_error}) {
    EXPECT_LT(rms(aware, 3.0, error), 1.25 * rms(reference, 3.0, error));
  }
}

// The daemon's clock does not begin when that of the recording began which the model was made from.
TEST(Misreadings, HumIsFoundWhateverItsPhaseAndThoughItWanders) {
  const physics::Model sound = paper_rig(Law::state_variable);
  physics::Model misread = sound;
  misread.terms = {hum(Channel::friction_force, 0.02)};
  physics::Model believed = misread;
  believed.terms.front().parameters["phase_rad"] = {-2.5};
  believed.terms.front().parameters["amplitude"] = {0.014};
  believed.terms.front().parameters["frequency_hz"] = {50.3};
  const auto reference = test::watch(sound, sound);
  const auto aware = test::watch(misread, believed);
  EXPECT_LT(rms(aware, 3.0, theta_error), 1.15 * rms(reference, 3.0, theta_error));
}

TEST(Misreadings, AZeroThatHasWanderedIsFoundAgainAfterAGap) {
  const physics::Model sound = paper_rig(Law::state_variable);
  physics::Model misread = sound;
  misread.terms = {wrong("sensor_drift", Channel::displacement, {{"rate_per_s", {0.0003}}}),
                   wrong("channel_delay", Channel::friction_force, {{"delay_s", {0.006}}}),
                   hum(Channel::friction_force, 0.01)};
  test::Watch how;
  how.spoil = [](Frame& frame) {
    // Nothing is told for half a second, and then for two seconds of the force.
    const bool nothing = frame.time_s() > 4.0 && frame.time_s() < 4.5;
    for (Channel channel : all_channels) {
      const bool force =
          channel == Channel::friction_force && frame.time_s() > 5.0 && frame.time_s() < 7.0;
      if (nothing || force) frame.invalidate(channel);
    }
  };
  const auto reference = test::watch(sound, sound, how);
  const auto aware = test::watch(misread, misread, how);
  EXPECT_EQ(aware.back().estimate.restarts, 0U);
  EXPECT_LT(rms(aware, 8.0, theta_error), 1.4 * rms(reference, 8.0, theta_error));
  EXPECT_LT(rms(aware, 8.0, velocity_error), 1.15 * rms(reference, 8.0, velocity_error));
}

// A slow source that is also late: the age counts from the reading, the delay from before it.
TEST(Misreadings, TheAgeOfALateReadingIsCountedToo) {
  physics::Model misread = paper_rig(Law::state_variable);
  misread.terms = {wrong("channel_delay", Channel::displacement, {{"delay_s", {0.006}}}),
                   hum(Channel::displacement, 0.0005)};
  for (const int least : {1, 7}) {
    std::vector<Frame> past;
    test::Watch how;
    how.spoil = [&past, least](Frame& frame) {
      past.push_back(frame);
      // Not of the same age each time, or a hum would only have another phase.
      const std::size_t age = static_cast<std::size_t>(least) + 4 * (past.size() % 2);
      if (past.size() <= age) return;
      const Frame& then = past[past.size() - 1 - age];
      frame.set(Channel::displacement, then[Channel::displacement]);
      frame.age_us[index_of(Channel::displacement)] = static_cast<std::int32_t>(1000 * age);
    };
    const auto aware = test::watch(misread, misread, how);
    EXPECT_EQ(aware.back().estimate.restarts, 0U) << least;
    EXPECT_EQ(aware.back().estimate.refusals, 0U) << least;
    EXPECT_LT(test::mean_nis(aware, 3.0), 1.1) << least;
    EXPECT_LT(rms(aware, 3.0, theta_error), 0.02) << least;
  }
}

// Seen through a gain, with noise as much larger, a rig is the same rig.
TEST(Misreadings, AGainWithItsNoiseChangesNothing) {
  const physics::Model sound = paper_rig(Law::state_variable);
  for (const Channel channel : {Channel::base_displacement, Channel::friction_force}) {
    physics::Model misread = sound;
    misread.terms = {wrong("gain_error", channel, {{"gain", {4.0}}})};
    *misread.sensors[index_of(channel)].noise_std *= 4.0;
    const auto one = test::watch(sound, sound, {.duration_s = 3.0});
    const auto four = test::watch(misread, misread, {.duration_s = 3.0});
    for (std::size_t k = 0; k < one.size(); k += 100) {
      EXPECT_NEAR(four[k].estimate.theta, one[k].estimate.theta, 1.0e-6);
    }
  }
}

TEST(Misreadings, OfUnfilteredChannelsThatAreEarlyAreLookedAhead) {
  physics::Model sound = paper_rig(Law::state_variable);
  sound.sensors[index_of(Channel::displacement)].filters.clear();
  physics::Model misread = sound;
  misread.terms = {wrong("channel_delay", Channel::displacement, {{"delay_s", {-0.004}}})};
  const auto reference = test::watch(sound, sound, {.duration_s = 8.0});
  const auto aware = test::watch(misread, misread, {.duration_s = 8.0});
  const auto unaware = test::watch(misread, sound, {.duration_s = 8.0});
  EXPECT_LT(rms(aware, 3.0, velocity_error), 1.5 * rms(reference, 3.0, velocity_error));
  EXPECT_GT(rms(unaware, 3.0, velocity_error), 2.0 * rms(aware, 3.0, velocity_error));
}

// A load that is known exactly need not be measured for its leak to be known.
TEST(Misreadings, ALeakOfAChannelThatNobodyMeasuresIsKnownFromTheModel) {
  physics::Model misread = paper_rig(Law::state_variable);
  misread.terms = {
      wrong("crosstalk", Channel::friction_force, {{"coefficient", {0.5}}}, Channel::normal_load)};
  test::Watch how;
  how.spoil = [](Frame& frame) { frame.invalidate(Channel::normal_load); };
  const auto aware = test::watch(misread, misread, how);
  EXPECT_LT(rms(aware, 3.0, theta_error), 0.014);
  EXPECT_TRUE((aware.back().estimate.innovation_valid >> index_of(Channel::friction_force)) & 1U);
}

// Absurd terms make readings absurd; those are not used, and no number goes astray.
TEST(Misreadings, OfAbsurdSizeLeaveNumbersFinite) {
  const std::vector<physics::Term> terms = {
      wrong("gain_error", Channel::displacement, {{"gain", {1.0e-200}}}),
      wrong("gain_error", Channel::friction_force, {{"gain", {1.0e-6}}}),
      wrong("channel_delay", Channel::velocity, {{"delay_s", {1.0e-160}}}),
      wrong("channel_delay", Channel::velocity, {{"delay_s", {2.0e-7}}})};
  for (const physics::Term& term : terms) {
    physics::Model believed = paper_rig(Law::coulomb);
    believed.terms = {term};
    for (const Moment& m : test::watch(paper_rig(Law::coulomb), believed, {.duration_s = 1.0})) {
      ASSERT_TRUE(std::isfinite(m.estimate.theta + m.estimate.displacement_m +
                                m.estimate.innovation_std[0] + m.estimate.nis))
          << term.id;
    }
  }
}

// What is wrong with the rig's model must not be explained away by a drive that was not there.
TEST(Misreadings, ALateDriveIsLearntFromItsOwnChannelAlone) {
  physics::Model model = paper_rig(Law::coulomb);
  model.terms = {wrong("channel_delay", Channel::base_displacement, {{"delay_s", {0.006}}})};
  const Followed what = followed(model);
  std::string reason;
  const physics::Rig rig(what.model);
  const Layout layout = layout_of(what.model, rig, reason, what.laws);
  KalmanFilter one(model, 1.0e-3);
  KalmanFilter other(model, 1.0e-3);
  const auto run = test::watch(model, model, {.duration_s = 2.0});
  for (const Moment& m : run) {
    one.update(m.frame);
    Frame frame = m.frame;
    if (&m == &run.back()) frame.set(Channel::velocity, m.frame[Channel::velocity] + 0.003);
    other.update(frame);
  }
  layout.of(Channel::base_displacement).each_own_state([&](int state) {
    EXPECT_EQ(one.mean()[state], other.mean()[state]) << state;
  });
  EXPECT_NE(one.mean()[layout.rig[physics::state::v]], other.mean()[layout.rig[physics::state::v]]);
}

// Innovations are those of what was read, so that a likelihood is that of the readings.
TEST(Misreadings, InnovationsHaveTheUnitOfTheReading) {
  const physics::Model sound = paper_rig(Law::state_variable);
  physics::Model misread = sound;
  misread.terms = {wrong("gain_error", Channel::friction_force, {{"gain", {3.0}}})};
  // The same readings, three times as large.
  misread.sensors[index_of(Channel::friction_force)].noise_std = 3.0 * 6.0e-4;
  const auto one = test::watch(sound, sound, {.duration_s = 3.0});
  const auto three = test::watch(misread, misread, {.duration_s = 3.0});
  const auto innovation = [](const Moment& m) {
    return m.estimate.innovation[index_of(Channel::friction_force)];
  };
  EXPECT_NEAR(rms(three, 1.0, innovation), 3.0 * rms(one, 1.0, innovation),
              0.01 * rms(three, 1.0, innovation));
  EXPECT_NEAR(three.back().estimate.innovation_std[index_of(Channel::friction_force)],
              3.0 * one.back().estimate.innovation_std[index_of(Channel::friction_force)], 1.0e-6);
}

// exp(-i w delay), up to the frequencies at which a rig moves.
TEST(ReadingStates, DelayASineByTheirDelay) {
  constexpr double period_s = 1.0e-3;
  for (const double delay_s : {0.0003, 0.004, 0.011, 0.03}) {
    physics::Model model = paper_rig(Law::coulomb);
    model.terms = {wrong("channel_delay", Channel::displacement, {{"delay_s", {delay_s}}})};
    const Followed what = followed(model);
    const physics::Rig rig(what.model);
    std::string reason;
    const Layout layout = layout_of(what.model, rig, reason, what.laws);
    ASSERT_EQ(reason, "");
    const ReadingStates states(layout, period_s);
    const Chain& chain = layout.of(Channel::displacement);
    const Sight sight = sight_of(layout, Channel::displacement, 0.0);
    for (const double frequency_hz : {2.4, 19.3, 50.0}) {
      const double w = 2.0 * std::numbers::pi * frequency_hz;
      Vector before = Vector::Zero(layout.count);
      Vector after = before;
      double worst = 0.0;
      for (int k = 1; k <= 2000; ++k) {
        const double t = k * period_s;
        Transition transition(layout.count);
        transition.clear();
        for (int i = 0; i < layout.count; ++i) transition.begin_row();
        after[chain.reading] = std::sin(w * t);
        states.advance(before, after, transition);
        double read = 0.0;
        for (std::size_t j = 0; j < static_cast<std::size_t>(sight.count); ++j) {
          read += sight.weight[j] * after[sight.at[j]];
        }
        if (k > 500) worst = std::max(worst, std::abs(read - std::sin(w * (t - delay_s))));
        before = after;
      }
      EXPECT_LT(worst, frequency_hz < 20.0 ? 0.01 : 0.1) << delay_s << " s, " << frequency_hz;
    }
  }
}

TEST(Misreadings, AreRefusedWithAReasonWhereThereIsNoRoom) {
  physics::Model model = paper_rig(Law::state_variable);
  for (const Channel channel :
       {Channel::displacement, Channel::velocity, Channel::friction_force}) {
    model.terms.push_back(wrong("channel_delay", channel, {{"delay_s", {0.02}}}));
  }
  const FrictionObserver crowded(model, 1.0e-3);
  EXPECT_NE(crowded.unsupported().find("[[physics]]"), std::string::npos) << crowded.unsupported();

  model.terms = {{"differentiator_lag", {}, {{"cutoff_hz", {30.0}}}}};
  model.sensors[index_of(Channel::velocity)].filters = {
      {physics::FilterKind::butterworth_lowpass, 8, 100.0},
      {physics::FilterKind::butterworth_lowpass, 4, 100.0}};
  const FrictionObserver long_chain(model, 1.0e-3);
  EXPECT_NE(long_chain.unsupported().find("velocity channel has 7 filter sections"),
            std::string::npos)
      << long_chain.unsupported();

  model = paper_rig(Law::coulomb);
  model.sensors[index_of(Channel::friction_force)].filters.clear();
  model.terms = {wrong("channel_delay", Channel::friction_force, {{"delay_s", {-0.002}}})};
  const FrictionObserver early(model, 1.0e-3);
  EXPECT_NE(early.unsupported().find("friction_force channel is early"), std::string::npos)
      << early.unsupported();
}

}  // namespace
}  // namespace stickslip::observer
