// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lcm/eventlog.h>
#include <sys/resource.h>

#include <cerrno>
#include <csignal>
#include <random>
#include <sstream>
#include <stickslip/recording_info_t.hpp>

#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_events.h"
#include "protocol/recording_log.h"
#include "tests/unit/protocol/files.h"

namespace stickslip::protocol {
namespace {

using testing::HasSubstr;

Recording some_recording(std::size_t count) {
  Recording out;
  for (std::size_t i = 0; i < count; ++i) {
    Frame frame;
    frame.time_ns = static_cast<std::int64_t>(i) * 1'000'000;
    frame.sequence = i * 2;
    frame.set(Channel::displacement, 0.001 * static_cast<double>(i));
    out.channels |= frame.valid;
    out.frames.push_back(frame);
  }
  return out;
}

std::string log_text(const Recording& recording, std::size_t frames_per_block = 10) {
  const Folder folder;
  write_log(recording, folder / "r.log", frames_per_block);
  return content(folder / "r.log");
}

Recording parse(const std::string& text) {
  std::istringstream in(text);
  return parse_log(in, "r.log");
}

std::string refusal(const std::string& text) {
  try {
    parse(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

template <class Message>
std::vector<std::uint8_t> encoded(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

TEST(Log, KeepsSequenceNumbersAndItsDescription) {
  const Folder folder;
  Recording before = some_recording(25);
  before.description = {1'700'000'000'000'000, "bench", "stickslipd", "0.1.0", "[rig]\n",
                        "schema = 1\n"};
  write_log(before, folder / "r.log");
  const Recording after = read_recording(folder / "r.log");
  EXPECT_EQ(after.frames, before.frames);
  EXPECT_EQ(after.description, before.description);
  EXPECT_EQ(after.channels, 1);
  EXPECT_EQ(after.source, (folder / "r.log").string());
}

TEST(Log, TheContentDeterminesTheForm) {
  const Folder folder;
  write_log(some_recording(3), folder / "r.log");
  std::filesystem::rename(folder / "r.log", folder / "r.csv");
  EXPECT_EQ(read_recording(folder / "r.csv").frames.size(), 3U);
  write(folder / "c.log", "time_s,velocity_m_s\n0,1\n");
  EXPECT_EQ(read_recording(folder / "c.log").frames.size(), 1U);
}

// LCM's own reader, which lcm-logplayer uses, reads our logs.
TEST(Log, IsReadByTheReaderOfLcm) {
  const Folder folder;
  write_log(some_recording(25), folder / "r.log");
  lcm_eventlog_t* log = lcm_eventlog_create((folder / "r.log").c_str(), "r");
  ASSERT_NE(log, nullptr);
  std::vector<std::string> channels;
  std::int64_t last = -1;
  std::vector<Frame> frames;
  while (lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log)) {
    channels.emplace_back(event->channel, static_cast<std::size_t>(event->channellen));
    EXPECT_GE(event->timestamp, last);
    EXPECT_EQ(event->eventnum, static_cast<std::int64_t>(channels.size()) - 1);
    last = event->timestamp;
    frame_block_t block;
    if (channels.back() == frames_channel) {
      ASSERT_TRUE(decode(
          {static_cast<const std::uint8_t*>(event->data), static_cast<std::size_t>(event->datalen)},
          block));
      ASSERT_TRUE(from_block(block, frames));
    }
    lcm_eventlog_free_event(event);
  }
  lcm_eventlog_destroy(log);
  EXPECT_THAT(channels, testing::ElementsAre(recording_channel, frames_channel, frames_channel,
                                             frames_channel));
  EXPECT_EQ(frames, some_recording(25).frames);
}

TEST(Log, IgnoresMessagesOfOtherChannels) {
  const Folder folder;
  {
    LogWriter writer(folder / "r.log");
    const std::vector<std::uint8_t> rubbish = {1, 2, 3};
    ASSERT_TRUE(writer.append("CAMERA", rubbish, 5));
    frame_block_t block;
    to_block(some_recording(4).frames, block);
    ASSERT_TRUE(writer.append(frames_channel, encoded(block), 6));
    ASSERT_TRUE(writer.append("EMPTY", {}, 7));
    ASSERT_TRUE(writer.close());
  }
  EXPECT_EQ(read_recording(folder / "r.log").frames, some_recording(4).frames);
}

TEST(Log, TruncatedAnywhereKeepsAllCompleteEvents) {
  const Recording recording = some_recording(30);
  const std::string whole = log_text(recording);
  ASSERT_EQ(parse(whole).cut_off_bytes, 0U);
  std::size_t event_begin = 0;  // where the event that is cut begins
  std::size_t next = 0;
  std::size_t whole_events = 0;
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    if (size == next) {
      event_begin = size;
      next = std::min(whole.find("\xED\xA1\xDA\x01", size + 1), whole.size());
      if (size > 0) ++whole_events;
    }
    const std::string cut = whole.substr(0, size);
    if (whole_events < 2) {  // the description is the first
      EXPECT_THAT(refusal(cut), HasSubstr("has no frames"));
      continue;
    }
    const Recording read = parse(cut);
    EXPECT_EQ(read.cut_off_bytes, size - event_begin) << size;
    ASSERT_EQ(read.frames.size(), 10 * (whole_events - 1)) << size;
    EXPECT_TRUE(std::equal(read.frames.begin(), read.frames.end(), recording.frames.begin()));
  }
  EXPECT_EQ(whole_events, 4U);
}

TEST(Log, ZerosAfterAPowerCutAreNotDamage) {
  const std::string whole = log_text(some_recording(30));
  for (const std::size_t zeros : {1U, 3U, 4U, 28U, 5000U, 300'000U}) {
    const Recording read = parse(whole + std::string(zeros, '\0'));
    EXPECT_EQ(read.frames.size(), 30U);
    EXPECT_EQ(read.cut_off_bytes, zeros);
  }
  EXPECT_THAT(refusal(whole + std::string(5000, '\0') + whole), HasSubstr("damaged"));
}

// Otherwise a length increased by a flipped bit would look like the end of the log.
TEST(Log, DamageFollowedByEventsIsNotTheEnd) {
  const std::string whole = log_text(some_recording(30));
  const std::size_t second = whole.find(sync_word, 1);
  for (std::size_t bit = 0; bit < 31; ++bit) {
    std::string damaged = whole;
    const std::size_t at = second + 27 - bit / 8;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit % 8));
    const std::string message = refusal(damaged);
    EXPECT_THAT(message, HasSubstr("damaged")) << bit;
    EXPECT_THAT(message, HasSubstr("stickslip log repair r.log")) << bit;
  }
}

TEST(Log, RefusesBytesAfterItsEnd) {
  const std::string whole = log_text(some_recording(30));
  EXPECT_THAT(
      refusal(whole + "rubbish, not an event"),
      HasSubstr("at byte " + std::to_string(whole.size()) + ": damaged: no event begins here"));
}

TEST(Log, EveryFlippedBitOfAFrameIsDetected) {
  const std::string whole = log_text(some_recording(10));
  const std::size_t frames = whole.find(frames_channel) + std::string(frames_channel).size();
  std::mt19937 random(1);
  for (int round = 0; round < 2000; ++round) {
    std::string damaged = whole;
    const std::size_t at = frames + 16 + random() % (whole.size() - frames - 16);
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random() % 8));
    EXPECT_THAT(refusal(damaged), HasSubstr("is damaged")) << at;
  }
}

TEST(Log, SurvivesImpossibleLengths) {
  const std::string whole = log_text(some_recording(10));
  for (const std::size_t field : {20U, 24U}) {
    for (const std::string length : {"\x7F\xFF\xFF\xFF", "\xFF\xFF\xFF\xFF", "\x80", "\x7F"}) {
      std::string damaged = whole;
      damaged.replace(field, length.size(), length);
      EXPECT_THAT(refusal(damaged), testing::StartsWith("r.log: at byte 0: ")) << field;
    }
  }
}

TEST(Log, RefusesTimeThatGoesBackFromBlockToBlock) {
  const std::string once = log_text(some_recording(10));
  EXPECT_THAT(refusal(once + once), HasSubstr("time does not increase: 0 ns after 9000000 ns"));
}

TEST(Log, RefusesALogWithoutFrames) {
  const Folder folder;
  LogWriter writer(folder / "r.log");
  ASSERT_TRUE(writer.append(recording_channel, encoded(recording_info_t{}), 0));
  ASSERT_TRUE(writer.close());
  EXPECT_THAT(refusal(content(folder / "r.log")),
              HasSubstr("has no frames: nothing was recorded on STICKSLIP_FRAMES"));
}

TEST(LogWriter, CountsAndFlushesItsBytes) {
  const Folder folder;
  LogWriter writer(folder / "r.log");
  const std::vector<std::uint8_t> data(100);
  ASSERT_TRUE(writer.append("CHANNEL", data, 0));
  EXPECT_EQ(writer.bytes_written(), 28U + 7U + 100U);
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(std::filesystem::file_size(folder / "r.log"), writer.bytes_written());
  ASSERT_TRUE(writer.close());
  EXPECT_FALSE(writer.append("CHANNEL", data, 0));
  EXPECT_FALSE(writer.flush());
}

TEST(LogWriter, ReportsAFullDisk) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  LogWriter writer("/dev/full");
  const std::vector<std::uint8_t> data(100000);
  errno = 0;
  const bool written = writer.append("CHANNEL", data, 0) && writer.flush();
  EXPECT_FALSE(written);
  EXPECT_EQ(errno, ENOSPC);
}

TEST(LogWriter, RefusesAMissingFolder) {
  try {
    LogWriter writer("/nowhere/at/all/r.log");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nowhere/at/all/r.log: cannot be written"));
  }
}

TEST(Recording, RefusesFilesThatAreNotRecordings) {
  const Folder folder;
  EXPECT_THROW(read_recording(folder / "absent.csv"), InputError);
  EXPECT_THROW(read_recording(folder / "."), InputError);
  EXPECT_THROW(write_recording(some_recording(3), folder / "r.txt"), InputError);
  EXPECT_THROW(write_recording(some_recording(3), "/nowhere/at/all/r.csv"), InputError);
  EXPECT_THROW(write_recording(some_recording(3), "/nowhere/at/all/r.log"), InputError);
  if (std::filesystem::exists("/dev/full")) {
    std::filesystem::create_symlink("/dev/full", folder / "full.csv");
    EXPECT_THROW(write_recording(some_recording(3000), folder / "full.csv"), InputError);
    std::filesystem::create_symlink("/dev/full", folder / "full.log");
    EXPECT_THROW(write_recording(some_recording(3000), folder / "full.log"), InputError);
  }
}

// A limit of the file size simulates a full disk, which refuses data in the middle of an event.
class FullDisk {
 public:
  FullDisk() {
    getrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, SIG_IGN);
  }
  ~FullDisk() { setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  void limit(rlim_t bytes) {
    rlimit now = before_;
    now.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &now);
  }

 private:
  rlimit before_{};
};

TEST(LogWriter, HasExactlyTheConfirmedEventsAfterATemporarilyFullDisk) {
  const Folder folder;
  const Recording all = some_recording(4000);
  std::vector<Frame> confirmed;
  {
    FullDisk disk;
    LogWriter writer(folder / "r.log");
    std::vector<Frame> unconfirmed;
    int refused = 0;
    for (std::size_t k = 0; k < all.frames.size(); k += 10) {
      if (k == 1000) disk.limit(writer.bytes_written() + 777);  // no end of an event
      if (k == 3000) disk.limit(RLIM_INFINITY);
      const auto some = std::span(all.frames).subspan(k, 10);
      frame_block_t block;
      to_block(some, block);
      if (writer.append(frames_channel, encoded(block), some.front().time_ns / 1000)) {
        unconfirmed.insert(unconfirmed.end(), some.begin(), some.end());
      }
      if (k % 50 != 40) continue;
      if (writer.flush()) {
        confirmed.insert(confirmed.end(), unconfirmed.begin(), unconfirmed.end());
      } else {
        ++refused;
      }
      unconfirmed.clear();
    }
    EXPECT_GT(refused, 3);
    EXPECT_TRUE(writer.close());
  }
  EXPECT_GT(confirmed.size(), 1900U);
  EXPECT_LT(confirmed.size(), 2100U);
  EXPECT_EQ(read_recording(folder / "r.log").frames, confirmed);
}

TEST(LogWriter, LeavesAReadableLogOnAFullDisk) {
  const Folder folder;
  FullDisk disk;
  const Recording all = some_recording(2000);
  LogWriter writer(folder / "r.log");
  std::size_t confirmed = 0;
  disk.limit(20000);
  for (std::size_t k = 0; k < all.frames.size(); k += 10) {
    frame_block_t block;
    to_block(std::span(all.frames).subspan(k, 10), block);
    const bool taken = writer.append(frames_channel, encoded(block), static_cast<std::int64_t>(k));
    if (writer.flush() && taken) confirmed = k + 10;
  }
  EXPECT_FALSE(writer.append(frames_channel, std::vector<std::uint8_t>(30000), 0) &&
               writer.flush());
  static_cast<void>(writer.close());
  EXPECT_GT(confirmed, 100U);
  EXPECT_EQ(read_recording(folder / "r.log").frames.size(), confirmed);
}

}  // namespace
}  // namespace stickslip::protocol
