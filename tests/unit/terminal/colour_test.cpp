// SPDX-License-Identifier: Apache-2.0
// Choice and application of colours.
#include "tools/terminal/colour.h"

#include <gtest/gtest.h>

namespace {

using namespace stickslip::terminal;

constexpr Abilities terminal{true, false};
constexpr Abilities dumb{true, true};
constexpr Abilities pipe_end{false, false};

TEST(Colour, RequiresACapableTerminal) {
  EXPECT_TRUE(wants_colour(Colours::automatic, terminal, nullptr));
  EXPECT_FALSE(wants_colour(Colours::automatic, dumb, nullptr));
  EXPECT_FALSE(wants_colour(Colours::automatic, pipe_end, nullptr));
}

TEST(Colour, IsDisabledByNoColorUnlessEmpty) {
  EXPECT_FALSE(wants_colour(Colours::automatic, terminal, "1"));
  EXPECT_FALSE(wants_colour(Colours::automatic, terminal, "0"));
  EXPECT_TRUE(wants_colour(Colours::automatic, terminal, ""));
}

TEST(Colour, FollowsAnExplicitChoice) {
  EXPECT_TRUE(wants_colour(Colours::always, pipe_end, "1"));
  EXPECT_TRUE(wants_colour(Colours::always, dumb, nullptr));
  EXPECT_FALSE(wants_colour(Colours::never, terminal, nullptr));
}

TEST(Paint, IsPlainIfOff) {
  const Paint paint(false);
  EXPECT_EQ(paint(Tone::bad, "faulted"), "faulted");
}

TEST(Paint, ResetsTheColour) {
  const Paint paint(true);
  for (const Tone tone : {Tone::good, Tone::note, Tone::warning, Tone::bad, Tone::faint}) {
    const std::string painted = paint(tone, "word");
    EXPECT_EQ(painted.substr(0, 2), "\033[");
    EXPECT_NE(painted.find("mword\033[0m"), std::string::npos) << painted;
  }
  EXPECT_EQ(paint(Tone::plain, "word"), "word");
  EXPECT_EQ(paint(Tone::bad, ""), "");
}

}  // namespace
