// SPDX-License-Identifier: Apache-2.0
// The tools' access to LCM, with LCM's in-process provider (memq) instead of a network.
#include "tools/telemetry/lcm_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <csignal>
#include <cstdlib>
#include <string>
#include <vector>

#include "config/lcm_url.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "tools/telemetry/network_of.h"

namespace stickslip::telemetry {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::HasSubstr;

/// LCM_DEFAULT_URL for the duration of a test.
class DefaultUrl {
 public:
  explicit DefaultUrl(const char* url) {
    if (url != nullptr) {
      setenv("LCM_DEFAULT_URL", url, 1);
    } else {
      unsetenv("LCM_DEFAULT_URL");
    }
  }
  ~DefaultUrl() { unsetenv("LCM_DEFAULT_URL"); }
};

std::string parsed_url(const std::string& arguments) {
  CLI::App app;
  std::string url;
  add_url_option(app, url);
  app.parse(arguments, false);
  return url;
}

TEST(UrlOption, StaysOnThisHostByDefault) {
  const DefaultUrl unset(nullptr);
  EXPECT_EQ(parsed_url(""), protocol::default_url);
}

TEST(UrlOption, PrefersTheCommandLineToTheEnvironment) {
  const DefaultUrl url("udpm://239.255.76.67:7000?ttl=0");
  EXPECT_EQ(parsed_url(""), "udpm://239.255.76.67:7000?ttl=0");
  EXPECT_EQ(parsed_url("--url memq://"), "memq://");
}

TEST(UrlOption, IsJudgedAsThatOfAConfiguration) {
  const DefaultUrl unset(nullptr);
  for (const std::string wrong : {"udpm://239.255.76.67:99999", "udpm://10.0.0.1:7667",
                                  "udpm://239.255.76.67:7667?tll=1", "nonsense"}) {
    try {
      parsed_url("--url " + wrong);
      ADD_FAILURE() << wrong;
    } catch (const CLI::ValidationError& error) {
      EXPECT_EQ(error.what(), "--url " + wrong + ": " + config::wrong_with_lcm_url(wrong));
    }
  }
  EXPECT_EQ(parsed_url("--url udpm://239.255.76.67:7000?ttl=1"), "udpm://239.255.76.67:7000?ttl=1");
}

TEST(UrlOption, NamesTheVariableThatIsWrongAndStillHelps) {
  const DefaultUrl wrong("nonsense");
  EXPECT_THROW(parsed_url("--help"), CLI::CallForHelp);
  try {
    parsed_url("");
    ADD_FAILURE();
  } catch (const CLI::ValidationError& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("LCM_DEFAULT_URL=nonsense: expected udpm://"));
  }
}

bool blocked(int signal) {
  sigset_t mask;
  pthread_sigmask(SIG_SETMASK, nullptr, &mask);
  return sigismember(&mask, signal) == 1;
}

TEST(StopSignals, ArePolledAndDoNotTerminate) {
  const StopSignals stop;
  EXPECT_FALSE(stopped_before(stop, steady_clock::now()));
  raise(SIGTERM);
  EXPECT_TRUE(stopped_before(stop, steady_clock::now() + std::chrono::seconds(5)));
}

TEST(StopSignals, RestoreTheSignalMaskAndDropPendingSignals) {
  ASSERT_FALSE(blocked(SIGINT));
  {
    const StopSignals stop;
    EXPECT_TRUE(blocked(SIGINT));
    EXPECT_TRUE(blocked(SIGTERM));
    raise(SIGINT);
  }
  EXPECT_FALSE(blocked(SIGINT)) << "and the pending one has not ended this test";
}

TEST(After, AddsSecondsAndIsUnlimitedForInvalidDurations) {
  const auto start = steady_clock::now();
  EXPECT_EQ(after(start, 1.5) - start, milliseconds(1500));
  for (const double endless : {0.0, -1.0, 1e300}) {
    EXPECT_GT(after(start, endless) - start, std::chrono::hours(24 * 365 * 99)) << endless;
  }
}

TEST(JoinLcm, ReportsAnInvalidUrlInOneLine) {
  testing::internal::CaptureStderr();
  try {
    join_lcm("nonsense://");
    ADD_FAILURE() << "joined";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("does not accept the URL \"nonsense://\""));
    EXPECT_THAT(error.what(), HasSubstr(protocol::default_url));
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "output of LCM itself";
}

struct Collector {
  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    received.push_back(channel + ":" +
                       std::string(static_cast<const char*>(buffer->data), buffer->data_size));
  }
  std::vector<std::string> received;
};

TEST(Listen, DeliversMatchingChannelsWithoutAQueueLimit) {
  const auto lcm = join_lcm("memq://");
  Collector collector;
  listen<&Collector::take>(*lcm, "STICKSLIP_.*", &collector);
  constexpr int messages = 100;  // LCM's default limit is 30
  for (int i = 0; i < messages; ++i) {
    lcm->publish("STICKSLIP_FRAMES", "x", 1);
    lcm->publish("OTHER", "y", 1);
  }
  while (lcm->handleTimeout(0) > 0) {
  }
  EXPECT_THAT(collector.received,
              testing::AllOf(testing::SizeIs(messages), testing::Each("STICKSLIP_FRAMES:x")));
}

TEST(WaitFor, ReportsAMessageAStopSignalOrTheTimeOut) {
  const StopSignals stop;
  const auto lcm = join_lcm("memq://");
  Collector collector;
  listen<&Collector::take>(*lcm, ".*", &collector);
  EXPECT_EQ(wait_for(*lcm, stop, steady_clock::now()), Wake::time_out);
  lcm->publish("A", "x", 1);
  EXPECT_EQ(wait_for(*lcm, stop, steady_clock::now() + std::chrono::seconds(5)), Wake::message);
  raise(SIGTERM);
  EXPECT_EQ(wait_for(*lcm, stop, steady_clock::now() + std::chrono::seconds(5)), Wake::stop)
      << "a signal takes precedence over the message";
}

TEST(EnterNetworkOf, RefusesAProcessThatDoesNotExist) {
  EXPECT_THROW(enter_network_of(2147483647), InputError);
}

}  // namespace
}  // namespace stickslip::telemetry
