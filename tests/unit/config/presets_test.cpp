// SPDX-License-Identifier: Apache-2.0
// The presets against the paper (sections 2, 3.1 and 5, captions of Figures 4 to 8): materials,
// plates, frequencies and loads of Beams I to IV and of the motivational oscillator.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>

#include "config/model_file.h"
#include "config/rig.h"
#include "tools/files/read_file.h"

namespace stickslip::config {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::filesystem::path folder = STICKSLIP_SOURCE_DIR "/config";

std::string one_line_of(const std::filesystem::path& path) {
  std::string text = files::content_of(path);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

struct Preset {
  const char* name;
  const char* title;  ///< in the comments of both files
  const char* material;
  const char* plates;
  double natural_hz;
  double drive_hz;
  double mu_low, mu_high;  ///< of the material
  double load_low, load_high;
};

class PaperPreset : public testing::TestWithParam<Preset> {};

TEST_P(PaperPreset, AgreesWithThePaper) {
  const Preset& preset = GetParam();
  const Rig rig = load_rig(folder / (std::string(preset.name) + ".toml"));
  EXPECT_EQ(rig.model_file.filename(), std::string(preset.name) + ".toml");
  EXPECT_EQ(rig.model.oscillator.natural_frequency_hz->value, preset.natural_hz);
  EXPECT_EQ(rig.model.oscillator.damping_ratio->value, 0.015);
  EXPECT_EQ(rig.excitation.carrier_hz, preset.drive_hz);
  EXPECT_LE(rig.excitation.amplitude, 0.012);
  EXPECT_GE(rig.model.friction.mu.value, preset.mu_low);
  EXPECT_LE(rig.model.friction.mu.value, preset.mu_high);
  EXPECT_GE(rig.model.normal_load->load_n.value, preset.load_low);
  EXPECT_LE(rig.model.normal_load->load_n.value, preset.load_high);
  EXPECT_EQ(rig.model.oscillator.two_well.has_value(), std::string(preset.name) == "beam-4");
  EXPECT_EQ(rig.model.load_cell.has_value(), std::string(preset.name) != "motivational");
  for (const char* kind : {"", "models/"}) {
    const std::string comment =
        one_line_of(folder / (kind + std::string(preset.name) + ".toml")).substr(0, 200);
    EXPECT_THAT(comment, HasSubstr(preset.title));
    EXPECT_THAT(comment, HasSubstr(preset.material));
    EXPECT_THAT(comment, HasSubstr(preset.plates));
  }
}

constexpr const char* paper = "paper on paper";
constexpr const char* titanium = "titanium on titanium";

INSTANTIATE_TEST_SUITE_P(
    Beams, PaperPreset,
    testing::Values(Preset{"beam-1", "Beam I of the paper", paper, "nearly parallel plates", 3.6,
                           2.5, 0.6, 1.0, 0.12, 0.17},
                    Preset{"beam-2", "Beam II of the paper", titanium, "nearly parallel plates",
                           2.4, 2.5, 0.2, 0.5, 0.10, 0.16},
                    Preset{"beam-3-paper", "Beam III of the paper", paper, "skewed plates", 2.4,
                           4.0, 0.6, 1.0, 0.04, 0.19},
                    Preset{"beam-3-titanium", "Beam III of the paper", titanium, "skewed plates",
                           2.4, 3.5, 0.2, 0.5, 0.16, 0.47},
                    Preset{"beam-4", "Beam IV of the paper", paper, " parallel plates, magnets",
                           2.4, 5.0, 0.6, 1.0, 0.20, 0.25},
                    Preset{"motivational", "motivational oscillator of the paper", titanium,
                           "skewed plates", 2.4, 4.2, 0.2, 0.5, 0.1, 0.5}));

TEST(Presets, OnlyTheModelsOfABeamAreNamedAfterOne) {
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".toml") continue;
    const Rig rig = load_rig(file.path());
    SCOPED_TRACE(file.path());
    if (!rig.model_file.filename().string().starts_with("beam-")) {
      EXPECT_THAT(rig.name, Not(HasSubstr("Beam")));
    }
  }
}

TEST(Presets, TheEquationsOfTheFiguresAreDimensionless) {
  for (const auto& file : std::filesystem::directory_iterator(folder / "models")) {
    const physics::Model model = load_model(file.path());
    const bool equations = file.path().filename().string().starts_with("paper-figure-");
    EXPECT_EQ(model.dimensionless, equations) << file.path();
    if (!equations) continue;
    EXPECT_EQ(model.oscillator.mass_kg.value, 1.0);
    EXPECT_EQ(model.oscillator.stiffness_n_m->value, 1.0);
    EXPECT_EQ(model.friction.transition_speed_m_s.value, 0.02);  // tanh(50 v)
    EXPECT_EQ(model.friction.rate_per_s.value, 10.0);
    EXPECT_EQ(parse_model(model_text(model), "model.toml"), model);
  }
}

TEST(Presets, TheWellsOfBeamFourAreAtEightMillimetres) {
  const physics::Model model = load_model(folder / "models/beam-4.toml");
  const double linear = model.oscillator.two_well->linear_n_m.value;
  EXPECT_NEAR(std::sqrt(linear / model.oscillator.two_well->cubic_n_m3.value), 0.008, 1.0e-5);
  EXPECT_NEAR(std::sqrt(2.0 * linear / model.oscillator.mass_kg.value) / (2.0 * std::numbers::pi),
              4.5, 0.01);
}

}  // namespace
}  // namespace stickslip::config
