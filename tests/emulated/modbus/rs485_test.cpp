// SPDX-License-Identifier: Apache-2.0
// Direction of an RS-485 line: the driver's bus and library on a pseudo-terminal whose modem lines
// and RS-485 settings this program emulates, in place of ioctl, tcdrain and write of the C library.
#include "drivers/modbus/rs485.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "drivers/clock/host_clock.h"
#include "drivers/modbus/modbus_bus.h"
#include "tests/emulated/modbus/emulated_modbus_units.h"

namespace {

/// The driver of the port, as the program sees it.
struct Port {
  bool rts = true;  ///< as opening leaves it
  std::uint32_t rs485_flags = 0;
  std::uint32_t fixed_flags = 0;                   ///< that no setting clears
  std::map<std::string, std::vector<int>> errors;  ///< of the next calls, by name; 0: none
  std::vector<std::string> calls;
  std::int64_t written_ns = 0;
  std::int64_t switched_ns = 0;  ///< latest change of RTS
};

Port port;
thread_local bool is_driver = false;  // the thread of the test; the emulated units have another

/// Records a call. False if it fails, with errno.
bool call(const std::string& name) {
  port.calls.push_back(name);
  std::vector<int>& errors = port.errors[name];
  if (errors.empty()) return true;
  errno = errors.front();
  if (errors.size() > 1) errors.erase(errors.begin());
  return errno == 0;
}

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000'000LL + now.tv_nsec;
}

int emulated_ioctl(unsigned long request, void* argument) {
  if (request == TIOCMBIS || request == TIOCMBIC) {
    if (*static_cast<const int*>(argument) != TIOCM_RTS) return -1;
    if (!call(request == TIOCMBIS ? "assert" : "release")) return -1;
    port.rts = request == TIOCMBIS;
    port.switched_ns = now_ns();
    return 0;
  }
  auto& line = *static_cast<serial_rs485*>(argument);
  if (request == TIOCGRS485) {
    if (!call("get")) return -1;
    line.flags = port.rs485_flags;
    return 0;
  }
  if (!call("set")) return -1;
  port.rs485_flags = line.flags | port.fixed_flags;
  return 0;
}

}  // namespace

extern "C" int ioctl(int file, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  switch (request) {
    case TIOCMBIS:
    case TIOCMBIC:
    case TIOCGRS485:
    case TIOCSRS485:
      return emulated_ioctl(request, argument);
    default:
      return static_cast<int>(::syscall(SYS_ioctl, file, request, argument));
  }
}

extern "C" int tcdrain(int) { return call("drain") ? 0 : -1; }

extern "C" ssize_t write(int file, const void* bytes, size_t size) {
  if (is_driver) {
    if (!call("write " + std::to_string(size))) return -1;
    port.written_ns = now_ns();
  }
  return ::syscall(SYS_write, file, bytes, size);
}

namespace stickslip::emulated {
namespace {

using config::Rs485Direction;
using config::RtsState;
using drivers::Outcome;
using drivers::modbus::Caller;
using drivers::modbus::Exchange;
using drivers::modbus::ModbusBus;
using drivers::modbus::Progress;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t ms = 1'000'000;

class Rs485 : public testing::Test {
 protected:
  Rs485()
      : folder_(std::filesystem::temp_directory_path() /
                ("stickslip-rs485-" + std::to_string(::getpid()))),
        units_([this] { return clock_.now_ns(); }, folder_, 1) {
    port = Port{};
    Parameter seven;
    seven.number = [](std::int64_t) { return 7.0; };
    units_.add(1, {}, {seven});
    units_.start();
    settings_.port = units_.serial_port();
    settings_.baud = 115200;
    is_driver = true;
  }
  ~Rs485() override {
    is_driver = false;
    bus_.reset();
    std::filesystem::remove_all(folder_);
  }

  Outcome connect(Rs485Direction direction, RtsState while_sending = RtsState::asserted) {
    settings_.direction = direction;
    settings_.rts_while_sending = while_sending;
    bus_ = std::make_unique<ModbusBus>(settings_, clock_);
    return bus_->connect(why_);
  }

  Exchange request() {
    port.calls.clear();
    const auto message =
        drivers::modbus::read_message(1, {config::RegisterTable::holding_registers, 0, 1});
    return bus_->exchange(caller_, message, clock_.now_ns() + 1000 * ms);
  }

  drivers::MonotonicHostClock clock_;
  std::filesystem::path folder_;
  EmulatedModbusUnits units_;
  config::ModbusUnit settings_;
  Caller caller_;
  std::unique_ptr<ModbusBus> bus_;
  std::string why_;
};

TEST_F(Rs485, AutomaticLeavesThePortAsItIs) {
  ASSERT_EQ(connect(Rs485Direction::automatic), Outcome::ok) << why_;
  EXPECT_THAT(port.calls, IsEmpty());
  EXPECT_EQ(request().progress, Progress::answered);
  EXPECT_THAT(port.calls, ElementsAre("write 8"));
}

TEST_F(Rs485, RtsIsSwitchedAroundEachRequest) {
  ASSERT_EQ(connect(Rs485Direction::rts), Outcome::ok) << why_;
  EXPECT_FALSE(port.rts) << "the line is received from before the first request";
  for (int i = 0; i < 2; ++i) {
    const Exchange answer = request();
    EXPECT_EQ(answer.progress, Progress::answered) << answer.why;
    EXPECT_EQ(answer.words, std::vector<std::uint16_t>{7});
    EXPECT_THAT(port.calls, ElementsAre("assert", "write 8", "drain", "release"));
  }
}

TEST_F(Rs485, RtsHasTheConfiguredState) {
  port.rts = false;
  ASSERT_EQ(connect(Rs485Direction::rts, RtsState::released), Outcome::ok) << why_;
  EXPECT_TRUE(port.rts);
  EXPECT_EQ(request().progress, Progress::answered);
  EXPECT_THAT(port.calls, ElementsAre("release", "write 8", "drain", "assert"));
}

// Some drivers of adapters drain at once: that of the CH340 knows no end of a transmission.
TEST_F(Rs485, RtsIsHeldForTheTimeOfTheTransmission) {
  settings_.baud = 4800;
  ASSERT_EQ(connect(Rs485Direction::rts), Outcome::ok) << why_;
  EXPECT_EQ(request().progress, Progress::answered);
  const std::int64_t transmission_ns = 8 * 11 * 1000 * ms / 4800;
  EXPECT_GE(port.switched_ns - port.written_ns, transmission_ns);
}

TEST_F(Rs485, InterruptedDrainIsRepeated) {
  ASSERT_EQ(connect(Rs485Direction::rts), Outcome::ok) << why_;
  port.errors["drain"] = {EINTR, 0};
  EXPECT_EQ(request().progress, Progress::answered);
  EXPECT_THAT(port.calls, ElementsAre("assert", "write 8", "drain", "drain", "release"));
}

struct Failure {
  std::string name;
  std::vector<std::string> calls;
  friend void PrintTo(const Failure& failure, std::ostream* out) { *out << failure.name; }
};

class FailedRs485 : public Rs485, public testing::WithParamInterface<Failure> {};

INSTANTIATE_TEST_SUITE_P(
    Steps, FailedRs485,
    testing::Values(Failure{"assert", {"assert", "release"}},
                    Failure{"write 8", {"assert", "write 8", "release"}},
                    Failure{"drain", {"assert", "write 8", "drain", "release"}},
                    Failure{"release", {"assert", "write 8", "drain", "release", "release"}}),
    [](const auto& info) { return info.param.name.substr(0, info.param.name.find(' ')); });

TEST_P(FailedRs485, EndsTheConnectionAndNeverKeepsSending) {
  ASSERT_EQ(connect(Rs485Direction::rts), Outcome::ok) << why_;
  port.errors[GetParam().name] = {EIO};
  const Exchange failed = request();
  EXPECT_EQ(failed.progress, Progress::gone);
  EXPECT_THAT(failed.why, HasSubstr("Input/output error"));
  EXPECT_THAT(port.calls, testing::ElementsAreArray(GetParam().calls));
  port.errors.clear();
  ASSERT_EQ(bus_->connect(why_), Outcome::ok) << why_;
  EXPECT_FALSE(port.rts);
  EXPECT_EQ(request().progress, Progress::answered);
}

TEST_F(Rs485, PortWithoutRtsIsRefused) {
  for (const int error : {ENOTTY, EINVAL}) {
    port.errors["release"] = {error};
    EXPECT_EQ(connect(Rs485Direction::rts), Outcome::needs_attention);
    EXPECT_THAT(why_, AllOf(HasSubstr(settings_.port + ": "), HasSubstr("does not set RTS"),
                            HasSubstr(std::strerror(error)), HasSubstr("direction = \"kernel\""),
                            HasSubstr("direction = \"automatic\"")));
  }
}

TEST_F(Rs485, RtsEndsTheSwitchingByTheKernel) {
  port.rs485_flags = SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND;
  ASSERT_EQ(connect(Rs485Direction::rts), Outcome::ok) << why_;
  EXPECT_EQ(port.rs485_flags & SER_RS485_ENABLED, 0U);
  EXPECT_THAT(port.calls, ElementsAre("get", "set", "release"));
}

TEST_F(Rs485, KernelIsSetUpOnce) {
  // As a board's firmware declares it.
  port.rs485_flags = SER_RS485_RTS_AFTER_SEND | SER_RS485_RX_DURING_TX | SER_RS485_TERMINATE_BUS;
  ASSERT_EQ(connect(Rs485Direction::kernel), Outcome::ok) << why_;
  EXPECT_EQ(port.rs485_flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND | SER_RS485_TERMINATE_BUS);
  EXPECT_EQ(request().progress, Progress::answered);
  EXPECT_THAT(port.calls, ElementsAre("write 8"));
  bus_.reset();
  ASSERT_EQ(connect(Rs485Direction::kernel, RtsState::released), Outcome::ok) << why_;
  EXPECT_EQ(port.rs485_flags,
            SER_RS485_ENABLED | SER_RS485_RTS_AFTER_SEND | SER_RS485_TERMINATE_BUS);
}

TEST_F(Rs485, KernelWithoutReadableSettingsIsSetUp) {
  port.errors["get"] = {ENOTTY};
  ASSERT_EQ(connect(Rs485Direction::kernel), Outcome::ok) << why_;
  EXPECT_EQ(port.rs485_flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
}

TEST_F(Rs485, DriverThatDoesNotSwitchIsRefused) {
  for (const int error : {ENOTTY, EINVAL}) {
    port.errors["set"] = {error};
    EXPECT_EQ(connect(Rs485Direction::kernel), Outcome::needs_attention);
    EXPECT_THAT(why_,
                AllOf(HasSubstr(settings_.port + ": "), HasSubstr("TIOCSRS485"),
                      HasSubstr("RTS asserted while sending"), HasSubstr(std::strerror(error)),
                      HasSubstr("direction = \"rts\""), HasSubstr("direction = \"automatic\"")));
  }
  port.errors["set"] = {EIO};
  EXPECT_EQ(connect(Rs485Direction::kernel), Outcome::lost);
  EXPECT_THAT(why_, HasSubstr("unplug the adapter"));
}

// The kernel corrects flags that a driver does not support instead of refusing them.
TEST_F(Rs485, DriverThatUsesTheOtherStateOfRtsIsRefused) {
  port.fixed_flags = SER_RS485_RTS_ON_SEND;
  ASSERT_EQ(connect(Rs485Direction::kernel), Outcome::ok) << why_;
  bus_.reset();
  EXPECT_EQ(connect(Rs485Direction::kernel, RtsState::released), Outcome::needs_attention);
  EXPECT_THAT(why_, HasSubstr("RTS released while sending"));
}

}  // namespace
}  // namespace stickslip::emulated
