// SPDX-License-Identifier: Apache-2.0
#include "tools/doctor/examination.h"

#include <algorithm>

namespace stickslip::doctor {

std::vector<Finding> run_checks(const Host& host, const Requirements& required) {
  const Finding priority = check_real_time_priority(host, required);
  const Finding kernel = check_kernel(host);
  const Finding governor = check_governor(host);
  const Finding sleep = check_processor_sleep(host);
  const Wakeups wakeups = host.measure_wakeups(required.rate_hz, required.latency_duration_s);
  std::vector<Finding> findings = {
      check_loopback(host),
      check_lcm_url(required),
      check_lcm_route(host, required),
      check_receive_buffer(host, required),
      check_lcm_round_trip(host, required),
      check_lcm_queue(required),
      check_group(host),
      check_runtime_folder(host, required),
      check_control_socket(host, required),
      check_udev_rules(host, required),
      check_usb(host, required),
      check_hid(host),
      check_gpio(host, required),
  };
  if (required.network_board) {
    findings.push_back(check_network_board(host, *required.network_board));
  }
  const std::vector<Finding> others = {
      check_serial_latency(host, required),
      priority,
      check_locked_memory(host, required),
      check_real_time_share(host),
      sleep,
      governor,
      kernel,
      check_isolated_processors(host),
      check_clock_source(host),
      check_virtual_machine(host),
      check_wakeups(wakeups, required, {priority, sleep, governor, kernel}),
      check_recording_space(host, required),
      check_recording_speed(host, required),
      check_wall_clock(host),
      check_clock_steps(wakeups),
  };
  findings.insert(findings.end(), others.begin(), others.end());
  return findings;
}

Verdict worst(const std::vector<Finding>& findings) {
  Verdict out = Verdict::ok;
  for (const Finding& each : findings) out = std::max(out, each.verdict);
  return out;
}

}  // namespace stickslip::doctor
