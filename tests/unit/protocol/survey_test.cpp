// SPDX-License-Identifier: Apache-2.0
// Survey and repair of logs.
#include "protocol/recording_survey.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <fstream>
#include <random>
#include <sstream>

#include "physics/problem.h"
#include "tests/unit/protocol/files.h"
#include "tests/unit/protocol/logs.h"

namespace stickslip::protocol {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const bool seeded = setenv("RC_PARAMS", "seed=7668", 0) == 0;

LogSurvey survey(const std::string& text) {
  std::istringstream in(text);
  return survey_log(in, "r.log");
}

RepairResult repaired(const std::string& text, std::string& out) {
  const Folder folder;
  write(folder / "in.log", text);
  const RepairResult repair = repair_log(folder / "in.log", folder / "out.log");
  out = content(folder / "out.log");
  return repair;
}

std::vector<Frame> frames_of(const std::string& text) {
  std::istringstream in(text);
  return parse_log(in, "r.log").frames;
}

TEST(Survey, AcceptsAnIntactLog) {
  const LogSurvey found = survey(LogOfADaemon{.frames = 95, .lost = 3}.text());
  EXPECT_THAT(found.faults(), IsEmpty());
  EXPECT_EQ(found.events, 12U);
  EXPECT_EQ(found.frames, 95U);
  EXPECT_EQ(found.first_sequence, 0U);
  EXPECT_EQ(found.last_sequence, 94U);
  EXPECT_DOUBLE_EQ(found.rate_hz(), 1000.0);
  ASSERT_EQ(found.channels.size(), 3U);
  EXPECT_EQ(found.channels[1].name, frames_channel);
  EXPECT_EQ(found.channels[1].events, 10U);
  EXPECT_EQ(found.ranges[0].values, 95U);
  EXPECT_DOUBLE_EQ(found.ranges[0].greatest, 0.094);
  EXPECT_EQ(found.ranges[1].values, 0U);
  EXPECT_EQ(found.ranges[2].values, 48U);
  ASSERT_TRUE(found.ledger);
  EXPECT_TRUE(found.ledger->closed());
  EXPECT_EQ(found.ledger->lost(), 3);
  ASSERT_TRUE(found.info);
  EXPECT_EQ(found.info->rig, "bench");
}

Recording regular_frames(std::size_t count) {
  Recording recording;
  recording.frames = frames_from(0, count);
  return recording;
}

LogSurvey survey_of(const Recording& recording) {
  const Folder folder;
  write_log(recording, folder / "r.log", 10);
  return survey_log(folder / "r.log");
}

// As faults/clock_jump.toml leaves it: the times behind the jump are five seconds ahead.
TEST(Survey, FindsAClockThatWasSetAndKeepsTheRate) {
  Recording recording = regular_frames(4000);
  for (std::size_t i = 2000; i < 4000; ++i) recording.frames[i].time_ns += 5'000'000'000;
  const LogSurvey found = survey_of(recording);
  EXPECT_THAT(found.faults(), IsEmpty());
  ASSERT_EQ(found.time_steps.size(), 1U);
  EXPECT_EQ(found.time_steps[0].after_sequence, 1999U);
  EXPECT_NEAR(found.time_steps[0].excess_s, 5.0, 1e-9);
  EXPECT_NEAR(found.rate_hz(), 1000.0, 1e-6);
  EXPECT_THAT(found.gap_sentences(),
              ElementsAre(HasSubstr("the time steps by 5.000 s after 1.999 s (sequence 1999)")));
}

TEST(Survey, MissingFramesAndJitterAreNoStepsOfTheTime) {
  Recording recording = regular_frames(4000);
  for (std::size_t i = 0; i < 4000; ++i) {
    recording.frames[i].time_ns += static_cast<std::int64_t>(i % 7) * 50'000;
  }
  recording.frames.erase(recording.frames.begin() + 1000, recording.frames.begin() + 3000);
  const LogSurvey found = survey_of(recording);
  EXPECT_THAT(found.time_steps, IsEmpty());
  EXPECT_EQ(found.missing, 2000U);
  EXPECT_NEAR(found.rate_hz(), 1000.0, 0.1);
}

TEST(Survey, TheMedianOfALongLogIsThatOfASubset) {
  Recording recording = regular_frames(200'000);
  for (std::size_t i = 150'000; i < 200'000; ++i) recording.frames[i].time_ns += 250'000'000;
  const LogSurvey found = survey_of(recording);
  ASSERT_EQ(found.time_steps.size(), 1U);
  EXPECT_NEAR(found.time_steps[0].excess_s, 0.25, 1e-9);
  EXPECT_NEAR(found.rate_hz(), 1000.0, 1e-6);
}

Recording frames_every(std::int64_t period_ns, std::size_t count) {
  Recording recording = regular_frames(count);
  for (std::size_t i = 0; i < count; ++i) {
    recording.frames[i].time_ns = static_cast<std::int64_t>(i) * period_ns;
  }
  return recording;
}

// A step is measured in periods of the recording, not in seconds.
TEST(Survey, ASlowRateIsNoStepOfTheTime) {
  for (const std::int64_t period_ns : {100'000'000LL, 200'000'000LL, 5'000'000'000LL}) {
    const LogSurvey found = survey_of(frames_every(period_ns, 100));
    EXPECT_THAT(found.time_steps, IsEmpty()) << period_ns;
    EXPECT_THAT(found.gap_sentences(), IsEmpty()) << period_ns;
    EXPECT_NEAR(found.rate_hz(), 1e9 / static_cast<double>(period_ns), 1e-9);
  }
}

TEST(Survey, FindsAStepOfMoreThanTenPeriodsAtAnyRate) {
  for (const std::int64_t period_ns : {20'000LL, 1'000'000LL, 200'000'000LL}) {
    for (const std::int64_t periods : {9LL, 11LL}) {
      Recording recording = frames_every(period_ns, 1000);
      for (std::size_t i = 500; i < 1000; ++i) {
        recording.frames[i].time_ns += periods * period_ns;
      }
      EXPECT_EQ(survey_of(recording).time_steps.size(), periods > 10 ? 1U : 0U)
          << period_ns << ' ' << periods;
    }
  }
}

TEST(TimeSteps, AreFoundAfterAnyNumberOfSlowFrames) {
  TimeSteps steps;
  std::int64_t time_ns = 0;
  for (std::uint64_t i = 0; i < 300'000; ++i) {
    const std::int64_t next_ns = time_ns + (i == 250'000 ? 7'200'000'000 : 200'000'000);
    steps.add(i, time_ns, next_ns, 1);
    time_ns = next_ns;
  }
  const std::vector<TimeStep> found = steps.found();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].after_sequence, 250'000U);
  EXPECT_NEAR(found[0].excess_s, 7.0, 1e-9);
}

TEST(TimeSteps, AreFoundBehindAStepAtTheStart) {
  TimeSteps steps;
  steps.add(0, 0, 5'000'000'000, 1);
  for (std::uint64_t i = 1; i < 1000; ++i) {
    const auto at_ns = 5'000'000'000 + static_cast<std::int64_t>(i) * 1'000'000;
    steps.add(i, at_ns, at_ns + 1'000'000, 1);
  }
  ASSERT_EQ(steps.found().size(), 1U);
  EXPECT_EQ(steps.found()[0].after_sequence, 0U);
}

// Over an hour of lost frames the period is not known to ten periods.
TEST(TimeSteps, AnInaccuratePeriodIsNoStepOverManyLostFrames) {
  TimeSteps steps;
  for (std::uint64_t i = 0; i < 100; ++i) {
    steps.add(i, static_cast<std::int64_t>(i) * 1'000'000,
              static_cast<std::int64_t>(i + 1) * 1'000'000, 1);
  }
  steps.add(100, 100'000'000, 100'000'000 + 3'600'072'000'000, 3'600'000);
  EXPECT_THAT(steps.found(), IsEmpty());
}

// The description and the ledger are the daemon's, the frames what arrived, the numbers of the
// events those of the program that received them.
TEST(Survey, AReceivedLogThatLostFramesHasGapsButIsNotDamaged) {
  const LogOfADaemon sent{.frames = 100};
  const Folder folder;
  write(folder / "sent.log", sent.text());
  std::ifstream in(folder / "sent.log", std::ios::binary);
  EventReader reader(in, "sent.log");
  LogWriter received(folder / "received.log");
  LogEvent event;
  for (int i = 0; reader.next(event) == EventReader::Found::event; ++i) {
    if (i == 1 || i == 4 || i == 5) continue;
    ASSERT_TRUE(received.append(event.channel, event.data, event.time_us));
  }
  ASSERT_TRUE(received.close());
  const LogSurvey found = survey_log(folder / "received.log");
  EXPECT_THAT(found.faults(), IsEmpty());
  EXPECT_THAT(found.gap_sentences(),
              ElementsAre(HasSubstr("20 frames missing in 1 gap"), HasSubstr("lacks 30 frames")));
}

TEST(Survey, GapsAreCountedButNotFaults) {
  const Folder folder;
  Recording recording;
  for (const std::uint64_t first : {0U, 20U, 15U}) {
    for (Frame frame : frames_from(first, 5)) {
      frame.time_ns = static_cast<std::int64_t>(recording.frames.size()) * 1'000'000;
      recording.frames.push_back(frame);
    }
  }
  write_log(recording, folder / "r.log", 5);
  const LogSurvey found = survey_log(folder / "r.log");
  EXPECT_THAT(found.faults(), IsEmpty());
  EXPECT_EQ(found.gaps, 1U);
  EXPECT_EQ(found.missing, 15U);
  EXPECT_EQ(found.repeats, 1U);
}

TEST(Survey, ARemovedEventIsReported) {
  const std::string whole = LogOfADaemon{.closed = false}.text();
  const std::size_t second = whole.find(sync_word, whole.find(frames_channel));
  const std::size_t third = whole.find(sync_word, second + 1);
  const LogSurvey found = survey(whole.substr(0, second) + whole.substr(third));
  EXPECT_EQ(found.misnumbered, 1U);
  EXPECT_EQ(found.missing, 10U);
  EXPECT_EQ(found.frames, 40U);
  // Number of an event, and the ledger.
  EXPECT_THAT(found.faults(), ElementsAre(HasSubstr("events were removed"),
                                          HasSubstr("does not balance: the ledger has 50 frames "
                                                    "up to its last status, the log has 40")));
}

TEST(Survey, AClosedLedgerBalancesToTheFrame) {
  // A repeated, uncounted block, with another time so that there is no other fault.
  const Folder folder;
  LogOfADaemon{}.write(folder / "r.log");
  std::string text = content(folder / "r.log");
  LogOfADaemon{.part = 0, .first = 50, .frames = 10, .closed = true}.write(folder / "more.log");
  const std::string more = content(folder / "more.log");
  const std::size_t block = more.find(sync_word, 1);
  const std::string extra = more.substr(block, more.find(sync_word, block + 1) - block);
  const std::size_t status = text.rfind(sync_word);
  text.insert(status, extra);
  const LogSurvey found = survey(text);
  EXPECT_EQ(found.frames, 60U);
  EXPECT_THAT(found.faults(), testing::Contains(HasSubstr("does not balance")));
}

TEST(Survey, AnAlteredTextIsReported) {
  std::string text = LogOfADaemon{}.text();
  text[text.find("schema = 1")] = 'S';
  const LogSurvey found = survey(text);
  EXPECT_THAT(found.faults(), ElementsAre("its model does not match its SHA-256"));
}

TEST(Survey, ResynchronisesAfterDamage) {
  const std::string whole = LogOfADaemon{.closed = false}.text();
  const std::size_t second = whole.find(sync_word, 1);
  const std::size_t third = whole.find(sync_word, second + 1);
  {  // a sync word
    std::string damaged = whole;
    damaged[second] = 'x';
    const LogSurvey found = survey(damaged);
    EXPECT_EQ(found.frames, 40U);
    ASSERT_EQ(found.damaged_places, 1U);
    EXPECT_EQ(found.damaged[0].at, static_cast<std::int64_t>(second));
    EXPECT_EQ(found.damaged[0].bytes, static_cast<std::int64_t>(third - second));
    EXPECT_EQ(found.misnumbered, 0U);
  }
  {  // a value of a frame
    std::string damaged = whole;
    damaged[third - 5] = static_cast<char>(damaged[third - 5] ^ 1);
    const LogSurvey found = survey(damaged);
    EXPECT_EQ(found.frames, 40U);
    EXPECT_EQ(found.bad_checksums, 1U);
    EXPECT_EQ(found.damaged_places, 0U);
  }
  // A damaged length costs only its own event.
  for (std::size_t bit = 0; bit < 64; ++bit) {
    std::string damaged = whole;
    const std::size_t at = second + 20 + bit / 8;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit % 8));
    const LogSurvey found = survey(damaged);
    EXPECT_EQ(found.frames, 40U) << bit;
    EXPECT_EQ(found.damaged_places, 1U) << bit;
    EXPECT_EQ(found.cut_off_bytes, 0) << bit;
    EXPECT_EQ(found.damaged_bytes, static_cast<std::int64_t>(third - second)) << bit;
  }
}

TEST(Survey, RefusesOtherFiles) {
  const Folder folder;
  write(folder / "r.csv", "time_s,displacement_m\n0,1\n");
  EXPECT_THROW(survey_log(folder / "r.csv"), InputError);
  EXPECT_THROW(survey_log(folder / "none.log"), InputError);
  EXPECT_THROW(survey_log(folder / "."), InputError);
  EXPECT_THAT(survey("").faults(), ElementsAre("has no events"));
}

TEST(Repair, DoesNotChangeAnIntactLog) {
  const std::string whole = LogOfADaemon{}.text();
  std::string out;
  const RepairResult repair = repaired(whole, out);
  EXPECT_FALSE(repair.dropped_anything());
  EXPECT_EQ(out, whole);
}

TEST(Repair, DropsBlocksThatGoBackInTime) {
  std::string out;
  const RepairResult repair =
      repaired(LogOfADaemon{}.text() + LogOfADaemon{.first = 30}.text(), out);
  EXPECT_EQ(repair.blocks_back_in_time, 2U);
  EXPECT_EQ(repair.frames, 80U);
  EXPECT_EQ(frames_of(out), frames_from(0, 80));
}

TEST(Repair, RefusesToOverwriteTheLogAndFilesWithoutEvents) {
  const Folder folder;
  LogOfADaemon{}.write(folder / "r.log");
  EXPECT_THROW(repair_log(folder / "r.log", folder / "r.log"), InputError);
  write(folder / "rubbish.log", std::string(1000, '\xED'));
  EXPECT_THROW(repair_log(folder / "rubbish.log", folder / "out.log"), InputError);
  EXPECT_FALSE(std::filesystem::exists(folder / "out.log"));
}

RC_GTEST_PROP(Repair, KeepsEveryUndamagedBlock, ()) {
  const auto frames = *rc::gen::inRange<std::size_t>(10, 200);
  std::string text = LogOfADaemon{.frames = frames}.text();
  std::vector<std::size_t> begins;  // of events, and the end
  for (std::size_t at = 0; at != std::string::npos; at = text.find(sync_word, at + 1)) {
    begins.push_back(at);
  }
  begins.push_back(text.size());
  const std::size_t untouched_size = text.size();
  std::vector<bool> touched(begins.size());
  const auto spots = *rc::gen::inRange(0, 6);
  for (int i = 0; i < spots; ++i) {
    const auto at = *rc::gen::inRange<std::size_t>(0, untouched_size);
    const auto length = *rc::gen::inRange<std::size_t>(1, 300);
    for (std::size_t k = at; k < std::min(at + length, text.size()); ++k) {
      text[k] = static_cast<char>(*rc::gen::inRange(0, 256));
    }
    for (std::size_t e = 0; e + 1 < begins.size(); ++e) {
      if (at < begins[e + 1] && at + length > begins[e]) touched[e] = true;
    }
  }
  std::vector<Frame> expected;
  const std::vector<Frame> all = frames_from(0, frames);
  for (std::size_t i = 0; i < frames; ++i) {
    if (!touched[1 + i / 10]) expected.push_back(all[i]);
  }
  RC_PRE(!expected.empty());
  std::string out;
  repaired(text, out);
  // An overwritten block may have been overwritten with the same bytes.
  std::vector<Frame> kept = frames_of(out);
  std::erase_if(kept, [&](const Frame& f) { return touched[1 + f.sequence / 10]; });
  RC_ASSERT(kept == expected);
  RC_ASSERT(survey(out).damaged_places == 0U);
}

RC_GTEST_PROP(Repair, KeepsAllEventsBeforeATruncation, ()) {
  const std::string whole = LogOfADaemon{.frames = 200}.text();
  const auto size = *rc::gen::inRange<std::size_t>(0, whole.size() + 1);
  const LogSurvey found = survey(whole.substr(0, size));
  RC_ASSERT(found.damaged_places == 0U && found.misnumbered == 0U);
  std::uint64_t frames = 0;
  std::size_t end = 0;
  for (std::size_t at = 0; at < whole.size(); at = end) {
    end = std::min(whole.find(sync_word, at + 1), whole.size());
    if (end > size) {
      RC_ASSERT(found.cut_off_bytes == static_cast<std::int64_t>(size - at));
      break;
    }
    if (whole.find(frames_channel, at) < end) frames += 10;
  }
  RC_ASSERT(found.frames == frames);
  if (frames == 0) return;
  std::string out;
  repaired(whole.substr(0, size), out);
  RC_ASSERT(frames_of(out) == frames_from(0, frames));
}

}  // namespace
}  // namespace stickslip::protocol
