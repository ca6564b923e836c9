// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include "config/rig.h"
#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* timer = "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
constexpr const char* rules = "/usr/lib/udev/rules.d/70-stickslip.rules";
constexpr const char* rule =
    R"(ACTION=="add|bind|change", SUBSYSTEM=="usb-serial", DRIVERS=="ftdi_sio", )"
    R"(TEST=="latency_timer", ATTR{latency_timer}="1")";

Requirements with_modbus(const std::string& port, double poll_period_s) {
  Requirements required = hardware_requirements();
  required.modbus_lines = {{port, poll_period_s}};
  return required;
}

TEST(SerialLatencyCheck, WarnsOfDelaysThatMatterToThePolls) {
  FakeHost host;
  EXPECT_THAT(
      check_serial_latency(host, with_modbus("/dev/ttyUSB0", 0.05)),
      AllOf(passes(), is(Verdict::ok, "/dev/ttyUSB0 passes received bytes on within 1 ms")));
  host.files[timer] = "16";
  EXPECT_THAT(check_serial_latency(host, with_modbus("/dev/ttyUSB0", 0.05)),
              is(Verdict::warn,
                 "/dev/ttyUSB0 holds received bytes back for 16 ms: each reply is up "
                 "to 16 ms late, in a poll period of 50 ms"));
  EXPECT_THAT(check_serial_latency(host, with_modbus("/dev/ttyUSB0", 1.0)),
              AllOf(passes(), is(Verdict::ok, "16 ms")));
  host.files[timer] = "2";
  EXPECT_THAT(check_serial_latency(host, with_modbus("/dev/ttyUSB0", 0.001)), passes());
}

TEST(SerialLatencyCheck, FollowsTheConstantName) {
  FakeHost host;
  host.files[timer] = "16";
  EXPECT_THAT(check_serial_latency(
                  host, with_modbus("/dev/serial/by-id/usb-FTDI_FT232R_A1-if00-port0", 0.05)),
              is(Verdict::warn, "/dev/ttyUSB0"));
}

TEST(SerialLatencyCheck, AppliesInstalledRulesOrSetsTimerAndRule) {
  FakeHost host;
  host.files[timer] = "16";
  const Requirements required = with_modbus("/dev/ttyUSB0", 0.05);
  EXPECT_THAT(check_serial_latency(host, required),
              remedied_by("sudo udevadm control --reload && sudo udevadm trigger"));
  const std::string now_and_later = std::string("echo 1 | sudo tee ") + timer + " && echo '" +
                                    rule + "' | sudo tee /etc/udev/rules.d/70-stickslip-ftdi.rules";
  host.files[rules] = "rules of an earlier version";
  EXPECT_THAT(check_serial_latency(host, required), remedied_by(now_and_later));
  host.folders.erase("/usr/lib/udev/rules.d");
  EXPECT_THAT(check_serial_latency(host, required), remedied_by(now_and_later));
}

TEST(SerialLatencyCheck, OtherPortsHaveNoTimer) {
  FakeHost host;
  host.files[timer] = "16";
  for (const char* port : {"/dev/ttyUSB1", "/dev/ttyS0"}) {
    EXPECT_THAT(check_serial_latency(host, with_modbus(port, 0.05)),
                AllOf(is(Verdict::note, "no FTDI adapter"), remedied_by("")));
  }
  EXPECT_THAT(check_serial_latency(host, hardware_requirements()),
              AllOf(is(Verdict::note, "no Modbus unit"), remedied_by("")));
}

TEST(SerialLatencyCheck, WithoutARigNotesThoseThatArePresent) {
  FakeHost host;
  EXPECT_THAT(check_serial_latency(host, some_requirements()), passes());
  host.files[timer] = "16";
  host.files["/sys/bus/usb-serial/devices/ttyUSB1/latency_timer"] = "1";
  EXPECT_THAT(
      check_serial_latency(host, some_requirements()),
      AllOf(is(Verdict::note, "/dev/ttyUSB0 holds received bytes back for 16 ms; /dev/ttyUSB1"),
            remedied_by("sudo udevadm control --reload && sudo udevadm trigger")));
  host.folders.erase("/sys/bus/usb-serial/devices");
  EXPECT_THAT(check_serial_latency(host, some_requirements()),
              is(Verdict::note, "no FTDI adapter"));
}

TEST(SerialLatencyCheck, ExaminesTheSerialLinesOfTheRig) {
  config::Rig rig;
  rig.driver = config::DriverKind::bench;
  for (const double poll_period_s : {0.1, 0.05, 0.2}) {
    config::ModbusUnit unit;
    unit.port = "/dev/ttyUSB0";
    unit.poll_period_s = poll_period_s;
    rig.bench.modbus.push_back(unit);
  }
  rig.bench.modbus.emplace_back().port = "lvdt.lab:502";
  rig.bench.modbus.back().transport = config::ModbusTransport::tcp;
  const Requirements required = requirements_of(rig);
  ASSERT_EQ(required.modbus_lines.size(), 1U);
  EXPECT_EQ(required.modbus_lines[0].port, "/dev/ttyUSB0");
  EXPECT_EQ(required.modbus_lines[0].poll_period_s, 0.05);
}

TEST(SerialLatencyCheck, RuleIsThatOfTheInstalledFile) {
  std::ifstream file(STICKSLIP_SOURCE_DIR "/systemd/70-stickslip.rules");
  bool found = false;
  for (std::string line; std::getline(file, line);) found = found || line == rule;
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace stickslip::doctor
