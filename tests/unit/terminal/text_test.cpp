// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/text.h"

#include <gtest/gtest.h>

namespace {

using namespace stickslip::terminal;

TEST(Printable, RemovesControlSequences) {
  EXPECT_EQ(printable("a\033[2Jb\nc\x7f"), "a [2Jb c ");
  EXPECT_EQ(printable("a\xC2\x9B"
                      "2J"),
            "a  2J");  // the same sequence in one character
  EXPECT_EQ(printable("Prüfstand µ"), "Prüfstand µ");
}

TEST(CutTo, CountsCharacters) {
  EXPECT_EQ(cut_to("Prüfstand", 9), "Prüfstand");
  EXPECT_EQ(cut_to("Prüfstände", 9), "Prüfst...");
  EXPECT_EQ(cut_to("Prüfstand", 3), "Prü");
  EXPECT_EQ(cut_to("abc", 0), "");
}

TEST(Padded, PadsAndDoesNotTruncate) {
  EXPECT_EQ(padded("µ", 3), "µ  ");
  EXPECT_EQ(padded_left("12", 5), "   12");
  EXPECT_EQ(padded("long", 2), "long");
}

}  // namespace
