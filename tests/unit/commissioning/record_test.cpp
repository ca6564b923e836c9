// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics/problem.h"
#include "tools/commissioning/page.h"

namespace stickslip::commissioning {
namespace {

using testing::HasSubstr;

Record example() {
  Record out{"beam", "0.1.0", "2026-03-02T10:00:00Z", "LabJack U6 #1", {}, {}, {}};
  out.settings = {{"loop.rate_hz", "1000.0"}, {"inputs.displacement.from", "\"labjack_u6/AIN0\""}};
  out.changes = {"2026-03-03: loop.rate_hz is 500.0 and was 1000.0"};
  out.put({"noise",
           Verdict::failed,
           "2026-03-02T10:01:00Z",
           "x < y & z.",
           "a remedy",
           {{"displacement.zero_raw", 0.25, 1e-3, "V"}, {"displacement.noise", 2e-6, {}, "m"}}});
  out.put({"delays",
           Verdict::passed,
           "2026-03-02T10:02:00Z",
           "late",
           "",
           {{"velocity.delay_s", 0.0012, 2e-4, "s"}}});
  return out;
}

TEST(Record, SurvivesItsFile) {
  const Record record = example();
  const Record read = parse_record(json_of(record), "file.json");
  EXPECT_EQ(json_of(read), json_of(record));
  EXPECT_EQ(read.steps.at(0).verdict, Verdict::failed);
  EXPECT_EQ(read.steps.at(0).measured.at(0).sigma, 1e-3);
  EXPECT_FALSE(read.steps.at(0).measured.at(1).sigma);
}

TEST(Record, RefusesOtherFilesWithTheirNameAndARemedy) {
  for (const char* text : {"", "{}", "[1]", R"({"kind": "commissioned bench"})", "beam = 1",
                           R"({"kind": "commissioned bench", "schema": 1, "rig": 3})"}) {
    try {
      parse_record(text, "other.json");
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("other.json: "));
      EXPECT_THAT(error.what(), HasSubstr("stickslip commission"));
    }
  }
}

TEST(Record, KeepsTheLatestOfAStep) {
  Record record = example();
  record.put({"noise", Verdict::passed, "later", "", "", {}});
  ASSERT_EQ(record.steps.size(), 2U);
  EXPECT_EQ(record.find("noise")->verdict, Verdict::passed);
  EXPECT_EQ(record.find("drive"), nullptr);
}

TEST(Page, NamesEveryStepAndEscapesText) {
  const std::string page = page_of(example());
  EXPECT_THAT(page, HasSubstr("x &lt; y &amp; z."));
  EXPECT_THAT(page, HasSubstr("<h1>Acceptance of beam</h1>"));
  EXPECT_THAT(page, HasSubstr("Emergency stop"));
  EXPECT_THAT(page, HasSubstr("not done"));
  EXPECT_THAT(page, HasSubstr("Not accepted yet"));
}

TEST(Delays, AreLinesOfAModel) {
  EXPECT_THAT(delays_toml(example()), HasSubstr("[sensors.velocity]\n"
                                                "delay_s = { value = 0.0012, sigma = 0.0002 }\n"));
  EXPECT_TRUE(delays_toml(Record()).empty());
}

}  // namespace
}  // namespace stickslip::commissioning
