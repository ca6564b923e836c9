// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::figures {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Page, ShowsEachFigureWithItsNumbersAndIsSelfContained) {
  Figure figure{7, "Titanium & paper", "at 3.5 Hz"};
  figure.panels = {"figure-7a"};
  figure.captions = {"mu < 1"};
  figure.comparisons = {{"It is so", "0.5", "0.49"}};
  const std::string got = page({figure}, "stickslip figures --out <there>");
  EXPECT_THAT(got, HasSubstr("Figure 7. Titanium &amp; paper"));
  EXPECT_THAT(got, HasSubstr("src=\"figure-7a.svg\" alt=\"mu &lt; 1\""));
  EXPECT_THAT(got, HasSubstr("<td>It is so</td><td>0.5</td><td>0.49</td>"));
  EXPECT_THAT(got, HasSubstr("--out &lt;there&gt;"));
  EXPECT_THAT(got, Not(HasSubstr("http")));
  EXPECT_THAT(got, Not(HasSubstr("<script")));
}

}  // namespace
}  // namespace stickslip::figures
