#include "config/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

#include "config/key.h"
#include "config/model_file.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

constexpr const char* model = R"(schema = 1
[oscillator]
excitation = "base"
mass_kg = 0.06
natural_frequency_hz = 2.4
damping_ratio = 0.05
)";

/// A folder of its own with a model in it, gone at the end.
class RigFile : public testing::Test {
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

  std::vector<std::string> problems(const std::string& text) const {
    std::vector<std::string> out;
    try {
      load_rig(write("rig.toml", text));
    } catch (const InputError& error) {
      for (const Problem& each : error.problems()) {
        std::string line = each.text();
        const std::string prefix = folder_.string() + "/";
        for (std::size_t at = 0; (at = line.find(prefix)) != std::string::npos;) {
          line.erase(at, prefix.size());
        }
        out.push_back(line);
      }
    }
    return out;
  }

  static constexpr const char* least =
      "schema = 1\nrig.name = \"r\"\nrig.model = \"model.toml\"\ndriver.kind = \"simulated\"\n";
  std::filesystem::path folder_;
};

TEST_F(RigFile, EveryKeyReachesTheRig) {
  write("other.toml", std::string(model) + "[[physics]]\nid = \"bias_force\"\nforce_n = 2.0\n");
  write("played.csv", "time_s\n");
  const Rig rig = load(R"(
driver.simulated.truth = "other.toml"
driver.simulated.seed = 42
driver.simulated.noise = false
driver.simulated.step_s = 0.0002
driver.simulated.shaker_bandwidth_hz = 80
driver.simulated.real_time = false
driver.simulated.resolution.velocity = 0.5
driver.replay.recording = "played.csv"
driver.replay.speed = 4
[loop]
rate_hz = 500
frames_per_block = 20
duration_s = 2.5
real_time_scheduling = false
[calibration.normal_load]
offset = 0.25
gain = -3
[excitation]
enabled = true
carrier_hz = 3
amplitude = 0.012
modulation_hz = 0.125
modulation_depth = 1
repeat = false
ramp_s = 0.25
[lcm]
enabled = false
url = "memq://"
[recording]
enabled = true
file = "out.log"
[observer]
enabled = false
[metrics]
file = "stickslip.prom"
)");
  EXPECT_EQ(rig.name, "r");
  EXPECT_EQ(rig.file, folder_ / "rig.toml");
  EXPECT_EQ(rig.model_file, folder_ / "model.toml");
  EXPECT_EQ(rig.model_text, model);
  EXPECT_EQ(rig.model, parse_model(model, "m"));
  EXPECT_EQ(rig.driver, DriverKind::simulated);
  EXPECT_EQ(rig.simulated.truth_file, folder_ / "other.toml");
  EXPECT_EQ(rig.simulated.truth.terms.at(0).id, "bias_force");
  EXPECT_EQ(rig.simulated.seed, 42U);
  EXPECT_FALSE(rig.simulated.noise);
  EXPECT_EQ(rig.simulated.step_s, 0.0002);
  EXPECT_EQ(rig.simulated.shaker_bandwidth_hz, 80.0);
  EXPECT_FALSE(rig.simulated.real_time);
  EXPECT_EQ(rig.simulated.resolution[index_of(Channel::velocity)], 0.5);
  EXPECT_EQ(rig.simulated.resolution[index_of(Channel::displacement)], 0.0);
  EXPECT_EQ(rig.replay.recording, folder_ / "played.csv");
  EXPECT_EQ(rig.replay.speed, 4.0);
  EXPECT_EQ(rig.loop.rate_hz, 500.0);
  EXPECT_EQ(rig.loop.frames_per_block, 20);
  EXPECT_EQ(rig.loop.duration_s, 2.5);
  EXPECT_FALSE(rig.loop.real_time_scheduling);
  EXPECT_EQ(rig.calibration[index_of(Channel::normal_load)], (ChannelCalibration{0.25, -3.0}));
  EXPECT_EQ(rig.calibration[index_of(Channel::velocity)], ChannelCalibration{});
  EXPECT_TRUE(rig.excitation.enabled);
  EXPECT_EQ(rig.excitation.carrier_hz, 3.0);
  EXPECT_EQ(rig.excitation.amplitude, 0.012);
  EXPECT_EQ(rig.excitation.modulation_hz, 0.125);
  EXPECT_EQ(rig.excitation.modulation_depth, 1.0);
  EXPECT_FALSE(rig.excitation.repeat);
  EXPECT_EQ(rig.excitation.ramp_s, 0.25);
  EXPECT_FALSE(rig.lcm.enabled);
  EXPECT_EQ(rig.lcm.url, "memq://");
  EXPECT_TRUE(rig.recording.enabled);
  EXPECT_EQ(rig.recording.file, folder_ / "out.log");
  EXPECT_FALSE(rig.observer.enabled);
  EXPECT_EQ(rig.metrics.file, folder_ / "stickslip.prom");
}

TEST_F(RigFile, AnEnvelopeIsRead) {
  const Rig rig = load("excitation.envelope = [[0, 0.001], [2.5, 0.012], [9.0, 0.001]]\n");
  ASSERT_EQ(rig.excitation.envelope.size(), 3U);
  EXPECT_EQ(rig.excitation.envelope[1].time_s, 2.5);
  EXPECT_EQ(rig.excitation.envelope[1].amplitude, 0.012);
}

TEST_F(RigFile, WhatThePageCallsTheDefaultIsTheDefault) {
  const Rig without = load("");
  std::string all;
  for (const Key& key : rig_keys()) {
    if (key.need != Need::optional || key.path.find('*') != std::string_view::npos) continue;
    const bool plain =
        key.type == Type::number || key.type == Type::integer || key.type == Type::boolean;
    if (key.path == "lcm.url") {
      all += "lcm.url = \"" + std::string(key.fallback) + "\"\n";
    } else if (plain && key.fallback.find(' ') == std::string_view::npos) {
      all += std::string(key.path) + " = " + std::string(key.fallback) + "\n";
    }
  }
  const Rig with = load(all);
  EXPECT_EQ(with.simulated.seed, without.simulated.seed);
  EXPECT_EQ(with.simulated.noise, without.simulated.noise);
  EXPECT_EQ(with.simulated.step_s, without.simulated.step_s);
  EXPECT_EQ(with.simulated.shaker_bandwidth_hz, without.simulated.shaker_bandwidth_hz);
  EXPECT_EQ(with.simulated.real_time, without.simulated.real_time);
  EXPECT_EQ(with.replay.speed, without.replay.speed);
  EXPECT_EQ(with.loop.rate_hz, without.loop.rate_hz);
  EXPECT_EQ(with.loop.frames_per_block, without.loop.frames_per_block);
  EXPECT_EQ(with.loop.real_time_scheduling, without.loop.real_time_scheduling);
  EXPECT_EQ(with.excitation.enabled, without.excitation.enabled);
  EXPECT_EQ(with.excitation.carrier_hz, without.excitation.carrier_hz);
  EXPECT_EQ(with.excitation.amplitude, without.excitation.amplitude);
  EXPECT_EQ(with.excitation.modulation_hz, without.excitation.modulation_hz);
  EXPECT_EQ(with.excitation.modulation_depth, without.excitation.modulation_depth);
  EXPECT_EQ(with.excitation.repeat, without.excitation.repeat);
  EXPECT_EQ(with.excitation.ramp_s, without.excitation.ramp_s);
  EXPECT_EQ(with.lcm.enabled, without.lcm.enabled);
  EXPECT_EQ(with.lcm.url, without.lcm.url);
  EXPECT_EQ(with.recording.enabled, without.recording.enabled);
  EXPECT_EQ(with.observer.enabled, without.observer.enabled);
  EXPECT_EQ(without.simulated.truth, without.model);
  EXPECT_EQ(without.simulated.truth_file, without.model_file);
}

TEST_F(RigFile, ProblemsInItsModelsAreToldWithItsOwn) {
  write("bad.toml", "schema = 1\n[oscillator]\nexcitation = \"base\"\nmass_kg = -1\n");
  EXPECT_THAT(
      problems("schema = 1\n[rig]\nname = \"r\"\nmodel = \"bad.toml\"\nspeed = 1\n[driver]\n"
               "kind = \"simulated\"\nsimulated.truth = \"absent.toml\"\n"),
      testing::ElementsAre(
          testing::StartsWith("rig.toml:5:1: unknown key rig.speed"),
          "rig.toml:8:19: driver.simulated.truth: absent.toml: there is no such file",
          testing::StartsWith("bad.toml:4:11: oscillator.mass_kg: expected a number")));
}

TEST_F(RigFile, WhatItsKeysMeanTogether) {
  const auto one = [this](const std::string& more, const char* part) {
    EXPECT_THAT(problems(std::string(least) + more), testing::ElementsAre(testing::HasSubstr(part)))
        << more;
  };
  one("calibration.velocity.gain = 0\n", "rig.toml:5:29: calibration.velocity.gain: is 0");
  one("[loop]\nrate_hz = 100\n[excitation]\ncarrier_hz = 26\n", "a quarter of loop.rate_hz");
  one("excitation.amplitude = 12\n", "amplitudes are in metres");
  one("excitation.envelope = [[0, 0.001], [1, 12]]\nexcitation.repeat = false\n",
      "amplitudes are in metres");
  one("excitation.envelope = [[0, 0.001], [1, 0.002]]\n", "the drive would jump there");
  one("[excitation]\namplitude = 0.001\nenvelope = [[0, 0.001], [1, 0.001]]\n",
      "beside an envelope");
  one("excitation.envelope = [[0, 0.001], [1, 0.002], [1, 0.001]]\n", "times have to increase");
  one("excitation.envelope = [[0.5, 0.001], [1, 0.001]]\n", "the first time has to be 0");
  one("excitation.envelope = [[0, 0.001], [1, -0.001], [2, 0.001]]\n", "0 or more");
  one("lcm.url = \"239.255.76.67:7667\"\n", "udpm://ADDRESS:PORT");
  one("recording.enabled = true\n", "recording.file is missing with enabled = true");
  one("[recording]\nenabled = true\nfile = \"no/folder/here.log\"\n", "there is no folder");
  one("metrics.file = \"no/folder/here.prom\"\n",
      "rig.toml:5:16: metrics.file: there is no folder");
  one("metrics.file = \"stickslip.txt\"\n", "node_exporter reads only files named *.prom");
}

TEST_F(RigFile, AReplayNeedsItsRecordingAndNoCalibration) {
  const std::string replay =
      "schema = 1\nrig.name = \"r\"\nrig.model = \"model.toml\"\ndriver.kind = \"replay\"\n";
  EXPECT_THAT(problems(replay),
              testing::ElementsAre(testing::HasSubstr(
                  "driver.replay.recording is missing with driver.kind = \"replay\"")));
  EXPECT_THAT(problems(replay + "driver.replay.recording = \"absent.csv\"\n"),
              testing::ElementsAre(testing::HasSubstr("there is no such file")));
  write("played.csv", "time_s\n");
  EXPECT_THAT(problems(replay + "driver.replay.recording = \"played.csv\"\n"), testing::IsEmpty());
  EXPECT_THAT(problems(replay + "driver.replay.recording = \"played.csv\"\n"
                                "calibration.velocity.gain = 2\n"),
              testing::ElementsAre(testing::HasSubstr("in SI units already")));
}

TEST_F(RigFile, ASimulatedRigNeedsATruthThatCanBeDriven) {
  write("imposed.toml", "schema = 1\noscillator.excitation = \"imposed\"\n");
  EXPECT_THAT(problems(std::string(least) + "driver.simulated.truth = \"imposed.toml\"\n"),
              testing::Contains(testing::HasSubstr("imposed motion")));
  write("measured.toml", std::string(model) + "normal_load.law = \"measured\"\n");
  EXPECT_THAT(problems(std::string(least) + "driver.simulated.truth = \"measured.toml\"\n"),
              testing::Not(testing::IsEmpty()));
}

TEST(ShippedRigs, AreSound) {
  const std::filesystem::path folder = STICKSLIP_SOURCE_DIR "/config";
  std::size_t rigs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".toml") continue;
    EXPECT_NO_THROW(load_rig(entry.path())) << entry.path();
    ++rigs;
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder / "models")) {
    EXPECT_NO_THROW(load_model(entry.path())) << entry.path();
  }
  EXPECT_GT(rigs, 0U);
}

TEST(ShippedRigs, TheSimulatedOneHidesAHardeningSpring) {
  const Rig rig = load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  EXPECT_TRUE(rig.model.terms.empty());
  ASSERT_EQ(rig.simulated.truth.terms.size(), 1U);
  EXPECT_EQ(rig.simulated.truth.terms[0].id, "cubic_stiffness");
  EXPECT_GT(rig.simulated.truth.terms[0].parameters.at("k3_n_m3").value, 0.0);
  // Anything else that differs is within what its owner says that he knows.
  physics::Model believed = rig.model;
  physics::Model truth = rig.simulated.truth;
  truth.terms.clear();
  const auto a = physics::parameters_of(believed);
  const auto b = physics::parameters_of(truth);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_LE(std::abs(a[i].parameter->value - b[i].parameter->value), a[i].parameter->sigma)
        << a[i].path;
  }
  EXPECT_EQ(believed.sensors, truth.sensors);
}

}  // namespace
}  // namespace stickslip::config
