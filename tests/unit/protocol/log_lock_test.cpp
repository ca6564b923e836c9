// SPDX-License-Identifier: Apache-2.0
// Locks of logs, against a process of its own that takes and releases one all the time.
#include "protocol/log_lock.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <string>

#include "physics/problem.h"

namespace stickslip::protocol {
namespace {

class LogLock : public testing::Test {
 protected:
  void SetUp() override {
    file_ = std::filesystem::path(testing::TempDir()) /
            ("log_lock_" + std::to_string(::getpid()) + ".log");
    std::ofstream(file_) << "x";
  }
  void TearDown() override {
    if (other_ > 0) {
      ::kill(other_, SIGKILL);
      ::waitpid(other_, nullptr, 0);
    }
    std::filesystem::remove(file_);
  }
  // Another process that holds the lock, or releases and takes it again and again.
  void begin_other(bool releases) {
    other_ = ::fork();
    if (other_ != 0) return;
    const int descriptor = ::open(file_.c_str(), O_RDONLY | O_CLOEXEC);
    for (;;) {
      ::flock(descriptor, LOCK_EX);
      if (!releases) ::pause();
      ::usleep(50);
      ::flock(descriptor, LOCK_UN);
      ::usleep(50);
    }
  }
  // The error that a writer gets; empty if the file is free.
  std::string refusal() const {
    try {
      require_free_log(file_);
    } catch (const InputError& error) {
      return error.what();
    }
    return {};
  }

  std::filesystem::path file_;
  pid_t other_ = 0;
};

TEST_F(LogLock, NamesTheProcessThatHoldsIt) {
  EXPECT_EQ(refusal(), "");
  begin_other(false);
  while (refusal().empty()) ::usleep(1000);
  EXPECT_THAT(refusal(), testing::HasSubstr("process " + std::to_string(other_) + " ("));
}

TEST_F(LogLock, ThatIsReleasedMeanwhileIsFree) {
  begin_other(true);
  int refused = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::string words = refusal();
    if (words.empty()) continue;
    ++refused;
    ASSERT_THAT(words, testing::HasSubstr("process " + std::to_string(other_)));
  }
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace stickslip::protocol
