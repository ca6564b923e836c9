// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/dialog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "physics/problem.h"
#include "tools/calibration/renewal.h"

namespace stickslip::calibration {
namespace {

using Wants = Dialog::Wants;
using testing::HasSubstr;

constexpr double offset = 2.0e-5;
constexpr double gain = 2000.0;
constexpr double gravity = 9.81;

DialogSettings settings() {
  DialogSettings out;
  out.channel = Channel::friction_force;
  out.raw_unit = "V/V";
  out.date = "2026-11-22T10:00:00Z";
  out.gravity_m_s2 = gravity;
  return out;
}

/// A simulated operator and sensor.
class Session {
 public:
  explicit Session(DialogSettings settings) : dialog(std::move(settings)) {}

  std::string type(const std::string& line) {
    EXPECT_EQ(dialog.wants(), Wants::answer) << line;
    dialog.answer(line);
    return dialog.take_text();
  }

  /// Types a line, then lets the sensor read that force.
  std::string measure(const std::string& line, double force_n) {
    std::string text = type(line);
    EXPECT_EQ(dialog.wants(), Wants::reading) << line;
    dialog.offer({offset + force_n / gain, 1e-7, 100.0});
    return text + dialog.take_text();
  }

  void answer_introduction() {
    type("weights set 12");
    type("M. Weber");
    type("5 mg");
  }

  /// Up to the review, with an error of the descending reading at 200 g.
  std::string run_to_review(double error_n = 0.0) {
    answer_introduction();
    measure("", 0.0);
    measure("100 g", 0.1 * gravity);
    measure("200 g", 0.2 * gravity);
    measure("0.4 kg", 0.4 * gravity);
    EXPECT_THAT(type(""), HasSubstr("reduce to 1.962 N"));
    measure("", 0.2 * gravity + error_n);
    measure("", 0.1 * gravity);
    return measure("", 0.0);
  }

  Dialog dialog;
};

TEST(KnownValue, IsANumberWithAUnitOfTheChannel) {
  const auto force = [](const char* text) {
    const auto value = known_value(text, Channel::normal_load, 10.0);
    return value ? value->si : std::numeric_limits<double>::quiet_NaN();
  };
  EXPECT_DOUBLE_EQ(force("200 g"), 2.0);
  EXPECT_DOUBLE_EQ(force(" 0.2kg "), 2.0);
  EXPECT_DOUBLE_EQ(force("-50 mg"), -5e-4);
  EXPECT_DOUBLE_EQ(force("+1.5 N"), 1.5);
  EXPECT_DOUBLE_EQ(force("1e3 mN"), 1.0);
  EXPECT_EQ(force("0"), 0.0);
  EXPECT_TRUE(known_value("1 g", Channel::normal_load, 10.0)->by_mass);
  EXPECT_FALSE(known_value("1 N", Channel::normal_load, 10.0)->by_mass);
  for (const char* wrong :
       {"", "g", "200", "200 mm", "200 G", "2,5 N", "nan N", "inf N", "1 N N"}) {
    EXPECT_TRUE(std::isnan(force(wrong))) << wrong;
  }
  EXPECT_DOUBLE_EQ(known_value("250 um", Channel::displacement, 10.0)->si, 2.5e-4);
  EXPECT_FALSE(known_value("1 g", Channel::base_displacement, 10.0));
}

TEST(Dialog, YieldsACalibration) {
  Session session(settings());
  EXPECT_THAT(session.dialog.take_text(), HasSubstr("Which reference"));
  const std::string review = session.run_to_review();
  EXPECT_THAT(review, HasSubstr("`accept`, `again N` or `quit`?"));
  EXPECT_THAT(review, testing::Not(HasSubstr("REFUSED")));
  EXPECT_THAT(session.type("accept"), HasSubstr("0 to 3.924"));
  session.type("-4 4");
  EXPECT_EQ(session.dialog.wants(), Wants::nothing);
  ASSERT_TRUE(session.dialog.result());
  const config::ChannelCalibration& result = *session.dialog.result();
  EXPECT_NEAR(result.offset, offset, 1e-9);
  EXPECT_NEAR(result.gain, gain, 0.05);
  EXPECT_EQ(result.valid, (config::ValidRange{-4.0, 4.0}));
  EXPECT_EQ(result.reference, "weights set 12");
  EXPECT_EQ(result.by, "M. Weber");
  EXPECT_EQ(result.raw_unit, "V/V");
  EXPECT_EQ(result.date, "2026-11-22T10:00:00Z");
  ASSERT_EQ(result.points.size(), 7U);
  EXPECT_DOUBLE_EQ(result.points[1].raw_std, 1e-8);
  EXPECT_DOUBLE_EQ(result.points[1].reference_sigma, 5e-6 * gravity);
  EXPECT_EQ(result.points[0].reference_sigma, 0.0) << "the zero is without load";
}

TEST(Dialog, RejectsABadFitUntilThePointIsRepeated) {
  Session session(settings());
  const std::string review = session.run_to_review(0.05);
  EXPECT_THAT(review, HasSubstr("REFUSED"));
  EXPECT_THAT(review, HasSubstr("point 5 (1.962 N)"));
  EXPECT_THAT(session.type("accept"), HasSubstr("refused"));
  EXPECT_THAT(session.type("again 5"), HasSubstr("apply 1.962 N"));
  EXPECT_THAT(session.measure("", 0.2 * gravity), HasSubstr("`accept`"));
  session.type("accept");
  session.type("");
  ASSERT_TRUE(session.dialog.result());
  EXPECT_EQ(session.dialog.result()->points.size(), 7U);
  EXPECT_TRUE(session.dialog.result()->despite.empty());
}

TEST(Dialog, QuitsAtAnyStepWithoutAChange) {
  for (int answers = 0; answers < 6; ++answers) {
    Session session(settings());
    const std::vector<std::string> lines = {"weights", "me", "0", "", "100 g"};
    for (int i = 0; i < answers && i < 5; ++i) {
      session.type(lines[static_cast<std::size_t>(i)]);
      if (session.dialog.wants() == Wants::reading) session.dialog.offer({1e-5 * i, 1e-8, 10.0});
    }
    EXPECT_THAT(session.type("quit"), HasSubstr("Nothing is changed"));
    EXPECT_EQ(session.dialog.wants(), Wants::nothing);
    EXPECT_FALSE(session.dialog.result());
  }
}

TEST(Dialog, RepeatsTheQuestionAfterAnInvalidAnswer) {
  Session session(settings());
  EXPECT_THAT(session.type(""), HasSubstr("Which reference"));
  EXPECT_THAT(session.type("again 1"), HasSubstr("no points yet"));
  session.type("weights");
  session.type("");
  EXPECT_THAT(session.type("a little"), HasSubstr("found \"a little\""));
  EXPECT_THAT(session.type("-1 g"), HasSubstr("Expected a share"));
  session.type("0.01 %");
  EXPECT_THAT(session.type("200 g"), HasSubstr("Remove all load"));
  session.measure("", 0.0);
  EXPECT_THAT(session.type("200"), HasSubstr("number with its unit"));
  EXPECT_THAT(session.type(""), HasSubstr("At least two values besides the zero"));
  EXPECT_THAT(session.type("again 2"), HasSubstr("1 to 1"));
  EXPECT_THAT(session.type("list"), HasSubstr("0 N"));
  EXPECT_EQ(session.dialog.points().size(), 1U);
}

TEST(Dialog, RepeatsAFailedReading) {
  Session session(settings());
  session.answer_introduction();
  session.type("");
  session.dialog.reading_failed("the daemon is disconnected");
  EXPECT_THAT(session.dialog.take_text(), HasSubstr("the daemon is disconnected"));
  session.type("");
  session.dialog.offer({std::nan(""), 1.0, 10.0});
  EXPECT_EQ(session.dialog.wants(), Wants::answer);
  EXPECT_TRUE(session.dialog.points().empty());
  session.measure("", 0.0);
  EXPECT_EQ(session.dialog.points().size(), 1U);
  // An unsteady reading is reported.
  session.type("1 N");
  session.dialog.offer({1e-3, 1e-5, 100.0});
  EXPECT_THAT(session.dialog.take_text(), HasSubstr("standard deviation is 100 times"));
}

TEST(Dialog, UnknownGravityMakesTheGainUncertain) {
  DialogSettings without_gravity = settings();
  without_gravity.gravity_m_s2.reset();
  Session session(without_gravity);
  session.answer_introduction();
  constexpr double standard = 9.80665;
  session.measure("", 0.0);
  session.measure("100 g", 0.1 * standard);
  session.measure("200 g", 0.2 * standard);
  session.type("");
  session.type("skip");
  session.measure("", 0.0);
  session.type("accept");
  session.type("");
  ASSERT_TRUE(session.dialog.result());
  EXPECT_NEAR(std::sqrt(session.dialog.result()->covariance.gain) / gain, 0.0015, 1e-4);
}

TEST(Dialog, ShowsTheChangeAndKeepsTheCrosstalk) {
  DialogSettings again = settings();
  again.before = config::ChannelCalibration{offset, 1.01 * gain};
  again.before->crosstalk[index_of(Channel::normal_load)] = 0.012;
  Session session(again);
  const std::string review = session.run_to_review();
  EXPECT_THAT(review, HasSubstr("before"));
  EXPECT_THAT(review, HasSubstr("difference      up to -0.03924"));
  session.type("accept");
  session.type("");
  EXPECT_EQ(session.dialog.result()->crosstalk, again.before->crosstalk);
}

TEST(Renewal, KeepsThePreviousCalibrationInTheHistory) {
  config::ChannelCalibration first;
  first.gain = 2.0;
  first.date = "2026-01-01";
  first.reference = "weights";
  const std::string one = renewed("", "c.toml", Channel::normal_load, first);
  config::ChannelCalibration second = first;
  second.gain = 3.0;
  second.date = "2026-02-01";
  const std::string two = renewed(one, "c.toml", Channel::normal_load, second);
  const config::CalibrationFile file = config::parse_calibration(two, "c.toml");
  EXPECT_EQ(file.channel[index_of(Channel::normal_load)], second);
  ASSERT_EQ(file.history.size(), 1U);
  EXPECT_EQ(file.history[0].calibration, first);
  EXPECT_THROW(renewed(two, "c.toml", Channel::normal_load, first), InputError);
  EXPECT_THROW(renewed("schema = 2\n", "c.toml", Channel::normal_load, first), InputError);
  second.reference = "\xff is no text";
  second.date = "2026-03-01";
  EXPECT_THROW(renewed(two, "c.toml", Channel::normal_load, second), InputError);
}

}  // namespace
}  // namespace stickslip::calibration
