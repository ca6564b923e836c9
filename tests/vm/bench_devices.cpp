// All devices of a bench on the buses of this (virtual) machine, with one rig of equations behind
// them: a LabJack U6, a PhidgetBridge and a CP2112 on the kernel's USB, an LVDT conditioner on a
// serial line, and the amplifier's own Modbus port on loopback TCP.
//
//   bench_devices RIG.toml FOLDER     the rig's truth is what moves
//
// FOLDER gets `line` (the serial line), `ports.json`, and `truth`, rows of a time [ns] and six
// channels, one every half millisecond. Commands come by lines on standard input, answers go by
// lines to standard output:
//   unplug|plug u6|bridge|gpio|lvdt|amplifier     hang|pull gpio     press|release     fault|mend
//   state     quit
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>

#include "config/rig.h"
#include "drivers/host_clock.h"
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

/// What one device is wired to.
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

/// Writes down what really happened, a little behind the present.
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

/// The worst moment to unplug, which chance finds once in some dozens. A chip that nobody asks
/// anything for a second is pulled all the same.
void pull_in_mid_transfer(UsbipServer& port) {
  port.hang();
  const std::int64_t end_ns = now_ns() + 1'000'000'000;
  while (port.plugged() && !port.asked_in_vain() && now_ns() < end_ns) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  port.unplug();
}

int run(const std::filesystem::path& rig_file, const std::filesystem::path& folder) {
  if (!UsbipServer::available()) {
    std::fprintf(stderr, "bench_devices: no virtual USB controller (modprobe vhci-hcd, as root)\n");
    return 77;
  }
  const std::int64_t begin_ns = now_ns();
  SimulatedPlant plant(config::load_rig(rig_file).simulated, shaker, begin_ns);
  Circuit circuit(plant);
  Wiring of_board(plant, circuit, 0);
  Wiring of_gpio(plant, circuit, 1);

  LabjackU6Options board_options;
  board_options.enable_line = 0;
  board_options.crystal_error_ppm = 30.0;
  EmulatedLabjackU6 board(of_board, now_ns, board_options);
  board.wire(0, {Channel::displacement, 400.0, 0.0});
  board.wire(1, {Channel::velocity, 20.0, 0.0});

  EmulatedPhidgetBridge::Options bridge_options;
  bridge_options.sensors[0] = Sensor{Channel::friction_force, 1.0e-3, 2.0e-4};
  bridge_options.sensors[1] = Sensor{Channel::normal_load, 1.0e-3, -1.0e-4};
  bridge_options.noise_v_per_v = 1.0e-7;
  EmulatedPhidgetBridge bridge(bridge_options, of_board, now_ns);

  EmulatedCp2112 gpio(of_gpio, now_ns,
                      {.enable = 0, .fault = 1, .emergency_stop = 2, .heartbeat = 3});

  EmulatedModbusUnits units(now_ns, folder, 1);
  Parameter position;
  position.kind = Kind::f32;
  position.address = 8000;
  Parameter status;
  status.address = 2;
  units.add(1, orbit_rules(),
            {measured(position, {Channel::base_displacement, 1000.0, 0.0}, of_board), status});
  Parameter limit;
  limit.address = 10;
  Parameter alarm;
  alarm.address = 11;
  alarm.number = [&plant](std::int64_t) { return plant.amplifier_fault() ? 7.0 : 0.0; };
  units.add(2, {}, {limit, alarm});
  units.start();
  std::ofstream(folder / "ports.json") << R"({"serial": ")" << units.serial_port()
                                       << R"(", "tcp": ")" << units.tcp_port() << "\"}\n";

  UsbipServer board_port(board, 0);
  UsbipServer bridge_port(bridge, 1);
  UsbipServer gpio_port(gpio, 2, 500);  // it never speaks by itself
  for (UsbipServer* port : {&board_port, &bridge_port, &gpio_port}) port->plug();
  const TruthWriter truth(plant, folder / "truth", begin_ns);

  const std::map<std::string, std::function<void(bool)>> plugs = {
      {"u6", [&](bool in) { in ? board_port.plug() : board_port.unplug(); }},
      {"bridge", [&](bool in) { in ? bridge_port.plug() : bridge_port.unplug(); }},
      {"gpio", [&](bool in) { in ? gpio_port.plug() : gpio_port.unplug(); }},
      {"lvdt", [&](bool in) { in ? units.plug_in() : units.unplug(); }},
      {"amplifier", [&](bool in) { units.dead(2, !in); }},
  };
  std::cout << "ready" << std::endl;
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string word;
    std::string which;
    words >> word >> which;
    if (word == "quit") break;
    if ((word == "plug" || word == "unplug") && plugs.contains(which)) {
      plugs.at(which)(word == "plug");
      // A board without power lets its lines go.
      if (word == "unplug" && which == "u6") circuit.close(0, false, now_ns());
      if (word == "unplug" && which == "gpio") circuit.close(1, false, now_ns());
    } else if (word == "hang" && which == "gpio") {
      gpio_port.hang();
    } else if (word == "pull" && which == "gpio") {
      pull_in_mid_transfer(gpio_port);
      circuit.close(1, false, now_ns());
    } else if (word == "press" || word == "release") {
      plant.press_emergency_stop(word == "press");
    } else if (word == "fault" || word == "mend") {
      plant.set_amplifier_fault(word == "fault");
    } else if (word != "state") {
      std::cout << "unknown: " << line << std::endl;
      continue;
    }
    std::cout << R"({"now_ns": )" << now_ns() << R"(, "enabled": )"
              << (plant.enabled() ? "true" : "false") << R"(, "enabled_since_ns": )"
              << plant.enabled_since_ns() << R"(, "heartbeats": )" << gpio.heartbeats()
              << R"(, "drives": )" << plant.drives() << R"(, "scans_lost": )" << board.scans_lost()
              << R"(, "limit": )" << units.written(2, Table::holding, 10) << "}" << std::endl;
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
