// A contact that bounces.
#include "drivers/amplifier/debounced.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace stickslip::drivers::gpio {
namespace {

TEST(Debounced, IsActiveUntilItWasInactiveForLongEnough) {
  Debounced contact(100);
  EXPECT_TRUE(contact.update(false, 0));
  EXPECT_TRUE(contact.update(false, 99));
  EXPECT_FALSE(contact.update(false, 100));
}

TEST(Debounced, PressingCountsAtOnceAndBeginsTheTimeAnew) {
  Debounced contact(100);
  contact.update(false, 0);
  contact.update(false, 100);
  EXPECT_TRUE(contact.update(true, 101));
  EXPECT_TRUE(contact.update(false, 102));
  EXPECT_TRUE(contact.update(true, 190));
  EXPECT_TRUE(contact.update(false, 191));
  EXPECT_TRUE(contact.update(false, 290));
  EXPECT_FALSE(contact.update(false, 291));
}

TEST(Debounced, WithoutATimeItIsWhatItSees) {
  Debounced contact(0);
  EXPECT_FALSE(contact.update(false, 0));
  EXPECT_TRUE(contact.update(true, 0));
  EXPECT_FALSE(contact.update(false, 0));
}

RC_GTEST_PROP(Debounced, IsInactiveOnlyAfterAWholeQuietTime, ()) {
  const auto hold = *rc::gen::inRange<std::int64_t>(0, 50);
  Debounced contact(hold);
  std::int64_t now = 0;
  std::int64_t quiet_since = -1;
  const int steps = *rc::gen::inRange(1, 60);
  for (int i = 0; i < steps; ++i) {
    now += *rc::gen::inRange<std::int64_t>(0, 20);
    const bool level = *rc::gen::inRange(0, 4) == 0;
    if (level) quiet_since = -1;
    if (!level && quiet_since < 0) quiet_since = now;
    RC_ASSERT(contact.update(level, now) == (level || now - quiet_since < hold));
  }
}

}  // namespace
}  // namespace stickslip::drivers::gpio
