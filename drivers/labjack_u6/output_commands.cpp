// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/output_commands.h"

#include "drivers/labjack_u6/protocol.h"

namespace stickslip::drivers::labjack_u6 {

labjack::OutputRules output_rules(const config::LabjackU6& settings) {
  labjack::OutputRules rules;
  rules.reads_lines = settings.amplifier_fault_line || settings.emergency_stop_line;
  rules.watchdog_s = settings.has_watchdog() ? settings.watchdog_s : 0;
  rules.max_transit_ns = std::int64_t{send_timeout_ms} * 1'000'000;
  return rules;
}

bool OutputCommands::send_output(Slot slot, labjack::SetPoint set_point, bool on,
                                 std::int64_t now_ns) {
  const auto counts = static_cast<std::uint16_t>(set_point);
  Feedback feedback(++echo_);
  if (on) feedback.dac(settings_.dac, counts);
  if (settings_.enable_line) feedback.set_line(*settings_.enable_line, on);
  if (!on) feedback.dac(settings_.dac, counts);
  return session_.send(slot, feedback.read_lines().command(), echo_, now_ns);
}

bool OutputCommands::send_request_of_lines(std::int64_t now_ns) {
  Feedback feedback(++echo_);
  return session_.send(Slot::lines, feedback.read_lines().command(), echo_, now_ns);
}

const char* OutputCommands::reason(const Progress& failed) const {
  const Verdict verdict = unpacked(failed.verdict);
  switch (verdict.kind) {
    case Verdict::Kind::error:
      return error_name(verdict.code);
    case Verdict::Kind::checksum:
      return "the reply was corrupted";
    case Verdict::Kind::refused:
      return "the command was corrupted";
    default:
      return "the command could not be sent, or the reply has an unexpected format";
  }
}

}  // namespace stickslip::drivers::labjack_u6
