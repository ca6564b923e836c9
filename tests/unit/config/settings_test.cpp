// SPDX-License-Identifier: Apache-2.0
#include "config/settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "config/document.h"
#include "config/toml_text.h"

namespace stickslip::config {
namespace {

constexpr const char* model = R"(schema = 1
[oscillator]
excitation = "base"
mass_kg = 0.06
natural_frequency_hz = 2.4
damping_ratio = 0.05
)";

constexpr const char* least =
    "schema = 1\nrig.name = \"r\"\nrig.model = \"model.toml\"\ndriver.kind = \"simulated\"\n";

/// A temporary folder with a model.
class Settings : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "stickslip-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    write("model.toml", model);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  Rig load(const std::string& more) const {
    return load_rig(write("rig.toml", std::string(least) + more));
  }

  std::filesystem::path folder_;
};

TEST_F(Settings, HaveAValueAndItsOrigin) {
  const auto settings = settings_of(load("[loop]\nrate_hz = 500\n"));
  const Setting* rate = find_setting(settings, "loop.rate_hz");
  ASSERT_NE(rate, nullptr);
  EXPECT_EQ(rate->value, "500.0");
  EXPECT_TRUE(rate->stated());
  EXPECT_EQ(rate->line, 6);
  EXPECT_EQ(rate->column, 11);
  const Setting* block = find_setting(settings, "loop.frames_per_block");
  EXPECT_EQ(block->value, "10");
  EXPECT_FALSE(block->stated());
  EXPECT_EQ(find_setting(settings, "loop.rate"), nullptr);
}

TEST_F(Settings, EveryKeyOccursOnceAndThoseOfChannelsOnceForEach) {
  const auto settings = settings_of(load(""));
  std::size_t expected = 0;
  for (const Key& key : rig_keys()) {
    expected += key.path.find('*') == std::string_view::npos ? 1 : channel_count;
  }
  EXPECT_EQ(settings.size(), expected);
  for (const Setting& each : settings) {
    SCOPED_TRACE(each.path);
    EXPECT_TRUE(matches(*each.key, each.path));
    EXPECT_NE(each.value.empty(), each.words.empty()) << "one of the two";
    EXPECT_EQ(find_setting(settings, each.path), &each);
  }
}

TEST_F(Settings, ADefaultIsAValueOrWords) {
  const auto settings = settings_of(load(""));
  EXPECT_EQ(find_setting(settings, "lcm.url")->value, "\"udpm://239.255.76.67:7667?ttl=0\"");
  EXPECT_EQ(find_setting(settings, "loop.duration_s")->value, "");
  EXPECT_EQ(find_setting(settings, "loop.duration_s")->words, "unlimited");
  EXPECT_EQ(find_setting(settings, "driver.replay.recording")->words, "required with kind replay");
  EXPECT_EQ(find_setting(settings, "excitation.envelope")->words, "none");
  EXPECT_EQ(find_setting(settings, "driver.simulated.truth")->value,
            find_setting(settings, "rig.model")->value);
}

TEST_F(Settings, PathsAreResolved) {
  const Rig rig = load("");
  const auto settings = settings_of(rig);
  EXPECT_EQ(plain_text(settings, "rig.model"), rig.model_file.string());
  EXPECT_EQ(plain_text(settings, "rig.name"), "r");
  EXPECT_EQ(plain_text(settings, "recording.file"), "");
  EXPECT_EQ(plain_text(settings, "no.such.key"), "");
}

/// The effective values, written as a file, give the same rig.
TEST_F(Settings, RoundTripThroughAFileGivesTheSameRig) {
  const Rig rig = load(
      "excitation.envelope = [[0, 0.001], [2.5, 0.012], [9.0, 0.001]]\n"
      "calibration.velocity.gain = 2\ndriver.simulated.seed = 7\n");
  std::string text;
  for (const Setting& each : settings_of(rig)) {
    const bool beside_an_envelope =
        each.path.starts_with("excitation.") && !each.stated() &&
        (each.path == "excitation.amplitude" || each.path.starts_with("excitation.modulation"));
    if (!each.value.empty() && !beside_an_envelope) text += each.path + " = " + each.value + "\n";
  }
  const Rig again = load_rig(write("again.toml", text));
  EXPECT_EQ(again.model, rig.model);
  EXPECT_EQ(again.simulated.seed, 7U);
  EXPECT_EQ(again.calibration, rig.calibration);
  ASSERT_EQ(again.excitation.envelope.size(), 3U);
  EXPECT_EQ(again.excitation.envelope[1].amplitude, 0.012);
  EXPECT_THAT(changes(rig, again), testing::IsEmpty());
}

TEST_F(Settings, SpellingIsNoChange) {
  const Rig before = load("[loop]\nrate_hz = 1000\n[excitation]\ncarrier_hz = 3.0\n");
  const Rig after = load("# a word\nexcitation.carrier_hz = 3\nloop.frames_per_block = 10\n");
  EXPECT_THAT(changes(before, after), testing::IsEmpty());
  EXPECT_THAT(changes(before, before), testing::IsEmpty());
}

TEST_F(Settings, ChangesAreLiveOrNeedARestart) {
  const Rig before = load("excitation.carrier_hz = 3\n");
  const Rig after = load(
      "excitation.carrier_hz = 3.5\ncalibration.velocity.gain = 2\nloop.rate_hz = 500\n"
      "loop.duration_s = 5\n");
  EXPECT_THAT(changes(before, after),
              testing::ElementsAre(Change{"loop.rate_hz", "1000.0", "500.0", false},
                                   Change{"loop.duration_s", "unlimited", "5.0", false},
                                   Change{"calibration.velocity.gain", "1.0", "2.0", true},
                                   Change{"excitation.carrier_hz", "3.0", "3.5", true}));
  EXPECT_EQ(text(changes(before, after).front()), "loop.rate_hz: 1000.0 -> 500.0, needs a restart");
  EXPECT_EQ(text(changes(before, after).back()), "excitation.carrier_hz: 3.0 -> 3.5");
}

TEST_F(Settings, ChangedModelFileCountsAsAChangeOfItsKey) {
  const Rig before = load("");
  write("model.toml", std::string("# a word\n") + model);
  EXPECT_THAT(changes(before, load("")), testing::IsEmpty());
  std::string heavier = model;
  heavier.replace(heavier.find("0.06"), 4, "0.07");
  write("model.toml", heavier);
  const auto found = changes(before, load(""));
  ASSERT_EQ(found.size(), 2U);  // the simulated rig takes its truth from it
  EXPECT_EQ(found[0].key, "rig.model");
  EXPECT_THAT(found[0].after, testing::HasSubstr("with other contents"));
  EXPECT_FALSE(found[0].live);
  EXPECT_EQ(found[1].key, "driver.simulated.truth");
}

TEST(Keys, DriveSettingsSafetyLimitsAndCalibrationAreLive) {
  for (const Key& key : rig_keys()) {
    EXPECT_TRUE(key.live || !key.path.starts_with("calibration.")) << key.path;
    for (const char* table : {"driver.", "loop.", "rig.", "recording.", "limits.", "lcm."}) {
      EXPECT_FALSE(key.live && key.path.starts_with(table)) << key.path;
    }
  }
  const auto live = [](const char* path) { return find_key(rig_keys(), path)->live; };
  for (const char* knob : {"carrier_hz", "amplitude", "modulation_hz", "modulation_depth"}) {
    EXPECT_TRUE(live((std::string("excitation.") + knob).c_str())) << knob;
  }
  EXPECT_FALSE(live("excitation.kind"));
  EXPECT_TRUE(live("safety.stale_after_s"));
  EXPECT_FALSE(live("safety.exit_on_fault"));
  EXPECT_TRUE(live("metrics.file"));
}

RC_GTEST_PROP(TomlString, ReadsBackAsItWas, (const std::string& any)) {
  // TOML is UTF-8 without NUL; bytes above ASCII are unchanged.
  std::string plain;
  for (const char c : any) {
    const auto byte = static_cast<unsigned char>(c);  // char has no sign on arm64
    if (byte > 0 && byte < 0x80) plain += c;
  }
  const Document document("rig.name = " + toml_string(plain) + "\n", "t", rig_keys());
  RC_ASSERT(document.text("rig.name") == plain);
}

}  // namespace
}  // namespace stickslip::config
