// SPDX-License-Identifier: Apache-2.0
// Progress of reading and writing.
#include "protocol/progress_callback.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <vector>

#include "protocol/recording.h"
#include "protocol/recording_parts.h"
#include "protocol/recording_survey.h"
#include "tests/unit/protocol/files.h"

namespace stickslip::protocol {
namespace {

Recording long_recording() {
  Recording out;
  for (int i = 0; i < 20000; ++i) {
    Frame frame;
    frame.sequence = static_cast<std::uint64_t>(i);
    frame.time_ns = i * std::int64_t{1'000'000};
    frame.set(Channel::displacement, 1e-3 * (i % 17));
    out.channels |= frame.valid;
    out.frames.push_back(frame);
  }
  return out;
}

class Progress {
 public:
  ProgressCallback done() {
    return [this](double share) { shares_.push_back(share); };
  }
  /// Often called, increasing, within 0 and 1, nearly to the end.
  void expect_valid() const {
    ASSERT_GT(shares_.size(), 5U);
    double before = 0.0;
    for (const double share : shares_) {
      EXPECT_GE(share, before);
      EXPECT_LE(share, 1.0);
      before = share;
    }
    EXPECT_LT(shares_.front(), 0.2);
    EXPECT_GT(shares_.back(), 0.9);
  }

 private:
  std::vector<double> shares_;
};

TEST(ProgressCallback, IsCalledByWritingAndReadingOfBothForms) {
  const Folder folder;
  const Recording recording = long_recording();
  for (const char* name : {"run.csv", "run.log"}) {
    SCOPED_TRACE(name);
    Progress written;
    write_recording(recording, folder / name, written.done());
    written.expect_valid();
    Progress read;
    EXPECT_EQ(read_recording(folder / name, read.done()).frames.size(), 20000U);
    read.expect_valid();
  }
}

TEST(ProgressCallback, IsCalledBySurveyRepairAndJoin) {
  const Folder folder;
  Recording recording = long_recording();
  recording.description.started_utc_us = 1;
  write_recording(recording, folder / "run.log");
  Progress surveyed;
  survey_log(folder / "run.log", surveyed.done());
  surveyed.expect_valid();
  Progress repaired;
  repair_log(folder / "run.log", folder / "whole.log", repaired.done());
  repaired.expect_valid();
  Progress joined;
  const std::vector<std::filesystem::path> parts = {folder / "run.log"};
  join_logs(parts, folder / "joined.log", joined.done());
  joined.expect_valid();
}

TEST(ProgressCallback, PartIsScaledToTheWhole) {
  double reported = -1.0;
  const ProgressCallback whole = [&reported](double share) { reported = share; };
  progress_of_part(whole, 1, 4)(0.5);
  EXPECT_DOUBLE_EQ(reported, 0.375);
  EXPECT_FALSE(progress_of_part({}, 1, 4));
}

}  // namespace
}  // namespace stickslip::protocol
