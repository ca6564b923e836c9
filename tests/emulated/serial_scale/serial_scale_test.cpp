// SPDX-License-Identifier: Apache-2.0
// The real driver with a balance on a pseudo-terminal, and its creation from a rig file.
#include "drivers/serial_scale/serial_scale.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <random>

#include "config/rig.h"
#include "drivers/bench/gauge_reader.h"
#include "drivers/factory/make_bench.h"
#include "tests/emulated/serial_scale/emulated_serial_scale.h"
#include "tests/emulated/stepped_clock.h"

namespace stickslip::emulated {
namespace {

using drivers::Outcome;
using drivers::Reading;
using drivers::Result;
using drivers::SerialScale;
using testing::HasSubstr;

constexpr std::int64_t ms = 1'000'000;
constexpr double newton_per_kg = 9.80665;

/// Drops root privileges, with which any device can be opened, for its lifetime.
class Unprivileged {
 public:
  Unprivileged() { static_cast<void>(::seteuid(user_ == 0 ? 65534 : user_)); }
  ~Unprivileged() { static_cast<void>(::seteuid(user_)); }
  Unprivileged(const Unprivileged&) = delete;
  Unprivileged& operator=(const Unprivileged&) = delete;

 private:
  uid_t user_ = ::geteuid();
};

class SerialScaleBench : public testing::Test {
 protected:
  SerialScaleBench() : scale_(folder_) {}
  ~SerialScaleBench() override {
    scale_.stop();
    std::filesystem::remove_all(folder_);
  }

  static std::filesystem::path new_folder() {
    std::string name = (std::filesystem::temp_directory_path() / "stickslip-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder");
    std::filesystem::permissions(name, std::filesystem::perms(0755));
    return name;
  }
  config::GaugeAt settings() const {
    config::GaugeAt scale;
    scale.name = "scale";
    scale.port = scale_.port();
    return scale;
  }
  static config::BenchInputs wired(const std::string& input = "weight") {
    config::BenchInputs inputs{};
    inputs[index_of(Channel::normal_load)] = config::BenchInput{.device = "scale", .input = input};
    return inputs;
  }
  Result read() { return gauge_.read({&reading_, 1}); }

  std::filesystem::path folder_ = new_folder();
  EmulatedSerialScale scale_;
  SteppedClock clock_;
  SerialScale gauge_{settings(), wired(), clock_};
  Reading reading_;
};

TEST_F(SerialScaleBench, DescribesItsInputs) {
  ASSERT_EQ(gauge_.inputs().size(), 1U);
  EXPECT_EQ(gauge_.inputs()[0].device, "scale");
  EXPECT_EQ(gauge_.inputs()[0].name, "weight");
  EXPECT_EQ(gauge_.inputs()[0].unit, "N");
  EXPECT_THAT(gauge_.name(), HasSubstr("\"scale\""));
}

TEST_F(SerialScaleBench, ReadsWeightsAtRestAndInMotion) {
  ASSERT_TRUE(gauge_.open());
  scale_.write(scale_line('S', 12.345, "g"));
  ASSERT_EQ(read().outcome, Outcome::ok);
  EXPECT_TRUE(reading_.valid);
  EXPECT_NEAR(reading_.value, 0.012345 * newton_per_kg, 1e-12);
  scale_.write(scale_line('M', -2.5, "kg"));
  ASSERT_EQ(read().outcome, Outcome::ok);
  EXPECT_TRUE(reading_.valid);
  EXPECT_NEAR(reading_.value, -2.5 * newton_per_kg, 1e-12);
}

TEST_F(SerialScaleBench, ReadingTimeIsTheStartOfItsLine) {
  ASSERT_TRUE(gauge_.open());
  const std::string line = scale_line('S', 1.0, "g");
  scale_.write(line);
  ASSERT_EQ(read().outcome, Outcome::ok);
  const auto bits = static_cast<std::int64_t>(10 * line.size());
  EXPECT_EQ(reading_.time_ns, clock_.now_ns() - bits * 1'000'000'000 / 9600);
}

TEST_F(SerialScaleBench, ReadingWithErrorStatusIsInvalid) {
  ASSERT_TRUE(gauge_.open());
  scale_.write(scale_line('S', 1.0, "g"));
  ASSERT_EQ(read().outcome, Outcome::ok);
  scale_.write(scale_line('E', 0.0, "g"));
  ASSERT_EQ(read().outcome, Outcome::ok);
  EXPECT_FALSE(reading_.valid);
  EXPECT_EQ(gauge_.losses().rejected, 0U);
}

TEST_F(SerialScaleBench, LineWithAWrongChecksumIsRejected) {
  ASSERT_TRUE(gauge_.open());
  std::string line = scale_line('S', 1.0, "g");
  line[7] = '9';
  scale_.write(line);
  const Result corrupted = read();
  EXPECT_EQ(corrupted.outcome, Outcome::temporary);
  EXPECT_THAT(corrupted.message, HasSubstr("scale"));
  EXPECT_FALSE(reading_.valid);
  EXPECT_EQ(reading_.time_ns, 0);
  EXPECT_EQ(gauge_.losses().rejected, 1U);
  scale_.write(scale_line('S', 1.0, "g"));
  EXPECT_EQ(read().outcome, Outcome::ok);
  EXPECT_EQ(gauge_.losses().rejected, 1U);
}

TEST_F(SerialScaleBench, LineMayArriveInPieces) {
  ASSERT_TRUE(gauge_.open());
  const std::string line = scale_line('S', 3.0, "g");
  for (const char each : line.substr(0, line.size() - 1)) {
    scale_.write({each});
    if (each == '\r') {
      EXPECT_EQ(read().outcome, Outcome::no_data);
    }
  }
  scale_.write("\n");
  ASSERT_EQ(read().outcome, Outcome::ok);
  EXPECT_NEAR(reading_.value, 0.003 * newton_per_kg, 1e-12);
}

TEST_F(SerialScaleBench, NewestOfSeveralLinesIsUsed) {
  ASSERT_TRUE(gauge_.open());
  scale_.write(scale_line('S', 1.0, "g") + "nonsense\r\n" + scale_line('S', 2.0, "g") + "S +0");
  ASSERT_EQ(read().outcome, Outcome::ok);
  EXPECT_NEAR(reading_.value, 0.002 * newton_per_kg, 1e-12);
  EXPECT_EQ(gauge_.losses().rejected, 1U);
}

TEST_F(SerialScaleBench, EndlessLineIsRejected) {
  ASSERT_TRUE(gauge_.open());
  scale_.write(std::string(1000, '\x03'));  // a terminal would interpret it as Ctrl-C
  EXPECT_EQ(read().outcome, Outcome::temporary);
  EXPECT_EQ(gauge_.losses().rejected, 1U);
  scale_.write("\r\n" + scale_line('S', 2.0, "g"));
  EXPECT_EQ(read().outcome, Outcome::ok);
}

TEST_F(SerialScaleBench, OmittedLineCountsAsMissing) {
  ASSERT_TRUE(gauge_.open());
  for (int i = 0; i < 10; ++i) {
    clock_.pass(100 * ms);
    scale_.write(scale_line('S', 1.0, "g"));
    ASSERT_EQ(read().outcome, Outcome::ok);
  }
  EXPECT_EQ(gauge_.losses().missing, 0U);
  clock_.pass(300 * ms);
  scale_.write(scale_line('S', 1.0, "g"));
  ASSERT_EQ(read().outcome, Outcome::ok);
  EXPECT_EQ(gauge_.losses().missing, 2U);
  clock_.pass(190 * ms);
  EXPECT_EQ(read().outcome, Outcome::no_data);
  EXPECT_EQ(gauge_.losses().missing, 3U);
}

TEST_F(SerialScaleBench, ConfiguresThePort) {
  config::GaugeAt scale = settings();
  scale.baud = 115200;
  SerialScale gauge(scale, wired(), clock_);
  ASSERT_TRUE(gauge.open());
  const int port_file = ::open(scale.port.c_str(), O_RDONLY | O_NOCTTY | O_CLOEXEC);
  if (port_file < 0) GTEST_SKIP() << "a port opened exclusively cannot be inspected by this user";
  termios line{};
  ::tcgetattr(port_file, &line);
  ::close(port_file);
  EXPECT_EQ(::cfgetispeed(&line), speed_t{B115200});
  EXPECT_EQ(line.c_cflag & (CSIZE | CSTOPB), tcflag_t{CS8});  // a pseudo-terminal has no parity
  EXPECT_EQ(line.c_lflag & (ICANON | ECHO | ISIG), 0U);
  EXPECT_EQ(line.c_iflag & (ICRNL | IXON | INLCR), 0U);
}

TEST_F(SerialScaleBench, UnpluggedDeviceIsLostAndRecovers) {
  ASSERT_TRUE(gauge_.open());
  scale_.unplug();
  const Result gone = read();
  EXPECT_EQ(gone.outcome, Outcome::lost);
  EXPECT_THAT(gone.message, HasSubstr("is disconnected"));
  gauge_.close();
  EXPECT_EQ(gauge_.open().outcome, Outcome::lost);
  scale_.plug_in();
  ASSERT_TRUE(gauge_.open());
  scale_.write(scale_line('S', 1.0, "g"));
  EXPECT_EQ(read().outcome, Outcome::ok);
}

TEST_F(SerialScaleBench, ReopeningResetsTheState) {
  ASSERT_TRUE(gauge_.open());
  scale_.write("nonsense\r\nS +0");
  EXPECT_EQ(read().outcome, Outcome::temporary);
  gauge_.close();
  gauge_.close();
  EXPECT_EQ(read().outcome, Outcome::fatal);
  ASSERT_TRUE(gauge_.open());
  EXPECT_EQ(gauge_.losses().rejected, 0U);
  scale_.write(scale_line('S', 1.0, "g"));
  EXPECT_EQ(read().outcome, Outcome::ok);
}

TEST_F(SerialScaleBench, AbsentPortIsReported) {
  scale_.unplug();
  const Result absent = gauge_.open();
  EXPECT_EQ(absent.outcome, Outcome::lost);
  EXPECT_THAT(absent.message, HasSubstr(scale_.port()));
  EXPECT_THAT(absent.message, HasSubstr("/dev/serial/by-id"));
}

TEST_F(SerialScaleBench, DeniedPermissionNamesGroupAndCommand) {
  ASSERT_EQ(::chmod(scale_.port().c_str(), 0), 0);
  const Unprivileged unprivileged;
  const Result refused = gauge_.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("group dialout"));
  EXPECT_THAT(refused.message, HasSubstr("sudo usermod -aG dialout $USER"));
}

TEST_F(SerialScaleBench, PortInUseIsBusy) {
  ASSERT_EQ(::chmod(scale_.port().c_str(), 0666), 0);
  ASSERT_TRUE(gauge_.open());
  SerialScale second(settings(), wired(), clock_);
  {
    const Unprivileged unprivileged;
    const Result busy = second.open();
    EXPECT_EQ(busy.outcome, Outcome::needs_attention);
    EXPECT_THAT(busy.message, HasSubstr("fuser"));
  }
  gauge_.close();
  const Unprivileged unprivileged;
  EXPECT_TRUE(second.open());
}

TEST_F(SerialScaleBench, InvalidSettingsNeedAttention) {
  SerialScale other_input(settings(), wired("length"), clock_);
  const Result no_input = other_input.open();
  EXPECT_EQ(no_input.outcome, Outcome::needs_attention);
  EXPECT_THAT(no_input.message, HasSubstr("\"length\""));

  config::GaugeAt scale = settings();
  scale.baud = 9601;
  SerialScale odd(scale, wired(), clock_);
  const Result no_speed = odd.open();
  EXPECT_EQ(no_speed.outcome, Outcome::needs_attention);
  EXPECT_THAT(no_speed.message, HasSubstr("9601"));

  scale = settings();
  scale.port = "/dev/null";
  SerialScale nothing(scale, wired(), clock_);
  const Result no_line = nothing.open();
  EXPECT_EQ(no_line.outcome, Outcome::needs_attention);
  EXPECT_THAT(no_line.message, HasSubstr("not a serial port"));
}

// One line in three is corrupted; every valid reading of GaugeReader was transmitted.
TEST_F(SerialScaleBench, CorruptedLinesNeverYieldAReading) {
  drivers::MonotonicHostClock clock;
  drivers::GaugeReader reader(std::make_unique<SerialScale>(settings(), wired(), clock));
  ASSERT_TRUE(reader.open(true));
  std::mt19937 random(1);
  std::atomic<int> written = 0;
  scale_.start(2 * ms, [&] {
    std::string line = scale_line('S', 1000.0 + written++, "g");
    if (random() % 3 == 0) {
      line[random() % line.size()] ^= static_cast<char>(1U << random() % 8);
    }
    return line;
  });
  const std::int64_t end = clock.now_ns() + 20'000 * ms;
  std::int64_t latest_ns = 0;
  int valid_readings = 0;
  double last = 0.0;
  while (valid_readings < 200 && clock.now_ns() < end) {
    clock.sleep_until(clock.now_ns() + ms);
    const Reading reading = reader.latest(0, clock.now_ns());
    if (!reading.valid || reading.time_ns == latest_ns) continue;
    latest_ns = reading.time_ns;
    const double number = reading.value / newton_per_kg * 1000.0 - 1000.0;
    ASSERT_NEAR(number, std::round(number), 1e-6);
    ASSERT_GE(number, last);
    ASSERT_LT(number, written);
    last = number;
    ++valid_readings;
  }
  scale_.stop();
  EXPECT_EQ(valid_readings, 200);
  EXPECT_GT(reader.losses().rejected, 0U);
  EXPECT_EQ(reader.lost(), nullptr);
  reader.close();
}

TEST_F(SerialScaleBench, IsCreatedFromARigFile) {
  std::ofstream(folder_ / "model.toml") << R"(schema = 1
[oscillator]
excitation = "base"
mass_kg = 0.06
natural_frequency_hz = 2.4
damping_ratio = 0.05
)";
  std::ofstream(folder_ / "rig.toml") << R"(schema = 1
[rig]
name = "a balance under the rig"
model = "model.toml"
[driver]
kind = "bench"
[driver.bench]
board = "labjack_u6"
[labjack_u6]
enable_line = 0
[shaker]
volts_per_unit = 150.0
[inputs.displacement]
from = "labjack_u6/AIN0"
[inputs.normal_load]
from = "scale/weight"
[[gauge]]
name = "scale"
kind = "serial_scale"
port = ")" << scale_.port() << R"("
baud = 19200
[[gauge]]
name = "idle"
kind = "serial_scale"
port = "nowhere"
)";
  const config::Rig rig = config::load_rig(folder_ / "rig.toml");
  ASSERT_EQ(rig.bench.gauges.size(), 2U);
  const drivers::BenchParts parts = drivers::make_bench_parts(rig.bench, rig.loop.rate_hz);
  ASSERT_EQ(parts.gauges.size(), 1U) << "unused gauges are not created";
  drivers::Gauge& gauge = *parts.gauges[0];
  ASSERT_EQ(gauge.inputs().size(), 1U);
  EXPECT_EQ(gauge.inputs()[0].device, "scale");
  EXPECT_EQ(gauge.inputs()[0].name, "weight");
  ASSERT_TRUE(gauge.open());
  scale_.write(scale_line('S', 250.0, "g"));
  ASSERT_EQ(gauge.read({&reading_, 1}).outcome, Outcome::ok);
  EXPECT_NEAR(reading_.value, 0.25 * newton_per_kg, 1e-12);
}

}  // namespace
}  // namespace stickslip::emulated
