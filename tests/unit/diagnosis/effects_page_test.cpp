// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/effects_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <sstream>

#include "diagnosis/report/effect_picture.h"
#include "physics/catalogue.h"
#include "physics/friction_laws.h"
#include "tools/files/read_file.h"

namespace stickslip::report {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::filesystem::path documents = STICKSLIP_SOURCE_DIR "/docs";

TEST(EffectsPage, IsUpToDate) {
  EXPECT_EQ(files::content_of(documents / "effects.md"), effects_page())
      << "renew it as docs/development.md says";
}

TEST(EffectsPage, HasAnUpToDatePictureOfEveryEffectAndNoOther) {
  std::set<std::string> names;
  for (const physics::Effect* effect : physics::catalogue()) {
    if (effect->hooks() == 0) continue;  // no term, no picture
    const std::string id(effect->card().id);
    names.insert(id + ".svg");
    const std::string picture = effect_picture(*effect);
    EXPECT_EQ(files::content_of(documents / "effects" / (id + ".svg")), picture)
        << id << ": renew it as docs/development.md says";
    EXPECT_LT(picture.size(), 12000U) << id;
  }
  for (const auto& file : std::filesystem::directory_iterator(documents / "effects")) {
    EXPECT_TRUE(names.contains(file.path().filename())) << file.path();
  }
}

TEST(EffectsPage, PicturesNeedNeitherAPageNorVariables) {
  for (const physics::Effect* effect : physics::catalogue()) {
    if (effect->hooks() == 0) continue;
    SCOPED_TRACE(std::string(effect->card().id));
    const std::string picture = effect_picture(*effect);
    EXPECT_THAT(picture, testing::StartsWith("<svg xmlns=\"http://www.w3.org/2000/svg\""));
    EXPECT_THAT(picture, HasSubstr("<path class=\"line s2\""));
    EXPECT_THAT(picture, HasSubstr(".line { fill:none"));
    EXPECT_THAT(picture, Not(HasSubstr("var(")));
    EXPECT_THAT(picture, Not(HasSubstr("nan")));
  }
}

TEST(EffectText, StatesEveryPartOfTheEntryWithinTheColumns) {
  for (const physics::Effect* effect : physics::catalogue()) {
    const physics::Card& card = effect->card();
    const std::string text = effect_text(*effect, 60);
    SCOPED_TRACE(text);
    for (const physics::ParameterCard& parameter : card.parameters) {
      EXPECT_THAT(text, HasSubstr(std::string(parameter.name) + " ["));
    }
    for (const char* heading : {"Formula", "Parameters", "Acts on", "Tier", "Shown best by"}) {
      EXPECT_THAT(text, HasSubstr(std::string("\n") + heading + "\n"));
    }
    EXPECT_EQ(text.find("\nReferences\n") != std::string::npos, !card.references.empty());
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 66U) << line;
  }
}

TEST(EffectsList, HasOneLinePerEffectAndPerLawThatBeginsWithItsId) {
  const std::string list = effects_list();
  const std::size_t heading = list.find("\nLaws of friction");
  ASSERT_NE(heading, std::string::npos);
  const auto count = [](const std::string& part, auto find) {
    std::istringstream lines(part);
    std::size_t out = 0;
    for (std::string line; std::getline(lines, line); ++out) {
      EXPECT_NE(find(line.substr(0, line.find(' '))), nullptr) << line;
      EXPECT_LE(line.size(), 80U) << line;
    }
    return out;
  };
  EXPECT_EQ(count(list.substr(0, heading), physics::find_effect), physics::catalogue().size());
  EXPECT_EQ(count(list.substr(list.find("\n\n", heading) + 2), physics::find_law),
            physics::friction_laws().size());
}

TEST(EffectText, OfALawSaysHowAModelDeclaresIt) {
  const std::string text = effect_text(*physics::find_law("lugre"), 60);
  EXPECT_THAT(text, HasSubstr("\nDeclared as\n  [friction] law = \"lugre\"\n"));
  EXPECT_THAT(text, HasSubstr("stiffness_n_m [N/m]"));
  EXPECT_THAT(text, Not(HasSubstr("Tier")));
}

}  // namespace
}  // namespace stickslip::report
