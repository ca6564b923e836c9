// SPDX-License-Identifier: Apache-2.0
// The recorder's log: its parts, existing logs, and errors of the disk.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <stickslip/status_t.hpp>
#include <vector>

#include "daemon/loss_monitor.h"
#include "daemon/message_writer.h"
#include "daemon/messages.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/recording.h"
#include "protocol/recording_parts.h"
#include "protocol/recording_survey.h"

namespace {
bool disk_confirms = true;
bool disk_has_space = true;
}  // namespace

// Replaces the C library's function: a disk without space, if a test needs one.
extern "C" int fallocate(int file, int mode, off_t offset, off_t length) {
  if (disk_has_space) {
    return static_cast<int>(::syscall(SYS_fallocate, file, mode, offset, length));
  }
  errno = ENOSPC;
  return -1;
}

// Replaces the C library's function: a disk that fails to sync, if a test needs one.
extern "C" int fdatasync(int file) {
  if (disk_confirms) return static_cast<int>(::syscall(SYS_fdatasync, file));
  errno = EIO;
  return -1;
}

namespace stickslip::daemon {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::Optional;

class RecorderTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name =
        (std::filesystem::temp_directory_path() / "stickslip-recorder-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    file_ = folder_ / "run.log";
    rig_.name = "bench";
    rig_.text = "[rig]\n";
    rig_.model_text = "schema = 1\n";
    open_new_ledger();
  }
  void open_new_ledger() {
    ledger_ = std::make_unique<Ledger>();
    ledger_->recorded().enable();
  }
  void TearDown() override {
    disk_confirms = true;
    disk_has_space = true;
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  void open(RecorderSettings settings) {
    settings.ledger = ledger_.get();
    writer_ = open_log(file_, settings);
    sink_ = std::make_unique<MessageSink>(*writer_);
    EXPECT_EQ(sink_->write_message(recording_info_message(rig_, 1'720'000'000'000'000)),
              WriteResult::ok);
  }

  /// As a stream does; true if the block was written.
  bool write_block(std::size_t frames = 10) {
    std::vector<Sample> block(frames);
    for (Sample& sample : block) {
      sample.frame.sequence = next_++;
      sample.frame.time_ns = static_cast<std::int64_t>(sample.frame.sequence) * 1'000'000;
      sample.frame.set(Channel::displacement, 1e-3);
      ledger_->produce();
    }
    if (sink_->write_block(block) != WriteResult::ok) {
      ledger_->recorded().lose(Loss::write_error, frames);
      return false;
    }
    unflushed_ += frames;
    if (sink_->wants_flush()) flush();
    return true;
  }
  void flush() {
    if (sink_->flush()) {
      ledger_->recorded().deliver(unflushed_);
    } else {
      ledger_->recorded().lose(Loss::write_error, unflushed_);
    }
    unflushed_ = 0;
  }
  void publish_status() {
    Status status;
    status.state = RigState::running;
    status.ledger = ledger_->balance();
    sink_->write_message(status_message(status, 1'720'000'000'000'000));
  }
  /// As at the end of the service: a flush, then the last status.
  bool finish() {
    flush();
    publish_status();
    return writer_->close();
  }

  /// The parts on disk, in order.
  std::vector<std::filesystem::path> parts() const {
    std::vector<std::filesystem::path> out;
    for (int n = 0; std::filesystem::exists(protocol::part_file(file_, n)); ++n) {
      out.push_back(protocol::part_file(file_, n));
    }
    return out;
  }
  std::vector<protocol::LogSurvey> surveys() const {
    std::vector<protocol::LogSurvey> out;
    for (const auto& part : parts()) out.push_back(protocol::survey_log(part));
    return out;
  }
  /// No frame is lost or duplicated, each part is self-contained and ends with its ledger.
  void expect_one_recording(std::uint64_t frames) const {
    const auto logs = surveys();
    EXPECT_THAT(protocol::faults_between(logs), IsEmpty());
    for (const protocol::LogSurvey& log : logs) {
      EXPECT_THAT(log.faults(), IsEmpty()) << log.source;
      ASSERT_TRUE(log.info) << log.source;
      EXPECT_EQ(log.info->configuration, "[rig]\n");
      EXPECT_EQ(log.info->configuration_sha256.size(), 64U);
      ASSERT_TRUE(log.ledger) << log.source;
      EXPECT_EQ(static_cast<std::uint64_t>(log.ledger->recorded - log.info->frames_before),
                log.frames)
          << log.source;
      EXPECT_EQ(log.ledger->frames_before_it, log.frames) << log.source;
    }
    const protocol::JoinResult joined = protocol::join_logs(parts(), folder_ / "all.log");
    EXPECT_EQ(joined.frames, frames);
    EXPECT_EQ(joined.missing, 0U);
    const auto all = protocol::read_recording(folder_ / "all.log").frames;
    ASSERT_EQ(all.size(), frames);
    for (std::size_t i = 0; i < all.size(); ++i) ASSERT_EQ(all[i].sequence, i);
  }

  static std::vector<std::string> codes(const std::vector<Event>& events) {
    std::vector<std::string> out;
    for (const Event& event : events) out.push_back(event.code);
    return out;
  }

  std::filesystem::path folder_;
  std::filesystem::path file_;
  config::Rig rig_;
  std::unique_ptr<Ledger> ledger_;
  std::unique_ptr<MessageWriter> writer_;
  std::unique_ptr<MessageSink> sink_;
  std::uint64_t next_ = 0;
  std::uint64_t unflushed_ = 0;
};

TEST_F(RecorderTest, WritesOnePartWithoutLimits) {
  open({});
  for (int i = 0; i < 100; ++i) write_block();
  EXPECT_TRUE(finish());
  EXPECT_EQ(parts().size(), 1U);
  expect_one_recording(1000);
}

TEST_F(RecorderTest, RotatesAtTheFirstBlockAfterTheDuration) {
  open({.rotate_s = 1.0});
  for (int i = 0; i < 305; ++i) write_block();
  EXPECT_TRUE(finish());
  const auto logs = surveys();
  ASSERT_EQ(logs.size(), 4U);
  // The last frame of the first block is at 9 ms; the 101st ends more than a second later.
  EXPECT_EQ(logs[0].frames, 1010U);
  EXPECT_EQ(logs[1].frames, 1010U);
  EXPECT_EQ(logs[2].info->previous_part, "run.001.log");
  EXPECT_EQ(logs[2].info->frames_before, 2020);
  expect_one_recording(3050);
}

TEST_F(RecorderTest, ReportsHowFarAllPartsAre) {
  open({.rotate_s = 1.0});
  flush();
  EXPECT_EQ(writer_->progress()->length_us, 0);
  for (int i = 0; i < 250; ++i) write_block();
  flush();
  const RecordingProgress now = writer_->progress().value();
  ASSERT_EQ(parts().size(), 3U);
  EXPECT_EQ(now.file, parts()[2]);
  EXPECT_EQ(now.part, 2);
  EXPECT_EQ(now.length_us, 2'490'000);  // between the last frames of the first and the latest block
  std::uintmax_t bytes = 0;
  for (const auto& part : parts()) bytes += std::filesystem::file_size(part);
  EXPECT_EQ(now.bytes, bytes);
  EXPECT_EQ(now.file_bytes, std::filesystem::file_size(parts()[2]));
  EXPECT_TRUE(finish());
}

TEST_F(RecorderTest, RotatesAtTheSizeLimit) {
  open({.rotate_mb = 0.05});
  for (int i = 0; i < 300; ++i) {
    write_block();
    if (i % 37 == 0) publish_status();
  }
  EXPECT_TRUE(finish());
  const auto logs = surveys();
  ASSERT_GT(logs.size(), 3U);
  for (std::size_t i = 0; i + 1 < logs.size(); ++i) {
    EXPECT_GE(logs[i].bytes, 50'000);
    EXPECT_LT(logs[i].bytes, 53'000);
  }
  expect_one_recording(3000);
}

TEST_F(RecorderTest, AnyRotationNeitherLosesNorDuplicatesFrames) {
  std::mt19937 random(11);
  for (int round = 0; round < 8; ++round) {
    TearDown();
    std::filesystem::create_directory(folder_);
    open_new_ledger();
    open({.rotate_s = 1.0 + 0.01 * static_cast<double>(random() % 100),
          .rotate_mb = 0.01 + 0.001 * static_cast<double>(random() % 100),
          .sync_s = static_cast<double>(random() % 2) * 1e-6});
    next_ = 0;
    const std::size_t blocks = 100 + random() % 300;
    std::uint64_t frames = 0;
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::size_t count = 1 + random() % 20;
      EXPECT_TRUE(write_block(count));
      frames += count;
      if (random() % 9 == 0) flush();
      if (random() % 9 == 0) publish_status();
    }
    EXPECT_TRUE(finish());
    expect_one_recording(frames);
  }
}

// A mended model is part of the log in which it came, and of every later part.
TEST_F(RecorderTest, AChangedModelIsInTheRecordingAndItsLaterParts) {
  open({.rotate_s = 1.0});
  for (int i = 0; i < 150; ++i) write_block();  // half of the second part
  Event event;
  event.code = protocol::model_changed_code;
  event.message = "the model is now mended.toml";
  event.time_ns = 1'499'000'000;
  sink_->write_message(event_message(event, 1'720'000'000'000'000));
  rig_.model_text = "schema = 1 # mended\n";
  sink_->write_message(recording_info_message(rig_, 1'720'000'000'000'000));
  for (int i = 0; i < 155; ++i) write_block();
  EXPECT_TRUE(finish());
  expect_one_recording(3050);  // also joined
  const auto logs = surveys();
  ASSERT_EQ(logs.size(), 4U);
  for (std::size_t i = 0; i < logs.size(); ++i) {
    EXPECT_EQ(logs[i].info->model, i < 2 ? "schema = 1\n" : "schema = 1 # mended\n") << i;
    EXPECT_EQ(logs[i].info->part, static_cast<int>(i));
    EXPECT_EQ(logs[i].model_changes.size(), i == 1 ? 1U : 0U) << i;
    EXPECT_EQ(protocol::read_recording(parts()[i]).description.part, static_cast<int>(i));
  }
  const protocol::Recording all = protocol::read_recording(folder_ / "all.log");
  EXPECT_EQ(all.description.model, rig_.model_text);
  EXPECT_EQ(all.description.part, 0);
  EXPECT_THAT(all.model_changes,
              testing::ElementsAre(protocol::ModelChange{event.time_ns, event.message}));
  EXPECT_EQ(model_change_note(all, all.model_changes[0]),
            all.source + ": after 1.499 s, the model is now mended.toml");
  EXPECT_THAT(protocol::survey_log(folder_ / "all.log").faults(), IsEmpty());
}

TEST_F(RecorderTest, AnExistingLogIsKept) {
  for (int round = 0; round < 3; ++round) {
    open({});
    next_ = 0;
    for (int i = 0; i <= round; ++i) write_block();
    static_cast<void>(finish());
  }
  std::vector<std::size_t> frames;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    frames.push_back(protocol::read_recording(entry.path()).frames.size());
  }
  EXPECT_THAT(frames, testing::UnorderedElementsAre(10, 20, 30));
  EXPECT_EQ(protocol::read_recording(file_).frames.size(), 30U);
}

TEST_F(RecorderTest, AnExistingLogBehindALinkIsKept) {
  const std::filesystem::path link = folder_ / "link.log";
  open({});
  write_block();
  static_cast<void>(finish());
  std::filesystem::create_symlink(file_, link);
  file_ = link;
  open({});
  for (int i = 0; i < 2; ++i) write_block();
  static_cast<void>(finish());
  std::vector<std::size_t> frames;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.is_symlink()) continue;
    frames.push_back(protocol::read_recording(entry.path()).frames.size());
  }
  EXPECT_THAT(frames, testing::UnorderedElementsAre(10, 20));
}

// A limit on the size of files in place of a full disk: writes fail in the middle of an event.
class FullDisk {
 public:
  FullDisk() {
    getrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, SIG_IGN);
  }
  ~FullDisk() { setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  void limit(rlim_t bytes) const {
    rlimit now = before_;
    now.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &now);
  }
  void lift() const { limit(before_.rlim_cur); }

 private:
  rlimit before_{};
};

TEST_F(RecorderTest, LossesOnAFullDiskAreInTheLedgerAndTheLogStaysValid) {
  const FullDisk disk;
  open({});
  for (int i = 0; i < 400; ++i) {
    if (i == 100) disk.limit(60'000);
    if (i == 300) disk.lift();
    write_block();
    if (i % 5 == 4) flush();
  }
  EXPECT_TRUE(finish());
  const auto log = protocol::survey_log(file_);
  EXPECT_THAT(log.faults(), IsEmpty());
  ASSERT_TRUE(log.ledger);
  EXPECT_GT(log.ledger->lost(), 1000);
  EXPECT_EQ(log.ledger->recorded, static_cast<std::int64_t>(log.frames));
  EXPECT_EQ(log.missing, static_cast<std::uint64_t>(log.ledger->lost()));
}

TEST_F(RecorderTest, TheRecordingInfoComesFirstEvenIfTheDiskIsFullAtTheStart) {
  const FullDisk disk;
  open({});
  disk.limit(20);
  for (int i = 0; i < 20; ++i) {
    write_block();
    flush();
  }
  disk.lift();
  for (int i = 0; i < 20; ++i) write_block();
  EXPECT_TRUE(finish());
  const auto log = protocol::survey_log(file_);
  EXPECT_THAT(log.faults(), IsEmpty());
  ASSERT_TRUE(log.info);
  EXPECT_EQ(log.info->rig, "bench");
  EXPECT_EQ(log.first_sequence, 200U);
}

TEST_F(RecorderTest, TheTailIsWrittenIntoTheReserveOfAFullDisk) {
  open({});
  for (int i = 0; i < 100; ++i) write_block();
  flush();
  disk_has_space = false;
  std::size_t refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    refused += write_block() ? 0 : 1;
    if (i % 20 == 19) flush();
  }
  EXPECT_GT(refused, 1000U);
  EXPECT_THAT(codes(writer_->take_events()), testing::ElementsAre("recording_fails"));
  // The reserve holds, whatever came before.
  const Event event{Severity::error, "write_error", "recording fails"};
  for (int i = 0; i < 500; ++i) {
    EXPECT_EQ(sink_->write_message(event_message(event, 1)), WriteResult::ok);
  }
  EXPECT_TRUE(finish());
  const auto log = protocol::survey_log(file_);
  EXPECT_THAT(log.faults(), IsEmpty());
  ASSERT_TRUE(log.ledger);
  EXPECT_EQ(log.ledger->lost(), static_cast<std::int64_t>(10 * refused));
  EXPECT_EQ(log.ledger->recorded, static_cast<std::int64_t>(log.frames));
  EXPECT_EQ(log.ledger->frames_before_it, log.frames);
}

TEST_F(RecorderTest, ADiskWithSpaceAgainIsUsedAgain) {
  open({});
  disk_has_space = false;
  for (int i = 0; i < 20'000; ++i) write_block();
  flush();
  disk_has_space = true;
  flush();
  EXPECT_TRUE(write_block());
  EXPECT_TRUE(finish());
  EXPECT_THAT(codes(writer_->take_events()),
              testing::ElementsAre("recording_fails", "recording_works"));
}

TEST_F(RecorderTest, ALogInUseIsNeitherRenamedNorWritten) {
  open({.rotate_s = 1.0});
  for (int i = 0; i < 250; ++i) write_block();
  flush();
  const auto latest = parts().back();
  ASSERT_EQ(parts().size(), 3U);
  std::filesystem::rename(file_, folder_ / "tidied.log");
  std::filesystem::rename(folder_ / "run.001.log", folder_ / "tidied.001.log");
  const auto size = std::filesystem::file_size(latest);
  for (const auto& file : {file_, latest}) {
    try {
      open_log(file);
      FAIL() << "expected a refusal of " << file;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(latest.string()));
      EXPECT_THAT(error.what(), HasSubstr("process " + std::to_string(::getpid())));
    }
  }
  EXPECT_THROW(protocol::LogWriter{latest}, InputError);
  EXPECT_FALSE(std::filesystem::exists(file_));
  EXPECT_EQ(std::filesystem::file_size(latest), size);
  EXPECT_TRUE(finish());
  EXPECT_NO_THROW(open_log(file_));  // released
}

TEST_F(RecorderTest, ADeletedLogIsBegunAnewAndItsLastFramesAreLost) {
  open({});
  for (int i = 0; i < 10; ++i) write_block();
  flush();
  for (int i = 0; i < 10; ++i) write_block();
  std::filesystem::remove(file_);
  flush();
  EXPECT_EQ(ledger_->balance().recorded.lost_to(Loss::write_error), 100U);
  const std::vector<Event> events = writer_->take_events();
  EXPECT_THAT(codes(events), testing::ElementsAre("log_begun_anew"));
  EXPECT_EQ(events.front().severity, Severity::error);
  for (int i = 0; i < 10; ++i) write_block();
  EXPECT_TRUE(finish());
  const auto log = protocol::survey_log(file_);
  EXPECT_THAT(log.faults(), IsEmpty());
  ASSERT_TRUE(log.info);
  EXPECT_EQ(log.info->part, 1);
  EXPECT_EQ(log.info->frames_before, 100);
  EXPECT_EQ(log.info->configuration, "[rig]\n");
  EXPECT_EQ(log.first_sequence, 200U);
}

TEST_F(RecorderTest, AMovedLogIsBegunAnewWithoutLoss) {
  open({.rotate_s = 1.0});
  for (int i = 0; i < 10; ++i) write_block();
  std::filesystem::rename(file_, folder_ / "moved.log");
  // Another file has taken its place meanwhile: kept.
  std::ofstream(file_) << "another disk's";
  flush();
  const std::vector<Event> events = writer_->take_events();
  EXPECT_THAT(codes(events), testing::ElementsAre("log_begun_anew"));
  EXPECT_EQ(events.front().severity, Severity::warning);
  for (int i = 0; i < 150; ++i) write_block();
  EXPECT_TRUE(finish());
  EXPECT_EQ(ledger_->balance().recorded.lost_in_total(), 0U);
  const std::vector<std::filesystem::path> files = {folder_ / "moved.log", file_,
                                                    folder_ / "run.002.log"};
  const auto joined = protocol::join_logs(files, folder_ / "all.log");
  EXPECT_EQ(joined.frames, 1600U);
  EXPECT_EQ(joined.missing, 0U);
}

TEST_F(RecorderTest, WithoutAPlaceForANewLogEveryFrameIsLostUntilThereIsOne) {
  const std::filesystem::path inner = folder_ / "inner";
  std::filesystem::create_directory(inner);
  file_ = inner / "run.log";
  open({});
  write_block();
  flush();
  std::filesystem::remove_all(inner);
  for (int i = 0; i < 5; ++i) {
    write_block();
    flush();
  }
  EXPECT_EQ(ledger_->balance().recorded.lost_to(Loss::write_error), 50U);
  EXPECT_THAT(codes(writer_->take_events()), testing::ElementsAre("log_missing"));
  EXPECT_FALSE(finish());
}

TEST_F(RecorderTest, ContinuesInThePreviousPartIfANewOneCannotBeCreated) {
  open({.rotate_s = 1.0});
  std::filesystem::create_directory(folder_ / "run.001.log");  // blocks the next part
  for (int i = 0; i < 305; ++i) write_block();
  EXPECT_TRUE(finish());
  EXPECT_EQ(protocol::read_recording(file_).frames.size(), 3050U);
}

TEST_F(RecorderTest, ADeviceFileIsNotSynced) {
  file_ = "/dev/null";
  open({.sync_s = 1e-9});
  for (int i = 0; i < 20; ++i) write_block();
  EXPECT_TRUE(finish());
}

TEST_F(RecorderTest, LedgerCountsFramesConfirmedByTheDisk) {
  open({.sync_s = 1e-9});  // at every flush
  EXPECT_THAT(ledger_->balance().recorded.confirmed, Optional(0U));
  for (int i = 0; i < 3; ++i) write_block();
  flush();
  EXPECT_THAT(ledger_->balance().recorded.confirmed, Optional(30U));
  EXPECT_THAT(ledger_->balance().text(), Not(HasSubstr("confirmed")));

  disk_confirms = false;
  for (int i = 0; i < 4; ++i) write_block();
  flush();
  EXPECT_EQ(ledger_->balance().recorded.delivered, 70U);  // held by the kernel
  EXPECT_THAT(ledger_->balance().recorded.confirmed, Optional(30U));
  EXPECT_THAT(ledger_->balance().text(), HasSubstr("30 of them confirmed on disk"));

  // Later frames are confirmed; the frames of the failed sync stay unconfirmed.
  disk_confirms = true;
  for (int i = 0; i < 5; ++i) write_block();
  EXPECT_FALSE(finish());
  EXPECT_EQ(ledger_->balance().recorded.delivered, 120U);
  EXPECT_THAT(ledger_->balance().recorded.confirmed, Optional(80U));
  EXPECT_TRUE(ledger_->balance().is_closed());
}

TEST_F(RecorderTest, NothingIsConfirmedWithoutSyncs) {
  disk_confirms = false;
  open({.sync_s = 0.0});
  write_block();
  EXPECT_TRUE(finish());
  EXPECT_EQ(ledger_->balance().recorded.confirmed, std::nullopt);
}

AccountBalance account(std::uint64_t ring_full, std::uint64_t write_error) {
  AccountBalance out;
  out.enabled = true;
  out.lost[static_cast<std::size_t>(Loss::ring_full)] = ring_full;
  out.lost[static_cast<std::size_t>(Loss::write_error)] = write_error;
  return out;
}

TEST(LossMonitor, ReportsTheBeginningAndTheEndOfLossesOnce) {
  LossMonitor monitor;
  Balance balance;
  balance.recorded = account(0, 0);
  EXPECT_THAT(monitor.update(balance), IsEmpty());
  std::vector<Event> reported;
  for (const std::uint64_t lost : {5U, 1000U, 2000U, 90'000U}) {
    balance.recorded = account(lost, 0);
    for (Event& event : monitor.update(balance)) reported.push_back(std::move(event));
  }
  ASSERT_EQ(reported.size(), 1U);
  EXPECT_EQ(reported[0].severity, Severity::error);
  EXPECT_EQ(reported[0].code, "ring_full");
  reported = monitor.update(balance);
  ASSERT_EQ(reported.size(), 1U);
  EXPECT_EQ(reported[0].severity, Severity::info);
  EXPECT_EQ(reported[0].message, "recording keeps up again; 90000 frames were lost (ring full)");
  EXPECT_THAT(monitor.update(balance), IsEmpty());
  // Separately for each consumer and cause; the second episode counts from its beginning.
  balance.recorded = account(90'010, 3);
  balance.published = account(0, 7);
  EXPECT_EQ(monitor.update(balance).size(), 3U);
  reported = monitor.update(balance);
  ASSERT_EQ(reported.size(), 3U);
  EXPECT_THAT(reported[0].message, testing::HasSubstr("; 10 frames were lost"));
}

}  // namespace
}  // namespace stickslip::daemon
