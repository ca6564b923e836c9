// SPDX-License-Identifier: Apache-2.0
// Debouncing of a contact.
#include "drivers/amplifier/debounced.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace stickslip::drivers::gpio {
namespace {

constexpr std::int64_t ms = 1'000'000;

TEST(Debounced, IsActiveUntilInactiveForTheHoldTime) {
  Debounced contact(100);
  EXPECT_TRUE(contact.update(false, 0));
  EXPECT_TRUE(contact.update(false, 99));
  EXPECT_FALSE(contact.update(false, 100));
}

TEST(Debounced, PressingIsImmediateAndRestartsTheHoldTime) {
  Debounced contact(200 * ms);
  contact.update(false, 0);
  EXPECT_FALSE(contact.update(false, 200 * ms));
  EXPECT_TRUE(contact.update(true, 201 * ms));
  EXPECT_TRUE(contact.update(false, 202 * ms));
  EXPECT_TRUE(contact.update(true, 390 * ms));
  EXPECT_TRUE(contact.update(false, 391 * ms));
  EXPECT_TRUE(contact.update(false, 590 * ms));
  EXPECT_FALSE(contact.update(false, 591 * ms));
}

TEST(Debounced, WithoutHoldTimePressingLastsATenthOfASecond) {
  Debounced contact(0);
  EXPECT_FALSE(contact.update(false, 0)) << "never pressed";
  EXPECT_TRUE(contact.update(true, 0));
  EXPECT_TRUE(contact.update(false, 0));
  EXPECT_TRUE(contact.update(false, 99 * ms));
  EXPECT_FALSE(contact.update(false, 100 * ms));
}

RC_GTEST_PROP(Debounced, IsInactiveOnlyAfterAWholeQuietTime, ()) {
  const auto hold = *rc::gen::inRange<std::int64_t>(0, 250) * ms;
  Debounced contact(hold);
  std::int64_t now = 0;
  std::int64_t quiet_since = -1;
  std::int64_t pressed_until = 0;
  const int steps = *rc::gen::inRange(1, 60);
  for (int i = 0; i < steps; ++i) {
    now += *rc::gen::inRange<std::int64_t>(0, 80) * ms;
    const bool level = *rc::gen::inRange(0, 4) == 0;
    if (level) pressed_until = now + 100 * ms;
    if (level) quiet_since = -1;
    if (!level && quiet_since < 0) quiet_since = now;
    RC_ASSERT(contact.update(level, now) ==
              (level || now - quiet_since < hold || now < pressed_until));
  }
}

}  // namespace
}  // namespace stickslip::drivers::gpio
