// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/connections.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::scope {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::UnorderedElementsAre;

const Clock::time_point start{};

/// Dummy connections; never dereferenced.
lws* name(std::uintptr_t number) { return reinterpret_cast<lws*>(number); }

class ConnectionsTest : public testing::Test {
 protected:
  void add(std::uintptr_t number, const char* peer, Clock::time_point since, Stage stage) {
    connections.add(name(number), Connection(peer, 100, since));
    connections.find(name(number))->stage = stage;
  }
  Connections connections;
  const std::string a = "10.0.0.1";
  const std::string b = "10.0.0.2";
};

TEST_F(ConnectionsTest, AreCountedByKindAndAddress) {
  add(1, "10.0.0.1", start, Stage::requesting);
  add(2, "10.0.0.1", start, Stage::streaming);
  add(3, "10.0.0.2", start, Stage::answering);
  EXPECT_EQ(connections.streams(), 1U);
  EXPECT_EQ(connections.streams(&b), 0U);
  EXPECT_EQ(connections.requests(), 2U);
  EXPECT_EQ(connections.requests(&a), 1U);
  connections.erase(name(3));
  EXPECT_EQ(connections.find(name(3)), nullptr);
  EXPECT_EQ(connections.requests(), 1U);
}

TEST_F(ConnectionsTest, TheOldestRequestIsNeitherAStreamNorAnAnswer) {
  EXPECT_EQ(connections.oldest_request(), nullptr);
  add(1, "10.0.0.1", start, Stage::streaming);
  add(2, "10.0.0.1", start, Stage::answering);
  EXPECT_EQ(connections.oldest_request(), nullptr);
  add(3, "10.0.0.1", start + 2s, Stage::requesting);
  add(4, "10.0.0.2", start + 1s, Stage::requesting);
  EXPECT_EQ(connections.oldest_request(), name(4));
  EXPECT_EQ(connections.oldest_request(&a), name(3));
}

TEST_F(ConnectionsTest, EachStageHasItsTimeLimit) {
  const TimeLimits limits{5s, 20s, 30s};
  add(1, "10.0.0.1", start, Stage::requesting);
  add(2, "10.0.0.1", start, Stage::answering);
  add(3, "10.0.0.1", start, Stage::streaming);
  EXPECT_THAT(connections.overdue(limits, start + 5s), ElementsAre());
  EXPECT_THAT(connections.overdue(limits, start + 6s), ElementsAre(name(1)));
  EXPECT_THAT(connections.overdue(limits, start + 21s), UnorderedElementsAre(name(1), name(2)));
  // A stream may stay open for ever, but not lose messages for ever.
  EXPECT_THAT(connections.overdue(limits, start + 1000h), UnorderedElementsAre(name(1), name(2)));
  connections.find(name(3))->backlog.add(shared_message(std::size_t{200}), start + 1000h);
  EXPECT_THAT(connections.overdue(limits, start + 1000h + 31s),
              UnorderedElementsAre(name(1), name(2), name(3)));
  connections.find(name(1))->enter(Stage::answering, start + 1000h);
  EXPECT_THAT(connections.overdue(limits, start + 1000h + 6s), ElementsAre(name(2)));
}

}  // namespace
}  // namespace stickslip::scope
