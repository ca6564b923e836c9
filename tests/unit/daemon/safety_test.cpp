// SPDX-License-Identifier: Apache-2.0
#include "daemon/safety.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string>
#include <vector>

namespace stickslip::daemon {
namespace {

using drivers::Outcome;
using enum RigState;
using enum RigInput;

constexpr std::array all_states = {faulted, idle, armed, running, stopping};
constexpr std::array all_inputs = {clear, arm, disarm, start, stop, at_rest, fault};
static_assert(all_states.size() == state_count && all_inputs.size() == input_count);

// The state machine, independently of the implementation: states by inputs.
constexpr RigState table[state_count][input_count] = {
    //            clear    arm      disarm    start    stop      at_rest   fault
    /* faulted */ {idle, faulted, faulted, faulted, faulted, faulted, faulted},
    /* idle    */ {idle, armed, idle, idle, idle, idle, faulted},
    /* armed   */ {armed, armed, idle, running, idle, armed, faulted},
    /* running */ {running, running, stopping, running, stopping, running, faulted},
    /* stopping*/ {stopping, stopping, stopping, stopping, stopping, idle, faulted},
};

TEST(Safety, EveryStateRespondsToEveryInputAsInTheTable) {
  for (const RigState state : all_states) {
    for (const RigInput input : all_inputs) {
      EXPECT_EQ(next_state(state, input),
                table[static_cast<std::size_t>(state)][static_cast<std::size_t>(input)])
          << name_of(state) << ", input " << static_cast<int>(input);
    }
  }
}

// Required properties of any such table.
TEST(Safety, NothingMovesWithoutClearArmAndStartInThisOrder) {
  for (const RigState state : all_states) {
    EXPECT_EQ(next_state(state, fault), faulted);
    for (const RigInput input : all_inputs) {
      const RigState next = next_state(state, input);
      if (state == faulted && next != faulted) {
        EXPECT_EQ(input, clear);
      }
      if (!amplifier_allowed(state) && amplifier_allowed(next)) {
        EXPECT_EQ(state, armed);
        EXPECT_EQ(input, start);
      }
      if (state != armed && next == armed) {
        EXPECT_EQ(state, idle);
        EXPECT_EQ(input, arm);
      }
      // Only rest or a fault ends a motion, and a stop never makes it go on.
      if (amplifier_allowed(state) && !amplifier_allowed(next)) {
        EXPECT_TRUE(input == fault || (state == stopping && input == at_rest));
      }
      if (state == stopping) {
        EXPECT_NE(next, running);
      }
    }
  }
}

TEST(Safety, EverySequenceOfSixInputsKeepsTheAmplifierOffUnlessItWasStarted) {
  // 7^6 sequences, from the beginning of the daemon.
  std::array<RigInput, 6> inputs{};
  for (int code = 0; code < 117'649; ++code) {
    int rest = code;
    RigState state = faulted;
    int stage = 0;  // of clear, arm, start; reset by a fault
    for (RigInput& input : inputs) {
      input = all_inputs[static_cast<std::size_t>(rest % 7)];
      rest /= 7;
      state = next_state(state, input);
      if (input == fault) {
        stage = 0;
      } else if (stage == 0 && input == clear) {
        stage = 1;
      } else if (stage == 1 && input == arm) {
        stage = 2;
      } else if (stage == 2 && input == start) {
        stage = 3;
      }
      ASSERT_TRUE(!amplifier_allowed(state) || stage == 3) << code;
    }
  }
}

TEST(Safety, StartsFaultedAndLatchedUntilCleared) {
  Safety safety;
  EXPECT_EQ(safety.state(), faulted);
  EXPECT_EQ(safety.interlock(), Interlock::just_started);
  EXPECT_NE(std::string(safety.cause().c_str()), "");
  EXPECT_TRUE(safety.apply(clear));
  EXPECT_EQ(safety.interlock(), Interlock::none);
  EXPECT_TRUE(safety.cause().empty());
}

TEST(Safety, AFaultLatchesInEveryStateInWhichItMatters) {
  for (std::size_t i = 1; i < interlock_count; ++i) {
    const auto interlock = static_cast<Interlock>(i);
    for (const std::vector<RigInput>& way : std::vector<std::vector<RigInput>>{
             {clear}, {clear, arm}, {clear, arm, start}, {clear, arm, start, stop}}) {
      Safety safety;
      for (const RigInput input : way) safety.apply(input);
      const bool at_rest = safety.state() == idle;
      const bool latches = safety.trip(interlock, Cause("why"), Outcome::lost);
      EXPECT_EQ(latches, !at_rest || latches_at_rest(interlock)) << name_of(interlock);
      if (!latches) continue;
      EXPECT_FALSE(safety.amplifier_allowed());
      EXPECT_FALSE(safety.trip(Interlock::overrun, Cause("later"), Outcome::ok));
      for (const RigInput input : {arm, disarm, start, stop, at_rest ? start : RigInput::at_rest}) {
        EXPECT_FALSE(safety.apply(input));
      }
      EXPECT_EQ(safety.interlock(), interlock);
      EXPECT_EQ(safety.outcome(), Outcome::lost);
      EXPECT_STREQ(safety.cause().c_str(), "why");
    }
  }
}

TEST(Safety, NamesAreUnique) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < interlock_count; ++i) {
    names.insert(name_of(static_cast<Interlock>(i)));
  }
  EXPECT_EQ(names.size(), interlock_count);
}

TEST(Cause, TruncatesAndFormatsNumbersForPeople) {
  Cause cause("x was ");
  cause.add(0.0123).add(" m");
  EXPECT_STREQ(cause.c_str(), "x was 0.0123 m");
  for (int i = 0; i < 50; ++i) cause.add("0123456789");
  EXPECT_EQ(std::string(cause.c_str()).size(), 199U);
}

}  // namespace
}  // namespace stickslip::daemon
