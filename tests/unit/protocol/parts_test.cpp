// SPDX-License-Identifier: Apache-2.0
// Recordings in several logs.
#include "protocol/recording_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>

#include "physics/problem.h"
#include "protocol/recording.h"
#include "tests/unit/protocol/files.h"
#include "tests/unit/protocol/logs.h"

namespace stickslip::protocol {
namespace {

using testing::HasSubstr;

const bool seeded = setenv("RC_PARAMS", "seed=7669", 0) == 0;

class Parts : public testing::Test {
 protected:
  /// Parts of 20, 30 and 40 frames.
  void SetUp() override {
    write({.part = 0, .first = 0, .frames = 20, .closed = false});
    write({.part = 1, .first = 20, .frames = 30, .closed = false});
    write({.part = 2, .first = 50, .frames = 40});
  }
  void write(const LogOfADaemon& log) {
    const std::filesystem::path file = part_file(folder / "run.log", log.part);
    log.write(file);
    if (std::find(files.begin(), files.end(), file) == files.end()) files.push_back(file);
  }
  std::string refusal() {
    try {
      join_logs(files, folder / "all.log");
    } catch (const InputError& error) {
      EXPECT_FALSE(std::filesystem::exists(folder / "all.log"));
      return error.what();
    }
    return "accepted";
  }
  Folder folder;
  std::vector<std::filesystem::path> files;
};

TEST_F(Parts, AreNamedAfterTheFirst) {
  EXPECT_EQ(part_file("a/run.log", 0), "a/run.log");
  EXPECT_EQ(part_file("a/run.log", 1), "a/run.001.log");
  EXPECT_EQ(part_file("run.x.lcm", 1234), "run.x.1234.lcm");
  EXPECT_EQ(part_file("run", 2), "run.002");
}

TEST_F(Parts, AreJoinedInAnyOrder) {
  std::reverse(files.begin(), files.end());
  const JoinResult joined = join_logs(files, folder / "all.log");
  EXPECT_EQ(joined.parts, 3U);
  EXPECT_EQ(joined.frames, 90U);
  EXPECT_EQ(joined.missing, 0U);
  const Recording all = read_recording(folder / "all.log");
  EXPECT_EQ(all.frames, frames_from(0, 90));
  EXPECT_EQ(all.description.part, 0);
  const LogSurvey survey = survey_log(folder / "all.log");
  EXPECT_THAT(survey.faults(), testing::IsEmpty());
  EXPECT_TRUE(survey.ledger->closed());
  std::map<std::string, std::uint64_t> events;
  for (const ChannelEvents& channel : survey.channels) events[channel.name] = channel.events;
  EXPECT_EQ(events[recording_channel], 1U);
  EXPECT_EQ(events[status_channel], 3U);
}

TEST_F(Parts, AMissingPartIsReported) {
  files.erase(files.begin() + 1);
  EXPECT_THAT(refusal(), testing::AllOf(HasSubstr("part 1 is missing"), HasSubstr("previous.log")));
}

TEST_F(Parts, ARepeatedPartIsRefused) {
  std::filesystem::copy(files[1], folder / "copy.log");
  files.push_back(folder / "copy.log");
  EXPECT_THAT(refusal(), HasSubstr("are the same part"));
}

TEST_F(Parts, APartOfAnotherRecordingIsRefused) {
  write({.part = 1, .first = 20, .frames = 30, .started_utc_us = 5});
  EXPECT_THAT(refusal(), HasSubstr("another recording"));
}

TEST_F(Parts, MissingFramesOfAPartAreReported) {
  write({.part = 1, .first = 20, .frames = 20, .closed = false});
  EXPECT_THAT(refusal(),
              HasSubstr("has 20 frames; " + (folder / "run.002.log").string() + " expects 30"));
}

TEST_F(Parts, ADamagedPartIsRefusedAndOnlyTheLastMayBeCutOff) {
  const std::string last = content(files[2]);
  protocol::write(files[2], last.substr(0, last.size() - 3));
  EXPECT_GT(join_logs(files, folder / "all.log").cut_off_bytes, 0);
  EXPECT_EQ(read_recording(folder / "all.log").frames, frames_from(0, 90));
  std::filesystem::remove(folder / "all.log");
  const std::string middle = content(files[1]);
  protocol::write(files[1], middle.substr(0, middle.size() - 3));
  EXPECT_THAT(refusal(), HasSubstr("stickslip log repair"));
}

RC_GTEST_PROP(Joining, RestoresAnyPartition, ()) {
  const Folder folder;
  std::vector<std::filesystem::path> files;
  std::uint64_t first = 0;
  const auto count = *rc::gen::inRange<std::int32_t>(1, 8);
  for (std::int32_t part = 0; part < count; ++part) {
    const auto frames = *rc::gen::inRange<std::size_t>(1, 60);
    files.push_back(part_file(folder / "r.log", part));
    LogOfADaemon{.part = part, .first = first, .frames = frames, .closed = part + 1 == count}.write(
        files.back());
    first += frames;
  }
  RC_ASSERT(join_logs(files, folder / "all.log").frames == first);
  RC_ASSERT(read_recording(folder / "all.log").frames == frames_from(0, first));
}

}  // namespace
}  // namespace stickslip::protocol
