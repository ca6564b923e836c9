// SPDX-License-Identifier: Apache-2.0
#include "config/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "config/demand.h"
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

/// A temporary folder with a model.
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

TEST_F(RigFile, WhatItNamesIsNotWritten) {
  std::filesystem::create_symlink(folder_ / "model.toml", folder_ / "link.log");
  const std::string recording = "recording = { enabled = true, file = \"link.log\" }\n";
  EXPECT_THAT(problems(least + recording),
              testing::ElementsAre(testing::AllOf(
                  testing::HasSubstr("recording.file: is the same file as model.toml"),
                  testing::HasSubstr("read as rig.model"))));
  EXPECT_THAT(problems(least + std::string("control.socket = \"rig.toml\"\n")),
              testing::ElementsAre(testing::HasSubstr("control.socket: is this configuration")));
  EXPECT_THAT(
      problems(least + std::string("recording = { enabled = false, file = \"link.log\" }\n")),
      testing::IsEmpty());
}

TEST_F(RigFile, DriverKeysAreRead) {
  write("other.toml", std::string(model) + "[[physics]]\nid = \"bias_force\"\nforce_n = 2.0\n");
  write("played.csv", "time_s\n");
  write("faults.toml", "schema = 1\nseed = 5\n[[fault]]\nkind = \"unplug\"\nat_s = 2\n");
  const Rig rig = load(R"(
driver.faults = "faults.toml"
driver.simulated.truth = "other.toml"
driver.simulated.seed = 42
driver.simulated.noise = false
driver.simulated.step_s = 0.0002
driver.simulated.shaker_bandwidth_hz = 80
driver.simulated.real_time = false
driver.simulated.resolution.velocity = 0.5
driver.replay.recording = "played.csv"
driver.replay.speed = 4
)");
  EXPECT_EQ(rig.name, "r");
  EXPECT_EQ(rig.file, folder_ / "rig.toml");
  EXPECT_EQ(rig.model_file, folder_ / "model.toml");
  EXPECT_EQ(rig.model_text, model);
  EXPECT_EQ(rig.model, parse_model(model, "m"));
  EXPECT_EQ(rig.driver, DriverKind::simulated);
  ASSERT_TRUE(rig.faults);
  EXPECT_EQ(rig.faults->file, folder_ / "faults.toml");
  EXPECT_EQ(rig.faults->seed, 5U);
  EXPECT_EQ(rig.faults->faults.at(0).kind, FaultKind::unplug);
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
}

TEST_F(RigFile, LoopExcitationAndOutputKeysAreRead) {
  const Rig rig = load(R"(
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
rotate_s = 600
rotate_mb = 100.5
sync_s = 0
[observer]
enabled = false
[metrics]
file = "stickslip.prom"
)");
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
  EXPECT_EQ(rig.recording.rotate_s, 600.0);
  EXPECT_EQ(rig.recording.rotate_mb, 100.5);
  EXPECT_EQ(rig.recording.sync_s, 0.0);
  EXPECT_FALSE(rig.observer.enabled);
  EXPECT_EQ(rig.metrics.file, folder_ / "stickslip.prom");
}

TEST_F(RigFile, ProblemsInItsFaultScriptAreReported) {
  write("faults.toml", "schema = 1\n[[fault]]\nkind = \"unplug\"\nat_s = -2\n");
  EXPECT_THAT(problems(std::string(least) + "driver.faults = \"faults.toml\"\nloop.rate_hz = 0\n"),
              testing::ElementsAre(testing::StartsWith("rig.toml:6:16: loop.rate_hz: expected"),
                                   testing::StartsWith("faults.toml:4:8: fault.unplug.at_s")));
  EXPECT_THAT(
      problems(std::string(least) + "driver.faults = \"absent.toml\"\n"),
      testing::ElementsAre("rig.toml:5:17: driver.faults: absent.toml: there is no such file"));
  EXPECT_FALSE(load("").faults);
}

TEST_F(RigFile, AnEnvelopeIsRead) {
  const Rig rig = load("excitation.envelope = [[0, 0.001], [2.5, 0.012], [9.0, 0.001]]\n");
  ASSERT_EQ(rig.excitation.envelope.size(), 3U);
  EXPECT_EQ(rig.excitation.envelope[1].time_s, 2.5);
  EXPECT_EQ(rig.excitation.envelope[1].amplitude, 0.012);
}

TEST_F(RigFile, ExcitationsWithACarrierAreRead) {
  const Excitation hand = load(R"(
[excitation]
kind = "by_hand"
carrier_hz = 3
amplitude = 0.012
amplitude_slew = 0.004
carrier_slew_hz_s = 0.5
by_hand = { lowest = 0.002, bandwidth_hz = 0.1, seed = 7 }
control = { enabled = true, gain_min = 0.7, gain_max = 1.4, time_constant_s = 3, distortion_max = 0.05 }
)")
                              .excitation;
  EXPECT_EQ(hand.kind, ExcitationKind::by_hand);
  EXPECT_EQ(hand.by_hand.lowest, 0.002);
  EXPECT_EQ(hand.by_hand.bandwidth_hz, 0.1);
  EXPECT_EQ(hand.by_hand.seed, 7U);
  EXPECT_EQ(hand.amplitude_slew, 0.004);
  EXPECT_EQ(hand.carrier_slew_hz_s, 0.5);
  EXPECT_TRUE(hand.control.enabled);
  EXPECT_EQ(hand.control.gain_min, 0.7);
  EXPECT_EQ(hand.control.gain_max, 1.4);
  EXPECT_EQ(hand.control.time_constant_s, 3.0);
  EXPECT_EQ(hand.control.distortion_max, 0.05);

  const Excitation chirp = load(R"(
[excitation]
kind = "chirp"
amplitude = 0.004
sweep = { from_hz = 6, to_hz = 2, duration_s = 20, scale = "logarithmic", at_end = "repeat", pause_s = 3, taper_s = 2 }
)")
                               .excitation;
  EXPECT_EQ(chirp.kind, ExcitationKind::chirp);
  EXPECT_EQ(chirp.sweep.from_hz, 6.0);
  EXPECT_EQ(chirp.sweep.to_hz, 2.0);
  EXPECT_EQ(chirp.sweep.duration_s, 20.0);
  EXPECT_EQ(chirp.sweep.scale, SweepScale::logarithmic);
  EXPECT_EQ(chirp.sweep.at_end, SweepEnd::repeat);
  EXPECT_EQ(chirp.sweep.pause_s, 3.0);
  EXPECT_EQ(chirp.sweep.taper_s, 2.0);
}

TEST_F(RigFile, MultisinesAndDriveFilesAreRead) {
  const Excitation lines = load(
                               "[excitation]\nkind = \"multisine\"\n"
                               "multisine.lines = [[2, 0.001, 0], [3.5, 0.002, -90.5]]\n")
                               .excitation;
  ASSERT_EQ(lines.multisine.lines.size(), 2U);
  EXPECT_EQ(lines.multisine.lines[1].frequency_hz, 3.5);
  EXPECT_EQ(lines.multisine.lines[1].amplitude, 0.002);
  EXPECT_EQ(lines.multisine.lines[1].phase_deg, -90.5);
  const Excitation many = load(
                              "[excitation]\nkind = \"multisine\"\namplitude = 0.005\n"
                              "multisine = { count = 11, from_hz = 1, to_hz = 6 }\n")
                              .excitation;
  EXPECT_EQ(many.multisine.count, 11);
  EXPECT_EQ(many.multisine.from_hz, 1.0);
  EXPECT_EQ(many.multisine.to_hz, 6.0);

  write("drive.csv", "time_s,base_displacement_m\n0,0\n1,0\n");
  const Excitation file =
      load("[excitation]\nkind = \"file\"\nfile = { path = \"drive.csv\", at_end = \"repeat\" }\n")
          .excitation;
  EXPECT_EQ(file.file.path, folder_ / "drive.csv");
  EXPECT_EQ(file.file.at_end, DriveFileEnd::repeat);
}

TEST_F(RigFile, LimitsAreRead) {
  const Limits limits = load(
                            "[limits]\ndisplacement_m = 0.01\nvelocity_m_s = 0.2\n"
                            "acceleration_m_s2 = 5\nforce_n = 3\nforce_slew_n_s = 70\n")
                            .limits;
  EXPECT_EQ(limits, (Limits{0.01, 0.2, 5.0, 3.0, 70.0}));
}

TEST_F(RigFile, AnExcitationBeyondItsLimitsIsRefused) {
  const auto one = [this](const std::string& more, const char* part) {
    EXPECT_THAT(problems(std::string(least) + more), testing::ElementsAre(testing::HasSubstr(part)))
        << more;
  };
  one("excitation.amplitude = 0.016\n",
      "excitation.amplitude: requires 0.016 m, limits.displacement_m allows 0.015: 93.75 % of");
  one("[excitation]\namplitude = 0.008\ncarrier_hz = 12\n",
      "requires 45.48 m/s^2, limits.acceleration_m_s2 allows 20: 43.98 % of");
  one("excitation.amplitude = 0.01\nlimits.velocity_m_s = 0.1\n",
      "requires 0.1571 m/s, limits.velocity_m_s allows 0.1");
  one("excitation.envelope = [[0, 0.001], [1, 0.02], [2, 0.001]]\n",
      "excitation.envelope: requires 0.02 m");
  one("excitation.kind = \"sweep\"\nexcitation.amplitude = 0.01\n"
      "excitation.sweep = { from_hz = 2, to_hz = 10, duration_s = 60 }\n",
      "limits.acceleration_m_s2 allows 20");
  one("excitation.kind = \"multisine\"\n"
      "excitation.multisine.lines = [[2, 0.008, 0], [3, 0.008, 0]]\n",
      "excitation.multisine.lines: requires 0.016 m");
  one("limits.acceleration_m_s2 = 1e-12\n", "is too small to be enforced at this loop.rate_hz");
  // Newtons have a limit of their own.
  write("model.toml",
        "schema = 1\n[oscillator]\nexcitation = \"force\"\nmass_kg = 0.06\n"
        "natural_frequency_hz = 2.4\ndamping_ratio = 0.05\n");
  one("excitation.amplitude = 6\n", "requires 6 N, limits.force_n allows 5");
  one("excitation.amplitude = 4\nexcitation.carrier_hz = 25\n",
      "requires 628.3 N/s, limits.force_slew_n_s allows 500");
  EXPECT_EQ(load("excitation.amplitude = 4\n").excitation.amplitude, 4.0);
}

TEST_F(RigFile, AKindOfExcitationRequiresItsKeysOnly) {
  const auto one = [this](const std::string& more, const char* part) {
    EXPECT_THAT(problems(std::string(least) + "[excitation]\n" + more),
                testing::ElementsAre(testing::HasSubstr(part)))
        << more;
  };
  const std::string sweep = "sweep = { from_hz = 2, to_hz = 6, duration_s = 60 }\n";
  one("kind = \"sweep\"\nsweep = { to_hz = 6, duration_s = 60 }\n",
      "excitation.sweep.from_hz is missing with excitation.kind = \"sweep\"");
  one("kind = \"sweep\"\ncarrier_hz = 3\n" + sweep,
      "excitation.carrier_hz: has no effect with kind = \"sweep\"");
  one("kind = \"sweep\"\nmodulation_depth = 0.5\n" + sweep, "has no effect with kind");
  one("kind = \"sweep\"\nsweep = { from_hz = 2, to_hz = 300, duration_s = 60 }\n",
      "excitation.sweep.to_hz: is more than a quarter of loop.rate_hz");
  one("kind = \"chirp\"\nsweep = { from_hz = 2, to_hz = 3, duration_s = 2, taper_s = 1.5 }\n",
      "more than half of duration_s");
  one("kind = \"by_hand\"\namplitude = 0.002\nby_hand.lowest = 0.003\n",
      "is above excitation.amplitude");
  one("kind = \"multisine\"\n", "a multisine needs lines, or count, from_hz and to_hz");
  one("kind = \"multisine\"\nmultisine = { lines = [[1, 0.001, 0]], count = 4 }\n", "not both");
  one("kind = \"multisine\"\nmultisine = { count = 4, from_hz = 4, to_hz = 3 }\n",
      "is not below to_hz");
  one("kind = \"multisine\"\namplitude = 0.1\nmultisine.lines = [[1, 0.001, 0]]\n",
      "has no effect with multisine.lines");
  one("kind = \"multisine\"\nmultisine.lines = [[1, 0.001]]\n", "expected a line");
  one("kind = \"multisine\"\nmultisine.lines = [[0, 0.001, 0]]\n", "above 0 [Hz]");
  one("kind = \"multisine\"\nmultisine.lines = [[1, -0.001, 0]]\n", "0 or more");
  one("kind = \"multisine\"\nmultisine.lines = []\n", "1 to 200 lines");
  one("kind = \"file\"\n", "excitation.file.path is missing");
  one("kind = \"file\"\nfile.path = \"absent.csv\"\n", "there is no such file");
  one("kind = \"multisine\"\ncontrol.enabled = true\nmultisine.lines = [[1, 0.001, 0]]\n",
      "needs a carrier");
}

// The signal nearly reaches its demand and never exceeds it.
TEST(Demand, BoundsTheSignal) {
  Excitation excitation;
  excitation.kind = ExcitationKind::multisine;
  excitation.amplitude = 0.005;
  excitation.multisine = {{}, 15, 1.0, 8.0};
  const Demand demand = demand_of(excitation);
  const std::vector<Line> lines = lines_of(excitation);
  ASSERT_EQ(lines.size(), 15U);
  double displacement = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
  for (int i = 0; i < 20000; ++i) {
    double x = 0.0;
    double v = 0.0;
    double a = 0.0;
    for (const Line& line : lines) {
      const double omega = 2.0 * M_PI * line.frequency_hz;
      const double phase = omega * 1e-3 * i + line.phase_deg * M_PI / 180.0;
      x += line.amplitude * std::sin(phase);
      v += line.amplitude * omega * std::cos(phase);
      a -= line.amplitude * omega * omega * std::sin(phase);
    }
    displacement = std::max(displacement, std::abs(x));
    velocity = std::max(velocity, std::abs(v));
    acceleration = std::max(acceleration, std::abs(a));
  }
  EXPECT_LE(displacement, demand.displacement);
  EXPECT_GE(displacement, 0.9 * demand.displacement);
  EXPECT_LE(velocity, demand.velocity);
  EXPECT_GE(velocity, 0.85 * demand.velocity);
  EXPECT_LE(acceleration, demand.acceleration);
  EXPECT_GE(acceleration, 0.85 * demand.acceleration);
  // Schroeder phases: with equal phases the sum would be four times as large.
  EXPECT_GT(lines.front().amplitude * 15.0, 2.0 * excitation.amplitude);
}

TEST_F(RigFile, DocumentedDefaultsAreTheDefaults) {
  const Rig without = load("");
  std::string all;
  for (const Key& key : rig_keys()) {
    if (key.need != Need::optional || key.path.find('*') != std::string_view::npos) continue;
    if (key.when.starts_with("driver.")) continue;  // of devices that this rig does not have
    const bool plain =
        key.type == Type::number || key.type == Type::integer || key.type == Type::boolean;
    const std::string value = default_value(key);
    if ((plain || key.path == "lcm.url") && !value.empty()) {
      all += std::string(key.path) + " = " + value + "\n";
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
  EXPECT_EQ(with.excitation.by_hand.lowest, without.excitation.by_hand.lowest);
  EXPECT_EQ(with.excitation.by_hand.bandwidth_hz, without.excitation.by_hand.bandwidth_hz);
  EXPECT_EQ(with.excitation.by_hand.seed, without.excitation.by_hand.seed);
  EXPECT_EQ(with.excitation.sweep.pause_s, without.excitation.sweep.pause_s);
  EXPECT_EQ(with.excitation.sweep.taper_s, without.excitation.sweep.taper_s);
  EXPECT_EQ(with.excitation.carrier_slew_hz_s, without.excitation.carrier_slew_hz_s);
  EXPECT_EQ(with.excitation.control.enabled, without.excitation.control.enabled);
  EXPECT_EQ(with.excitation.control.gain_min, without.excitation.control.gain_min);
  EXPECT_EQ(with.excitation.control.gain_max, without.excitation.control.gain_max);
  EXPECT_EQ(with.excitation.control.time_constant_s, without.excitation.control.time_constant_s);
  EXPECT_EQ(with.excitation.control.distortion_max, without.excitation.control.distortion_max);
  EXPECT_EQ(with.limits, without.limits);
  EXPECT_EQ(with.lcm.enabled, without.lcm.enabled);
  EXPECT_EQ(with.lcm.url, without.lcm.url);
  EXPECT_EQ(with.recording.enabled, without.recording.enabled);
  EXPECT_EQ(with.recording.sync_s, without.recording.sync_s);
  EXPECT_EQ(with.observer.enabled, without.observer.enabled);
  EXPECT_EQ(without.simulated.truth, without.model);
  EXPECT_EQ(without.simulated.truth_file, without.model_file);
}

TEST_F(RigFile, ProblemsInItsModelsAreReported) {
  write("bad.toml", "schema = 1\n[oscillator]\nexcitation = \"base\"\nmass_kg = -1\n");
  EXPECT_THAT(
      problems("schema = 1\n[rig]\nname = \"r\"\nmodel = \"bad.toml\"\nspeed = 1\n[driver]\n"
               "kind = \"simulated\"\nsimulated.truth = \"absent.toml\"\n"),
      testing::ElementsAre(
          testing::StartsWith("rig.toml:5:1: unknown key rig.speed"),
          "rig.toml:8:19: driver.simulated.truth: absent.toml: there is no such file",
          testing::StartsWith("bad.toml:4:11: oscillator.mass_kg: expected a number")));
}

TEST_F(RigFile, InconsistentKeysAreRefused) {
  const auto one = [this](const std::string& more, const char* part) {
    EXPECT_THAT(problems(std::string(least) + more), testing::ElementsAre(testing::HasSubstr(part)))
        << more;
  };
  one("calibration.velocity.gain = 0\n", "rig.toml:5:29: calibration.velocity.gain: is 0");
  one("[loop]\nrate_hz = 100\n[excitation]\ncarrier_hz = 26\n", "a quarter of loop.rate_hz");
  one("excitation.amplitude = 12\n", "amplitudes are in metres");
  one("excitation.envelope = [[0, 0.001], [1, 12]]\nexcitation.repeat = false\n",
      "amplitudes are in metres");
  one("excitation.envelope = [[0, 0.001], [1, 0.002]]\n", "the drive would jump");
  one("[excitation]\namplitude = 0.001\nenvelope = [[0, 0.001], [1, 0.001]]\n",
      "has no effect with an envelope");
  one("excitation.envelope = [[0, 0.001], [1, 0.002], [1, 0.001]]\n", "times have to increase");
  one("excitation.envelope = [[0.5, 0.001], [1, 0.001]]\n", "the first time has to be 0");
  one("excitation.envelope = [[0, 0.001], [1, -0.001], [2, 0.001]]\n", "0 or more");
  one("lcm.url = \"239.255.76.67:7667\"\n", "udpm://ADDRESS:PORT");
  one("lcm.url = \"udpm://192.168.1.5:7667?ttl=0\"\n", "192.168.1.5 is not a multicast address");
  one("lcm.url = \"udpm://rig.local:7667\"\n", "\"rig.local\" is not an IPv4 address");
  one("lcm.url = \"udpm://239.255.76.67:76670\"\n", "\"76670\" is not a port");
  one("lcm.url = \"udpm://239.255.76.67:7667?ttl=256\"\n", "ttl: expected a whole number from 0");
  one("lcm.url = \"udpm://239.255.76.67:7667?tlt=1\"\n", "did you mean ttl?");
  one("recording.enabled = true\n", "recording.file is missing with enabled = true");
  one("[recording]\nenabled = true\nfile = \"no/folder/here.log\"\n", "there is no folder");
  one("metrics.file = \"no/folder/here.prom\"\n",
      "rig.toml:5:16: metrics.file: there is no folder");
  one("metrics.file = \"stickslip.txt\"\n", "node_exporter reads only files named *.prom");
}

TEST_F(RigFile, AReplayNeedsItsRecordingAndRefusesACalibration) {
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

constexpr const char* calibration = R"(schema = 1
[channel.velocity]
offset = 0.5
gain = 3
date = "2026-01-01"
reference = "r"
)";

TEST_F(RigFile, CalibrationIsReadFromItsFileAndFromKeys) {
  write("calibration.toml", calibration);
  const Rig rig =
      load("calibration.file = \"calibration.toml\"\ncalibration.normal_load.gain = 2\n");
  EXPECT_EQ(rig.calibration_file, folder_ / "calibration.toml");
  EXPECT_EQ(rig.calibration_text, calibration);
  EXPECT_EQ(rig.calibration[index_of(Channel::velocity)].gain, 3.0);
  EXPECT_EQ(rig.calibration[index_of(Channel::velocity)].offset, 0.5);
  EXPECT_EQ(rig.calibration[index_of(Channel::velocity)].reference, "r");
  EXPECT_EQ(rig.calibration[index_of(Channel::normal_load)], (ChannelCalibration{0.0, 2.0}));
  EXPECT_EQ(rig.calibration[index_of(Channel::displacement)], ChannelCalibration{});
}

TEST_F(RigFile, AChannelIsCalibratedInOnePlace) {
  write("calibration.toml", calibration);
  const std::string file = std::string(least) + "calibration.file = \"calibration.toml\"\n";
  EXPECT_THAT(problems(file + "calibration.velocity.gain = 2\n"),
              testing::ElementsAre(testing::AllOf(
                  testing::StartsWith("rig.toml:6:1"),
                  testing::HasSubstr("calibration.velocity: is in calibration.toml as well"))));
}

TEST_F(RigFile, ProblemsInItsCalibrationAreReported) {
  write("calibration.toml", std::string(calibration) + "crosstalk = 3\n");
  const std::string file = std::string(least) + "calibration.file = \"calibration.toml\"\n";
  EXPECT_THAT(problems(file), testing::ElementsAre(testing::StartsWith(
                                  "calibration.toml:7:13: channel.velocity.crosstalk")));
  EXPECT_THAT(
      problems(std::string(least) + "calibration.file = \"none.toml\"\n"),
      testing::ElementsAre("rig.toml:5:20: calibration.file: none.toml: there is no such file"));
}

TEST_F(RigFile, AReplayRefusesACalibrationFile) {
  write("played.csv", "time_s\n");
  write("calibration.toml", calibration);
  EXPECT_THAT(problems("schema = 1\nrig.name = \"r\"\nrig.model = \"model.toml\"\n"
                       "driver.kind = \"replay\"\ndriver.replay.recording = \"played.csv\"\n"
                       "calibration.file = \"calibration.toml\"\n"),
              testing::ElementsAre(testing::AllOf(testing::StartsWith("rig.toml:6:20"),
                                                  testing::HasSubstr("in SI units already"))));
}

TEST_F(RigFile, ASimulatedRigNeedsATruthThatCanBeDriven) {
  write("imposed.toml", "schema = 1\noscillator.excitation = \"imposed\"\n");
  EXPECT_THAT(problems(std::string(least) + "driver.simulated.truth = \"imposed.toml\"\n"),
              testing::Contains(testing::HasSubstr("imposed motion")));
  write("measured.toml", std::string(model) + "normal_load.law = \"measured\"\n");
  EXPECT_THAT(problems(std::string(least) + "driver.simulated.truth = \"measured.toml\"\n"),
              testing::Not(testing::IsEmpty()));
}

TEST(ShippedRigs, AreValid) {
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

TEST(ShippedRigs, TheSimulatedRigHasAHiddenHardeningSpring) {
  const Rig rig = load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  EXPECT_TRUE(rig.model.terms.empty());
  ASSERT_EQ(rig.simulated.truth.terms.size(), 1U);
  EXPECT_EQ(rig.simulated.truth.terms[0].id, "cubic_stiffness");
  EXPECT_GT(rig.simulated.truth.terms[0].parameters.at("k3_n_m3").value, 0.0);
  // All other differences are within the standard deviations of the model.
  physics::Model assumed = rig.model;
  physics::Model truth = rig.simulated.truth;
  truth.terms.clear();
  const auto a = physics::parameters_of(assumed);
  const auto b = physics::parameters_of(truth);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_LE(std::abs(a[i].parameter->value - b[i].parameter->value), a[i].parameter->sigma)
        << a[i].path;
  }
  EXPECT_EQ(assumed.sensors, truth.sensors);
}

}  // namespace
}  // namespace stickslip::config
