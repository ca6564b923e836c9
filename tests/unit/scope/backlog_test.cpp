// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/backlog.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "messages.h"
#include "tools/scope/wire.h"

namespace stickslip::scope {
namespace {

using namespace std::chrono_literals;
using test::read_json;

const Backlog::Clock::time_point start{};

SharedMessage telemetry(std::size_t size) { return shared_message(size); }
SharedMessage kept() { return shared_message(encode_restart()); }

TEST(Backlog, KeepsTheOrder) {
  Backlog backlog(1000);
  const auto first = telemetry(10);
  const auto second = kept();
  backlog.add(first, start);
  backlog.greet({kept()});
  backlog.add(second, start);
  EXPECT_NE(backlog.take(), first) << "the greeting is sent first";
  EXPECT_EQ(backlog.take(), first);
  EXPECT_EQ(backlog.take(), second);
  EXPECT_EQ(backlog.take(), nullptr);
  EXPECT_TRUE(backlog.empty());
  EXPECT_EQ(backlog.bytes(), 0U);
}

TEST(Backlog, OverflowLosesTelemetryAndReportsIt) {
  Backlog backlog(100);
  const auto important = kept();
  EXPECT_TRUE(backlog.add(telemetry(40), start));
  EXPECT_TRUE(backlog.add(important, start));
  EXPECT_TRUE(backlog.add(telemetry(60), start));
  const auto dropped = backlog.take();
  EXPECT_EQ(read_json(*dropped)["type"], "dropped");
  EXPECT_EQ(read_json(*dropped)["messages"], 2);
  EXPECT_EQ(backlog.take(), important);
  EXPECT_EQ(backlog.take(), nullptr);
  EXPECT_EQ(backlog.lost(), 2U);
}

TEST(Backlog, ResumingClientGetsTheLatestData) {
  Backlog backlog(100);
  for (int i = 0; i < 50; ++i) backlog.add(telemetry(30), start);
  const auto latest = telemetry(30);
  EXPECT_EQ(read_json(*backlog.take())["messages"], 50);
  backlog.add(latest, start);
  EXPECT_EQ(backlog.take(), latest);
}

TEST(Backlog, LosesUntilItIsEmpty) {
  Backlog backlog(100);
  EXPECT_EQ(backlog.losing_for(start), 0s);
  backlog.add(telemetry(200), start + 1s);
  EXPECT_EQ(backlog.losing_for(start + 3s), 2s);
  backlog.take();  // the report of the loss
  backlog.add(telemetry(50), start + 3s);
  EXPECT_EQ(backlog.losing_for(start + 4s), 3s);
  backlog.take();
  EXPECT_EQ(backlog.take(), nullptr);
  EXPECT_EQ(backlog.losing_for(start + 5s), 0s) << "it has caught up";
}

TEST(Backlog, OverflowOfMessagesToKeepClosesTheClient) {
  Backlog backlog(100);
  bool helped = true;
  for (int i = 0; i < 20 && helped; ++i) helped = backlog.add(kept(), start);
  EXPECT_FALSE(helped);
}

RC_GTEST_PROP(Backlog, IsBoundedAndEveryMessageIsSentOrCounted, ()) {
  const auto most = *rc::gen::inRange<std::size_t>(1, 2000);
  Backlog backlog(most);
  std::uint64_t added = 0;
  std::uint64_t sent = 0;
  std::uint64_t reported = 0;
  const auto take = [&] {
    const auto message = backlog.take();
    if (!message) return false;
    if (message->binary()) {
      ++sent;
    } else {
      reported += read_json(*message)["messages"].get<std::uint64_t>();
    }
    return true;
  };
  for (int i = 0; i < 200; ++i) {
    if (*rc::gen::weightedElement<bool>({{3, true}, {1, false}})) {
      RC_ASSERT(backlog.add(telemetry(*rc::gen::inRange<std::size_t>(1, 300)), start));
      ++added;
    } else {
      take();
    }
    RC_ASSERT(backlog.bytes() <= most);
  }
  while (take()) {
  }
  RC_ASSERT(sent + reported == added);
  RC_ASSERT(backlog.empty() && backlog.bytes() == 0U);
}

}  // namespace
}  // namespace stickslip::scope
