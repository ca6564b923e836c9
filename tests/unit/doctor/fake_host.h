// SPDX-License-Identifier: Apache-2.0
// A simulated machine. Every check passes on its default state.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "tools/doctor/examination.h"

namespace stickslip::doctor {

inline Entry entry(Entry::Kind kind, unsigned mode = 0755, const std::string& owner = "stickslip") {
  return {kind, mode, owner, owner, true, true, true};
}

class FakeHost final : public Host {
 public:
  std::map<std::string, std::string> files = {
      {"/proc/sys/net/core/rmem_max", "2097152"},
      {"/proc/sys/kernel/sched_rt_runtime_us", "950000"},
      {"/proc/sys/kernel/sched_rt_period_us", "1000000"},
      {"/proc/cpuinfo", "flags : fpu tsc"},
      {"/proc/stat", "cpu  10 0 10 980 0 0 0 0 0 0\ncpu0 10 0 10 980 0 0 0 0 0 0"},
      {"/sys/kernel/realtime", "1"},
      {"/sys/devices/system/cpu/isolated", "3"},
      {"/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance"},
      {"/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance"},
      {"/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc"},
      {"/sys/devices/system/clocksource/clocksource0/available_clocksource", "tsc hpet acpi_pm"},
      {"/sys/bus/usb/devices/1-2/idVendor", "0cd5"},
      {"/sys/bus/usb/devices/1-2/idProduct", "0006"},
      {"/sys/bus/usb/devices/1-2/busnum", "1"},
      {"/sys/bus/usb/devices/1-2/devnum", "12"},
      {"/sys/class/hidraw/hidraw0/device/uevent", "HID_ID=0003:000006C2:0000003B\nHID_NAME=P"},
      {"/sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "1"},
      {"/usr/lib/udev/rules.d/70-stickslip.rules", "... ATTR{latency_timer}=\"1\""},
  };
  std::map<std::string, std::vector<std::string>> folders = {
      {"/sys/devices/system/cpu", {"cpu0", "cpu1", "cpufreq", "cpuidle", "isolated"}},
      {"/sys/bus/usb/devices", {"1-2", "usb1"}},
      {"/sys/class/hidraw", {"hidraw0"}},
      {"/sys/bus/usb-serial/devices", {"ttyUSB0", "ttyUSB1"}},
      {"/dev", {"gpiochip0", "null"}},
      {"/usr/lib/udev/rules.d", {"50-udev-default.rules", "70-stickslip.rules"}},
  };
  std::map<std::string, Entry> entries = {
      {"/run/stickslip", entry(Entry::Kind::folder)},
      {"/run/stickslip/control.sock", entry(Entry::Kind::socket, 0660)},
      {"/var/lib/stickslip/recordings", entry(Entry::Kind::folder)},
      {"/dev/bus/usb", entry(Entry::Kind::folder)},
      {"/dev/bus/usb/001/012", entry(Entry::Kind::device, 0660)},
      {"/dev/hidraw0", entry(Entry::Kind::device, 0660)},
      {"/dev/gpiochip0", entry(Entry::Kind::device, 0660)},
      {"/usr/bin/timedatectl", entry(Entry::Kind::file)},
  };
  std::map<std::string, std::string> links = {
      {"/dev/serial/by-id/usb-FTDI_FT232R_A1-if00-port0", "/dev/ttyUSB0"}};
  Attempt opened{true, 0, ""};
  Attempt connected{true, 0, ""};
  Attempt reached{true, 0, ""};
  Attempt prioritised{true, 0, ""};
  Attempt locked{true, 0, ""};
  Caller who{"ada", false, {"ada", "stickslip"}};
  bool group = true;
  Kernel running{"6.1.0-18-rt-amd64", "#1 SMP PREEMPT_RT Debian", "x86_64"};
  std::int64_t priority_limit = 50;
  std::int64_t memory_limit = -1;
  std::optional<bool> loopback = true;
  Route route{true, "lo", ""};
  std::size_t held = 1000;
  RoundTrip trip{true, "", 20, 20, 80'000, 300'000};
  Wakeups woken{true, 1000, 8'000, 30'000, 90'000, 20'000};
  std::optional<std::uint64_t> free = 500'000'000'000;
  WriteSpeed speed{{true, 0, ""}, 200e6, 8'000'000};
  std::optional<WallClock> wall = WallClock{true, 1500};
  mutable std::string probed_url;
  mutable int asked_receive_buffer = -1;

  std::optional<std::string> read(const std::filesystem::path& file) const override {
    const auto found = files.find(file.string());
    if (found == files.end()) return std::nullopt;
    return found->second;
  }
  std::vector<std::string> names_in(const std::filesystem::path& folder) const override {
    const auto found = folders.find(folder.string());
    return found == folders.end() ? std::vector<std::string>{} : found->second;
  }
  std::filesystem::path resolved(const std::filesystem::path& path) const override {
    const auto found = links.find(path.string());
    return found == links.end() ? path : std::filesystem::path(found->second);
  }
  Entry entry_at(const std::filesystem::path& path) const override {
    const auto found = entries.find(path.string());
    return found == entries.end() ? Entry{} : found->second;
  }
  Attempt open_for_writing(const std::filesystem::path&) const override { return opened; }
  Attempt connect_to(const std::filesystem::path&) const override { return connected; }
  Attempt reach(const std::string&, int) const override { return reached; }
  Caller caller() const override { return who; }
  bool group_exists(const std::string&) const override { return group; }
  Kernel kernel() const override { return running; }
  std::int64_t limit(Limit which) const override {
    return which == Limit::real_time_priority ? priority_limit : memory_limit;
  }
  std::optional<bool> interface_up(const std::string&) const override { return loopback; }
  Route route_to(const std::string&) const override { return route; }
  std::size_t receive_buffer_messages(std::size_t, int receive_buffer_bytes) const override {
    asked_receive_buffer = receive_buffer_bytes;
    return held;
  }
  RoundTrip lcm_round_trip(const std::string& url, std::size_t) const override {
    probed_url = url;
    return trip;
  }
  Attempt take_real_time_priority(int) const override { return prioritised; }
  Attempt lock_memory() const override { return locked; }
  Wakeups measure_wakeups(double, double) const override { return woken; }
  std::optional<std::uint64_t> free_bytes(const std::filesystem::path&) const override {
    return free;
  }
  WriteSpeed measure_writing(const std::filesystem::path&) const override { return speed; }
  std::optional<WallClock> wall_clock() const override { return wall; }
};

inline Requirements some_requirements() {
  return default_requirements("udpm://239.255.76.67:7667?ttl=0");
}

inline Requirements hardware_requirements() {
  Requirements required = some_requirements();
  required.config_file = "rig.toml";
  required.hardware = true;
  required.records = true;
  return required;
}

/// Matches the verdict and a part of the result.
inline testing::Matcher<const Finding&> is(Verdict verdict, const std::string& part) {
  return testing::AllOf(testing::Field("verdict", &Finding::verdict, verdict),
                        testing::Field("found", &Finding::found, testing::HasSubstr(part)));
}

inline testing::Matcher<const Finding&> passes() {
  return testing::AllOf(testing::Field("verdict", &Finding::verdict, Verdict::ok),
                        testing::Field("command", &Finding::command, ""));
}

inline testing::Matcher<const Finding&> remedied_by(const std::string& command) {
  return testing::Field("command", &Finding::command, command);
}

}  // namespace stickslip::doctor
