// SPDX-License-Identifier: Apache-2.0
#include "config/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>

#include "config/document.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

constexpr const char* example = R"(schema = 1

[channel.friction_force]
offset = 1.18e-5
gain = 2114.6
covariance = [4e-14, 1.4e-9, 0.12]
residual_std = 4.1e-4
crosstalk = { normal_load = 0.012, displacement = -3 }
valid_range = [-2, 2.5]
raw_unit = "V/V"
date = "2026-03-02T10:20:00Z"
reference = "weights set 12, class M1"
by = "M. Weber"
despite = ["hysteresis"]

[[channel.friction_force.point]]
raw = 1.0e-5
reference_si = 0.0

[[channel.friction_force.point]]
raw = 4.7e-4
raw_std = 2e-8
reference_si = 0.980665
reference_sigma = 5e-5

[[history]]
channel = "friction_force"
offset = 0.0
gain = 2000.0
date = "2025-09-15"
reference = "weights set 11"

[[history.point]]
raw = 1.0
reference_si = 2.0
)";

std::vector<std::string> problems(const std::string& text) {
  try {
    parse_calibration(text, "c.toml");
  } catch (const InputError& error) {
    std::vector<std::string> out;
    for (const Problem& each : error.problems()) out.push_back(each.text());
    return out;
  }
  return {};
}

std::string with(const std::string& from, const std::string& to) {
  std::string text = example;
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(CalibrationFile, EveryKeyIsRead) {
  const CalibrationFile file = parse_calibration(example, "c.toml");
  EXPECT_FALSE(file.channel[index_of(Channel::displacement)]);
  ASSERT_TRUE(file.channel[index_of(Channel::friction_force)]);
  const ChannelCalibration& force = *file.channel[index_of(Channel::friction_force)];
  EXPECT_EQ(force.offset, 1.18e-5);
  EXPECT_EQ(force.gain, 2114.6);
  EXPECT_EQ(force.covariance, (LineCovariance{4e-14, 1.4e-9, 0.12}));
  EXPECT_EQ(force.residual_std, 4.1e-4);
  EXPECT_EQ(force.crosstalk, (std::array{-3.0, 0.0, 0.0, 0.012, 0.0, 0.0}));
  EXPECT_EQ(force.valid, (ValidRange{-2.0, 2.5}));
  EXPECT_EQ(force.raw_unit, "V/V");
  EXPECT_EQ(force.date, "2026-03-02T10:20:00Z");
  EXPECT_EQ(force.reference, "weights set 12, class M1");
  EXPECT_EQ(force.by, "M. Weber");
  EXPECT_THAT(force.despite, testing::ElementsAre("hysteresis"));
  ASSERT_EQ(force.points.size(), 2U);
  EXPECT_EQ(force.points[0], (CalibrationPoint{1.0e-5, 0.0, 0.0, 0.0}));
  EXPECT_EQ(force.points[1], (CalibrationPoint{4.7e-4, 2e-8, 0.980665, 5e-5}));
  ASSERT_EQ(file.history.size(), 1U);
  EXPECT_EQ(file.history[0].channel, Channel::friction_force);
  EXPECT_EQ(file.history[0].calibration.gain, 2000.0);
  EXPECT_EQ(file.history[0].calibration.points.at(0).reference_si, 2.0);
}

TEST(CalibrationFile, ProblemsAreReportedWithTheirPlace) {
  const auto one = [](const std::string& from, const std::string& to, const char* line) {
    EXPECT_THAT(problems(with(from, to)), testing::ElementsAre(testing::StartsWith(line))) << to;
  };
  ASSERT_THAT(problems(example), testing::IsEmpty());
  one("gain = 2114.6", "gain = 0", "c.toml:5:8: channel.friction_force.gain: is 0");
  one("gain = 2114.6", "gian = 1",
      "c.toml:5:1: unknown key channel.friction_force.gian: did you mean gain?");
  one("gain = 2114.6\n", "", "c.toml:3:1: channel.friction_force.gain is missing");
  one("[4e-14, 1.4e-9, 0.12]", "[4e-14, 0.12]",
      "c.toml:6:14: channel.friction_force.covariance: expected [variance of the offset");
  one("[4e-14, 1.4e-9, 0.12]", "[4e-14, 1.4e-3, 0.12]",
      "c.toml:6:14: channel.friction_force.covariance: is no covariance");
  one("[4e-14, 1.4e-9, 0.12]", "[-4e-14, 0, 0.12]",
      "c.toml:6:14: channel.friction_force.covariance: is no covariance");
  one("normal_load = 0.012", "normal_lod = 0.012", "c.toml:8:15: unknown channel normal_lod");
  one("normal_load = 0.012", "normal_load = inf",
      "c.toml:8:29: channel.friction_force.crosstalk.normal_load: expected a number");
  one("normal_load = 0.012", "friction_force = 0.012",
      "c.toml:8:13: channel.friction_force.crosstalk: names the channel itself");
  one("[-2, 2.5]", "[2.5, -2]", "c.toml:9:15: channel.friction_force.valid_range: expected [low");
  one("\"2026-03-02T10:20:00Z\"", "\"2 March\"",
      "c.toml:11:8: channel.friction_force.date: expected a date in quotes");
  one("\"2026-03-02T10:20:00Z\"", "2026-03-02",
      "c.toml:11:8: channel.friction_force.date: expected a date in quotes");
  one("[\"hysteresis\"]", "\"hysteresis\"", "c.toml:14:11: channel.friction_force.despite");
  one("raw_std = 2e-8", "raw_std = -1",
      "c.toml:22:11: channel.friction_force.point.raw_std: expected a number, 0 or more");
  one("channel = \"friction_force\"", "channel = \"force\"", "c.toml:27:11: history.channel");
  one("date = \"2025-09-15\"", "date = \"2026-09-15\"",
      "c.toml:30:8: history.0.date: is newer than the calibration of friction_force above it");
  one("gain = 2000.0", "gain = 0.0", "c.toml:29:8: history.0.gain: is 0");
}

TEST(CalibrationFile, InseparableChannelsAreRefused) {
  const auto file = [](double a, double b) {
    const auto channel = [](const char* name, const char* other, double share) {
      return "[channel." + std::string(name) +
             "]\noffset = 0\ngain = 1\ndate = \"2026-01-01\"\nreference = \"r\"\ncrosstalk = { " +
             other + " = " + std::to_string(share) + " }\n";
    };
    return "schema = 1\n" + channel("friction_force", "normal_load", a) +
           channel("normal_load", "friction_force", b);
  };
  EXPECT_THAT(problems(file(0.3, -0.5)), testing::IsEmpty());
  EXPECT_THAT(problems(file(0.99, 0.99)),
              testing::ElementsAre(testing::HasSubstr("the channels cannot be separated")));
  EXPECT_THAT(problems(file(1e3, 1e-3)), testing::SizeIs(1));
  EXPECT_THAT(problems(file(10.0, 0.001)), testing::IsEmpty());
}

TEST(CalibrationFile, IsRecognised) {
  EXPECT_EQ(kind_of(example), FileKind::calibration);
  EXPECT_EQ(kind_of("schema = 1\n[oscillator]\n[[physics]]\nchannel = \"velocity\"\n"),
            FileKind::model);
}

TEST(CalibrationFile, ShippedFileIsValid) {
  const CalibrationFile file =
      load_calibration(STICKSLIP_SOURCE_DIR "/config/calibrations/beam.toml");
  EXPECT_EQ(parse_calibration(calibration_text(file), "written"), file);
}

// Any printable text, numbers of any size, any order of history.
rc::Gen<double> numbers() {
  return rc::gen::map(rc::gen::arbitrary<std::uint64_t>(), [](std::uint64_t bits) {
    const auto value = std::bit_cast<double>(bits);
    return std::isfinite(value) ? value : 0.0;
  });
}

rc::Gen<std::string> words() {
  return rc::gen::map(rc::gen::container<std::string>(rc::gen::inRange(' ', '\x7f')),
                      [](std::string text) { return "\"\\\n\t\x01 \xc3\xbc#" + text; });
}

ChannelCalibration arbitrary_calibration(const std::string& date, Channel own) {
  ChannelCalibration out;
  out.offset = *numbers();
  out.gain = *numbers();
  if (out.gain == 0.0) out.gain = 1.0;
  const double a = std::abs(*numbers());
  const double b = std::abs(*numbers());
  out.covariance = {a, 0.5 * std::sqrt(a) * std::sqrt(b), b};
  out.residual_std = std::abs(*numbers());
  const Channel other = own == Channel::velocity ? Channel::normal_load : Channel::velocity;
  out.crosstalk[index_of(other)] = *rc::gen::inRange(-100, 100) / 300.0;
  const double low = *numbers();
  const double high = *numbers();
  if (low < high) out.valid = ValidRange{low, high};
  out.raw_unit = *words();
  out.date = date;
  out.reference = *words();
  out.by = *words();
  if (*rc::gen::arbitrary<bool>()) out.despite = {*words(), *words()};
  const int points = *rc::gen::inRange(0, 4);
  for (int i = 0; i < points; ++i) {
    out.points.push_back({*numbers(), std::abs(*numbers()), *numbers(), std::abs(*numbers())});
  }
  return out;
}

RC_GTEST_PROP(CalibrationFileProperty, ReadsBackToTheBit, ()) {
  CalibrationFile file;
  const Channel channel = *rc::gen::elementOf(all_channels);
  file.channel[index_of(channel)] = arbitrary_calibration("2026-02-01", channel);
  for (const char* date : {"2026-01-31T23:00:00-01:00", "2026-01-31T12:00:00Z", "2025-01-01"}) {
    file.history.push_back({channel, arbitrary_calibration(date, channel)});
  }
  const CalibrationFile read = parse_calibration(calibration_text(file), "written");
  RC_ASSERT(read == file);
  // Equality does not distinguish the signs of zeros.
  const auto bits = [](double value) { return std::bit_cast<std::uint64_t>(value); };
  RC_ASSERT(bits(read.channel[index_of(channel)]->offset) ==
            bits(file.channel[index_of(channel)]->offset));
}

RC_GTEST_PROP(CalibrationFileProperty, RenewingKeepsTheNewestFirst, ()) {
  CalibrationFile file;
  const int renewals = *rc::gen::inRange(1, 12);
  std::array<int, channel_count> times{};
  for (int day = 1; day <= renewals; ++day) {
    const Channel channel = *rc::gen::elementOf(
        std::vector<Channel>{Channel::velocity, Channel::friction_force, Channel::normal_load});
    ChannelCalibration next;
    next.gain = day;
    next.date = std::string("2026-01-") + (day < 10 ? "0" : "") + std::to_string(day);
    next.reference = "r";
    renew(file, channel, next, "c.toml");
    ++times[index_of(channel)];
  }
  const CalibrationFile read = parse_calibration(calibration_text(file), "written");
  RC_ASSERT(read == file);
  std::array<double, channel_count> newer{};
  for (Channel channel : all_channels) {
    const auto& holds = file.channel[index_of(channel)];
    RC_ASSERT(holds.has_value() == (times[index_of(channel)] > 0));
    if (holds) newer[index_of(channel)] = holds->gain;
  }
  for (const FormerCalibration& each : file.history) {
    RC_ASSERT(each.calibration.gain < newer[index_of(each.channel)]);
    newer[index_of(each.channel)] = each.calibration.gain;
    --times[index_of(each.channel)];
  }
  RC_ASSERT(
      std::all_of(times.begin(), times.end(), [](int left) { return left == 0 || left == 1; }));
}

TEST(Renew, KeepsCrosstalkAndRefusesAnEarlierTime) {
  CalibrationFile file = parse_calibration(example, "c.toml");
  ChannelCalibration next;
  next.date = "2026-03-01";
  next.reference = "r";
  EXPECT_THROW(renew(file, Channel::friction_force, next, "c.toml"), InputError);
  next.date = "yesterday";
  EXPECT_THROW(renew(file, Channel::friction_force, next, "c.toml"), InputError);
  EXPECT_EQ(file, parse_calibration(example, "c.toml")) << "unchanged after a refusal";
  next.date = "2026-03-03";
  renew(file, Channel::friction_force, next, "c.toml");
  EXPECT_EQ(
      file.channel[index_of(Channel::friction_force)]->crosstalk[index_of(Channel::normal_load)],
      0.012);
  ASSERT_EQ(file.history.size(), 2U);
  EXPECT_EQ(file.history[0].calibration.gain, 2114.6);
}

TEST(CalibrationSigma, AgreesWithErrorPropagation) {
  ChannelCalibration calibration;
  calibration.offset = 3.0;
  calibration.gain = 2.0;
  calibration.covariance = {0.04, 0.0, 0.0};
  EXPECT_DOUBLE_EQ(calibration_sigma(calibration, 100.0), 0.4);
  calibration.covariance = {0.0, 0.0, 0.01};
  EXPECT_DOUBLE_EQ(calibration_sigma(calibration, 100.0), 5.0);
  calibration.covariance = {0.04, 0.01, 0.01};
  // By differences: SI = (raw - offset) gain at raw = 53.
  EXPECT_DOUBLE_EQ(calibration_sigma(calibration, 100.0),
                   std::sqrt(0.16 - 2.0 * 100.0 * 0.01 + 25.0));
}

TEST(UtcSeconds, AgreeWithTheCalendar) {
  EXPECT_EQ(utc_seconds("1970-01-01"), 0);
  EXPECT_EQ(utc_seconds("2026-11-22T14:03:05Z"), 1795356185);
  EXPECT_EQ(utc_seconds("2026-11-22T15:03:05+01:00"), 1795356185);
  EXPECT_EQ(utc_seconds("2026-11-22T12:33:05-01:30"), 1795356185);
  EXPECT_EQ(utc_seconds("2024-02-29"), 1709164800);
  for (const char* wrong :
       {"", "2026", "2026-13-01", "2023-02-29", "2026-11-22T14:03Z", "2026-11-22T14:03:05",
        "2026-11-22 14:03:05Z", "2026-11-22T24:03:05Z", "2026-11-22T14:03:05+1:00", "22.11.2026",
        "2026-11-22T14:03:05Zz", "20261122T", "2026/11/22"}) {
    EXPECT_FALSE(utc_seconds(wrong)) << wrong;
  }
}

}  // namespace
}  // namespace stickslip::config
