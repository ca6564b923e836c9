// SPDX-License-Identifier: Apache-2.0
// All devices of a bench on the buses of this (virtual) machine, measuring one simulated rig: a
// LabJack U6, a PhidgetBridge and a CP2112 on the kernel's USB, an LVDT conditioner on a serial
// line, and the amplifier's Modbus port on loopback TCP.
//
//   bench_devices RIG.toml FOLDER     simulates the rig's truth
//
// FOLDER receives `line` (the serial line), `ports.json`, and `truth`, rows of a time [ns] and six
// channels, one every half millisecond. Commands are lines on standard input, replies are lines on
// standard output:
//   unplug|plug u6|bridge|gpio|lvdt|amplifier     hang|pull gpio     press|release     fault|repair
//   state     quit
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>

#include "config/rig.h"
#include "drivers/clock/host_clock.h"
#include "tests/emulated/cp2112/emulated_cp2112.h"
#include "tests/emulated/kernel_bus/usbip_server.h"
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"
#include "tests/emulated/modbus/emulated_modbus_units.h"
#include "tests/emulated/phidget_bridge/emulated_phidget_bridge.h"
#include "tests/emulated/plant/simulated_plant.h"

namespace stickslip::emulated {
namespace {

constexpr config::ShakerOutput shaker{
    .volts_per_unit = 150.0, .rest_v = 2.5, .low_v = 0.05, .high_v = 4.95};

std::int64_t now_ns() { return drivers::MonotonicHostClock().now_ns(); }

/// The amplifier runs only while all contacts in its circuit are closed.
class Circuit {
 public:
  explicit Circuit(SimulatedPlant& plant) : plant_(plant) {}
  void close(std::size_t contact, bool closed, std::int64_t time_ns) {
    const std::lock_guard lock(mutex_);
    closed_[contact] = closed;
    plant_.enable(closed_[0] && closed_[1], time_ns);
  }

 private:
  SimulatedPlant& plant_;
  std::mutex mutex_;
  std::array<bool, 2> closed_{};
};

/// Connection of a device to the plant.
class Wiring final : public Wires {
 public:
  Wiring(SimulatedPlant& plant, Circuit& circuit, std::size_t contact)
      : plant_(plant), circuit_(circuit), contact_(contact) {}
  double truth(Channel channel, std::int64_t time_ns) override {
    return plant_.truth(channel, time_ns);
  }
  void drive(double volts, std::int64_t time_ns) override { plant_.drive(volts, time_ns); }
  void enable(bool on, std::int64_t time_ns) override { circuit_.close(contact_, on, time_ns); }
  bool amplifier_fault() const override { return plant_.amplifier_fault(); }
  bool emergency_stop() const override { return plant_.emergency_stop(); }

 private:
  SimulatedPlant& plant_;
  Circuit& circuit_;
  std::size_t contact_;
};

/// Records the true channels, slightly delayed.
class TruthWriter {
 public:
  TruthWriter(SimulatedPlant& plant, const std::filesystem::path& file, std::int64_t begin_ns)
      : plant_(plant),
        out_(file, std::ios::binary),
        next_ns_(begin_ns),
        thread_([this] { run(); }) {}
  ~TruthWriter() {
    stopping_ = true;
    thread_.join();
  }
  TruthWriter(const TruthWriter&) = delete;
  TruthWriter& operator=(const TruthWriter&) = delete;

 private:
  void run() {
    constexpr std::int64_t step_ns = 500'000;
    constexpr std::int64_t behind_ns = 50'000'000;
    while (!stopping_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      for (const std::int64_t end_ns = now_ns() - behind_ns; next_ns_ < end_ns;
           next_ns_ += step_ns) {
        struct Row {
          std::int64_t time_ns;
          double value[channel_count];
        } row{};
        row.time_ns = next_ns_;
        const Frame truth = plant_.truth(next_ns_);
        for (const Channel channel : all_channels) row.value[index_of(channel)] = truth[channel];
        out_.write(reinterpret_cast<const char*>(&row), sizeof row);
      }
      out_.flush();
    }
  }

  SimulatedPlant& plant_;
  std::ofstream out_;
  std::int64_t next_ns_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

/// Unplugs during a transfer: the worst moment, which random timing rarely hits. A
/// chip without a transfer for a second is unplugged anyway.
void unplug_during_transfer(UsbipServer& port) {
  port.hang();
  const std::int64_t end_ns = now_ns() + 1'000'000'000;
  while (port.plugged() && !port.has_unserved_request() && now_ns() < end_ns) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  port.unplug();
}

/// All devices of the bench, wired to one simulated plant and attached to the buses of this host.
class Bench {
 public:
  Bench(const std::filesystem::path& rig_file, const std::filesystem::path& folder)
      : begin_ns_(now_ns()),
        plant_(config::load_rig(rig_file).simulated, shaker, begin_ns_),
        board_(board_wiring_, now_ns, board_options()),
        bridge_(bridge_options(), board_wiring_, now_ns),
        units_(now_ns, folder, 1) {
    board_.wire(0, {Channel::displacement, 400.0, 0.0});
    board_.wire(1, {Channel::velocity, 20.0, 0.0});
    add_units();
    units_.start();
    std::ofstream(folder / "ports.json") << R"({"serial": ")" << units_.serial_port()
                                         << R"(", "tcp": ")" << units_.tcp_port() << "\"}\n";
    for (UsbipServer* port : {&board_port_, &bridge_port_, &gpio_port_}) port->plug();
    truth_.emplace(plant_, folder / "truth", begin_ns_);
  }

  /// Executes a command of one or two words. False: unknown.
  bool execute(const std::string& word, const std::string& device) {
    if (word == "plug" || word == "unplug") return set_plugged(device, word == "plug");
    if (word == "hang" && device == "gpio") {
      gpio_port_.hang();
    } else if (word == "pull" && device == "gpio") {
      unplug_during_transfer(gpio_port_);
      circuit_.close(1, false, now_ns());
    } else if (word == "press" || word == "release") {
      plant_.press_emergency_stop(word == "press");
    } else if (word == "fault" || word == "repair") {
      plant_.set_amplifier_fault(word == "fault");
    } else {
      return word == "state";
    }
    return true;
  }

  void print_state() {
    std::cout << R"({"now_ns": )" << now_ns() << R"(, "enabled": )"
              << (plant_.enabled() ? "true" : "false") << R"(, "enabled_since_ns": )"
              << plant_.enabled_since_ns() << R"(, "heartbeats": )" << gpio_.heartbeats()
              << R"(, "drives": )" << plant_.drives() << R"(, "scans_lost": )"
              << board_.scans_lost() << R"(, "limit": )" << units_.written(2, Table::holding, 10)
              << "}" << std::endl;
  }

 private:
  static LabjackU6Options board_options() {
    LabjackU6Options options;
    options.enable_line = 0;
    options.crystal_error_ppm = 30.0;
    return options;
  }

  static EmulatedPhidgetBridge::Options bridge_options() {
    EmulatedPhidgetBridge::Options options;
    options.sensors[0] = Sensor{Channel::friction_force, 1.0e-3, 2.0e-4};
    options.sensors[1] = Sensor{Channel::normal_load, 1.0e-3, -1.0e-4};
    options.noise_v_per_v = 1.0e-7;
    return options;
  }

  /// Unit 1: the LVDT conditioner; unit 2: the amplifier's Modbus port.
  void add_units() {
    Parameter position;
    position.kind = Kind::f32;
    position.address = 8000;
    Parameter status;
    status.address = 2;
    units_.add(
        1, orbit_rules(),
        {measured(position, {Channel::base_displacement, 1000.0, 0.0}, board_wiring_), status});
    Parameter limit;
    limit.address = 10;
    Parameter alarm;
    alarm.address = 11;
    alarm.number = [this](std::int64_t) { return plant_.amplifier_fault() ? 7.0 : 0.0; };
    units_.add(2, {}, {limit, alarm});
  }

  bool set_plugged(const std::string& device, bool in) {
    const auto set = [in](auto& port) { in ? port.plug() : port.unplug(); };
    if (device == "u6") {
      set(board_port_);
    } else if (device == "bridge") {
      set(bridge_port_);
    } else if (device == "gpio") {
      set(gpio_port_);
    } else if (device == "lvdt") {
      in ? units_.plug_in() : units_.unplug();
    } else if (device == "amplifier") {
      units_.dead(2, !in);
    } else {
      return false;
    }
    // The lines of a board without power are low.
    if (!in && device == "u6") circuit_.close(0, false, now_ns());
    if (!in && device == "gpio") circuit_.close(1, false, now_ns());
    return true;
  }

  std::int64_t begin_ns_;
  SimulatedPlant plant_;
  Circuit circuit_{plant_};
  Wiring board_wiring_{plant_, circuit_, 0};
  Wiring gpio_wiring_{plant_, circuit_, 1};
  EmulatedLabjackU6 board_;
  EmulatedPhidgetBridge bridge_;
  EmulatedCp2112 gpio_{
      gpio_wiring_, now_ns, {.enable = 0, .fault = 1, .emergency_stop = 2, .heartbeat = 3}};
  EmulatedModbusUnits units_;
  UsbipServer board_port_{board_, 0};
  UsbipServer bridge_port_{bridge_, 1};
  UsbipServer gpio_port_{gpio_, 2, 500};  // it transmits on request only
  std::optional<TruthWriter> truth_;
};

int run(const std::filesystem::path& rig_file, const std::filesystem::path& folder) {
  if (!UsbipServer::available()) {
    std::fprintf(stderr, "bench_devices: no virtual USB controller (modprobe vhci-hcd, as root)\n");
    return 77;
  }
  Bench bench(rig_file, folder);
  std::cout << "ready" << std::endl;
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string word;
    std::string device;
    words >> word >> device;
    if (word == "quit") break;
    if (bench.execute(word, device)) {
      bench.print_state();
    } else {
      std::cout << "unknown: " << line << std::endl;
    }
  }
  return 0;
}

}  // namespace
}  // namespace stickslip::emulated

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: bench_devices RIG.toml FOLDER\n");
    return 2;
  }
  try {
    return stickslip::emulated::run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_devices: %s\n", error.what());
    return 1;
  }
}
