#include "daemon/safety.h"

#include <gtest/gtest.h>

#include <string>

namespace stickslip::daemon {
namespace {

using drivers::Outcome;

constexpr std::int64_t ms = 1'000'000;

TEST(Safety, AmplifierIsOnlyAllowedBetweenStartAndStop) {
  Safety safety(100 * ms);
  EXPECT_FALSE(safety.amplifier_allowed());
  safety.start();
  EXPECT_TRUE(safety.amplifier_allowed());
  safety.begin_stop();
  EXPECT_TRUE(safety.amplifier_allowed());
  safety.finish_stop();
  EXPECT_FALSE(safety.amplifier_allowed());
}

TEST(Safety, EveryDeviceFaultLatchesFromEveryState) {
  for (const Outcome outcome : {Outcome::needs_attention, Outcome::lost, Outcome::fatal}) {
    for (int steps = 0; steps < 4; ++steps) {
      Safety safety(100 * ms);
      if (steps > 0) safety.start();
      if (steps > 1) safety.begin_stop();
      if (steps > 2) safety.finish_stop();
      safety.observe_read({outcome, "gone"}, 0);
      EXPECT_TRUE(safety.faulted());
      EXPECT_FALSE(safety.amplifier_allowed());
      safety.start();
      safety.begin_stop();
      safety.finish_stop();
      safety.observe_read({}, ms);
      EXPECT_TRUE(safety.faulted());
      EXPECT_EQ(safety.fault_outcome(), outcome);
      EXPECT_STREQ(safety.fault_cause(), "gone");
    }
  }
}

TEST(Safety, TheFirstCauseStaysAndIsACopy) {
  Safety safety(0);
  std::string words(500, 'x');
  safety.observe_read({Outcome::lost, words.c_str()}, 0);
  words.assign(500, 'y');
  safety.observe_write({Outcome::fatal, words.c_str()}, 0);
  EXPECT_EQ(std::string(safety.fault_cause()), std::string(199, 'x'));
}

TEST(Safety, TemporaryFailuresTripOnlyWhenTheyLast) {
  Safety safety(100 * ms);
  safety.start();
  for (std::int64_t t = 0; t < 1000; t += 50) {
    safety.observe_read({Outcome::temporary, "checksum"}, t * ms);
    safety.observe_read({Outcome::no_data, ""}, (t + 20) * ms);
    safety.observe_read({}, (t + 40) * ms);  // one good reading ends the count
  }
  EXPECT_FALSE(safety.faulted());
  safety.observe_read({Outcome::temporary, "checksum"}, 2000 * ms);
  safety.observe_write({}, 2050 * ms);  // a write that works says nothing about reads
  safety.observe_read({Outcome::temporary, "checksum"}, 2099 * ms);
  EXPECT_FALSE(safety.faulted());
  safety.observe_read({Outcome::temporary, "checksum"}, 2100 * ms);
  EXPECT_TRUE(safety.faulted());
}

TEST(Safety, SilenceOfAReplayIsNoFault) {
  Safety safety(0);
  safety.start();
  for (std::int64_t t = 0; t < 100; ++t) safety.observe_read({Outcome::no_data, ""}, t * 1000 * ms);
  EXPECT_FALSE(safety.faulted());
}

}  // namespace
}  // namespace stickslip::daemon
