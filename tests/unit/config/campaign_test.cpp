// SPDX-License-Identifier: Apache-2.0
#include "config/campaign.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "config/document.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

using ::testing::HasSubstr;

constexpr const char* two_discs = R"(schema = 1
model = "frame.toml"

[[recording]]
name = "250 g"
file = "250/recording.csv"
material = "brass on steel"
conditions = { load_n = 2.45 }

[[recording]]
name = "450 g"
file = "450/recording.csv"
held_out = true
conditions = { load_n = 4.41 }
[recording.set]
oscillator.mass_kg = 3.2
sensors.displacement.gain = 1.01

[[number]]
path = "physics.dry_friction.friction_force_n"
sharing = "proportional"
condition = "load_n"
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

std::string problem_of(const std::string& text) {
  try {
    parse_campaign(text, "campaign.toml");
  } catch (const InputError& error) {
    return error.problems().front().text();
  }
  return "no problem";
}

TEST(Campaign, IsReadWithItsRecordingsAndNumbers) {
  const CampaignFile read = parse_campaign(two_discs, "discs/campaign.toml");
  EXPECT_EQ(read.model, "discs/frame.toml");
  ASSERT_EQ(read.recordings.size(), 2U);
  EXPECT_EQ(read.recordings[0].file, "discs/250/recording.csv");
  EXPECT_EQ(read.recordings[0].conditions.at("load_n"), 2.45);
  EXPECT_EQ(read.recordings[0].material, "brass on steel");
  EXPECT_TRUE(read.recordings[1].held_out);
  EXPECT_EQ(read.recordings[1].set.at("oscillator.mass_kg"), 3.2);
  EXPECT_EQ(read.recordings[1].set.at("sensors.displacement.gain"), 1.01);
  ASSERT_EQ(read.numbers.size(), 1U);
  EXPECT_EQ(read.numbers[0].sharing, physics::Sharing::proportional);
  EXPECT_EQ(kind_of(two_discs), FileKind::campaign);
}

TEST(Campaign, ErrorsNameFileLineAndCure) {
  EXPECT_THAT(problem_of(replaced(two_discs, "\"450 g\"", "\"250 g\"")),
              AllOf(HasSubstr("campaign.toml:11:"), HasSubstr("name of another recording")));
  EXPECT_THAT(problem_of(replaced(two_discs, "\"proportional\"", "\"proportionl\"")),
              AllOf(HasSubstr("campaign.toml:21:"), HasSubstr("did you mean \"proportional\"?")));
  EXPECT_THAT(problem_of(replaced(two_discs, "condition = \"load_n\"", "condition = \"load\"")),
              AllOf(HasSubstr("campaign.toml:22:"), HasSubstr("does not state the condition load"),
                    HasSubstr("did you mean load_n?")));
  EXPECT_THAT(problem_of(replaced(two_discs, "condition = \"load_n\"\n", "")),
              HasSubstr("condition"));
  EXPECT_THAT(problem_of(replaced(two_discs, "load_n = 4.41", "load_n = 2.45")),
              HasSubstr("the same in all recordings"));
  EXPECT_THAT(problem_of(replaced(two_discs, "load_n = 4.41", "load_n = -4.41")),
              HasSubstr("expected a condition above 0"));
  EXPECT_THAT(problem_of(replaced(two_discs, "load_n = 4.41", "load_n = \"heavy\"")),
              AllOf(HasSubstr("campaign.toml:14:"), HasSubstr("expected a number")));
  EXPECT_THAT(problem_of("schema = 1\n[[recording]]\nname = \"a\"\nfile = \"a.csv\"\n"),
              HasSubstr("expected two or more"));
}

class WithModel : public ::testing::Test {
 protected:
  WithModel() {
    std::filesystem::create_directories(folder_);
    write("frame.toml", R"(schema = 1
[oscillator]
excitation = "force"
mass_kg = 3.0
stiffness_n_m = { value = 1191.0, sigma = 25.0 }
damping_n_s_m = { value = 0.7, sigma = 0.3 }
[friction]
law = "none"
)");
  }
  ~WithModel() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
  std::string problem_with(const std::string& text) const {
    write("campaign.toml", text);
    try {
      load_campaign(folder_ / "campaign.toml");
    } catch (const InputError& error) {
      return error.problems().front().text();
    }
    return "no problem";
  }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                  (std::string("campaign_test_") +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(WithModel, ItsPathsAreThoseOfTheModelOrOfAnEffect) {
  EXPECT_EQ(problem_with(two_discs), "no problem");
  EXPECT_THAT(problem_with(replaced(two_discs, "oscillator.mass_kg", "oscillator.mas_kg")),
              AllOf(HasSubstr("campaign.toml:16:"), HasSubstr("no number of that path"),
                    HasSubstr("did you mean oscillator.mass_kg?")));
  EXPECT_THAT(problem_with(replaced(two_discs, "physics.dry_friction", "physics.dry_fiction")),
              HasSubstr("no effect of the catalogue"));
  EXPECT_THAT(problem_with(replaced(two_discs, "physics.dry_friction.friction_force_n",
                                    "oscillator.mass_kg")),
              HasSubstr("is a plain number in the model"));
}

TEST_F(WithModel, OneRecordingIsHeldOutByItsName) {
  write("campaign.toml", two_discs);
  LoadedCampaign loaded = load_campaign(folder_ / "campaign.toml");
  EXPECT_TRUE(loaded.campaign.runs[1].held_out);
  EXPECT_THROW(hold_out(loaded.campaign, "250 g", "campaign.toml"), InputError);  // none is left
  EXPECT_THROW(hold_out(loaded.campaign, "350 g", "campaign.toml"), InputError);
  loaded.campaign.runs[1].held_out = false;
  hold_out(loaded.campaign, "250 g", "campaign.toml");
  EXPECT_TRUE(loaded.campaign.runs[0].held_out);
}

}  // namespace
}  // namespace stickslip::config
