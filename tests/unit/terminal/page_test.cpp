// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/page.h"

#include <gtest/gtest.h>

#include <sstream>

#include "tools/terminal/text.h"

namespace stickslip::terminal {
namespace {

TEST(Page, BreaksLinesAtBlanksBehindTheirIndentation) {
  EXPECT_EQ(fitted("  one two three four five\n", 20), "  one two three four\n    five\n");
}

TEST(Page, ContinuesUnderTheSecondColumn) {
  EXPECT_EQ(fitted("state      one two three four five six\n", 30),
            "state      one two three four\n           five six\n");
}

TEST(Page, CutsAWordThatIsTooLong) {
  EXPECT_EQ(fitted("id 0123456789012345678901234567890\n", 20),
            "id 01234567890123456\n  78901234567890\n");
}

TEST(Page, CountsNeitherColoursNorBytesOfACharacter) {
  EXPECT_EQ(fitted("\033[32mone two three four\033[0m\n", 20),
            "\033[32mone two three four\033[0m\n");
  EXPECT_EQ(fitted("\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5 "
                   "\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\n",
                   20),
            "\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5 "
            "\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\u00b5\n");
}

TEST(Page, LeavesACommandToCopyWhole) {
  const std::string line = "      $ sudo sysctl --system && sudo ip link set lo up\n";
  EXPECT_EQ(fitted(line, 30), line);
}

TEST(Page, IsUnchangedForAProgram) {
  std::string text(300, 'x');
  text += " y\n\nz";
  EXPECT_EQ(fitted(text, 0), text);
  EXPECT_EQ(fitted("a\n\nb", 60), "a\n\nb");
}

TEST(Page, FitsWhateverTheText) {
  std::string text;
  for (int i = 0; i < 400; ++i) {
    text += std::string(static_cast<std::size_t>((i * 7919) % 90), "ab  c"[i % 5]);
    text += i % 9 == 0 ? '\n' : ' ';
  }
  for (const std::size_t columns : {20U, 33U, 60U}) {
    std::istringstream lines(fitted(text, columns));
    for (std::string line; std::getline(lines, line);) {
      EXPECT_LE(columns_in(line), columns) << line;
    }
  }
}

}  // namespace
}  // namespace stickslip::terminal
