// SPDX-License-Identifier: Apache-2.0
#include "tools/doctor/requirements.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include "config/settings.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"

namespace stickslip::doctor {

namespace {

std::vector<ModbusLine> modbus_lines_of(const config::Bench& bench) {
  std::vector<ModbusLine> lines;
  for (const config::ModbusUnit& unit : bench.modbus) {
    if (unit.transport != config::ModbusTransport::rtu) continue;
    const auto same = std::find_if(lines.begin(), lines.end(), [&unit](const ModbusLine& line) {
      return line.port == unit.port;
    });
    if (same == lines.end()) {
      lines.push_back({unit.port, unit.poll_period_s});
    } else {
      same->poll_period_s = std::min(same->poll_period_s, unit.poll_period_s);
    }
  }
  return lines;
}

std::optional<NetworkBoard> network_board_of(const config::Bench& bench) {
  if (bench.board != config::BoardKind::labjack_t7) return std::nullopt;
  return NetworkBoard{"LabJack T7", bench.labjack_t7.host, bench.labjack_t7.port};
}

/// True if a device is on USB, a serial line or a GPIO chip.
bool uses_buses(const config::Bench& bench) {
  const config::BenchInputs bridge = config::inputs_of(bench.inputs, "phidget_bridge");
  return !network_board_of(bench) || bench.amplifier || !bench.gauges.empty() ||
         std::any_of(bridge.begin(), bridge.end(), [](const auto& input) { return !!input; });
}

}  // namespace

std::size_t Requirements::block_bytes() const {
  const std::vector<Frame> frames(static_cast<std::size_t>(frames_per_block));
  frame_block_t block{};
  protocol::to_block(frames, block);
  // Header of LCM: magic number, counter and channel name.
  return static_cast<std::size_t>(block.getEncodedSize()) + 8 +
         std::string_view(protocol::frames_channel).size() + 1;
}

double Requirements::recorded_bytes_per_s() const {
  // The factor covers the estimate with its covariance, the excitation and the headers of the log.
  return 2.5 * static_cast<double>(block_bytes()) * rate_hz / frames_per_block;
}

Requirements default_requirements(const std::string& lcm_url) {
  Requirements required;
  required.lcm_url = lcm_url;
  return required;
}

Requirements requirements_of(const config::Rig& rig) {
  const std::vector<config::Setting> settings = config::settings_of(rig);
  Requirements required;
  required.config_file = rig.file.string();
  required.publishes = rig.lcm.enabled;
  required.lcm_url = rig.lcm.url;
  required.rate_hz = rig.loop.rate_hz;
  required.frames_per_block = rig.loop.frames_per_block;
  required.real_time = rig.loop.real_time_scheduling;
  const std::string driver = config::plain_text(settings, "driver.kind");
  required.hardware = driver != "simulated" && driver != "replay";
  if (rig.driver == config::DriverKind::bench) {
    required.hardware = uses_buses(rig.bench);
    required.network_board = network_board_of(rig.bench);
    required.modbus_lines = modbus_lines_of(rig.bench);
  }
  required.records = rig.recording.enabled;
  if (rig.recording.enabled) {
    required.recording_folder =
        rig.recording.file.has_parent_path() ? rig.recording.file.parent_path() : ".";
  }
  const std::string socket = config::plain_text(settings, "control.socket");
  if (!socket.empty()) required.control_socket = socket;
  return required;
}

}  // namespace stickslip::doctor
