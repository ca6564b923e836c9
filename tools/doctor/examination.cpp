#include "tools/doctor/examination.h"

#include <algorithm>

namespace stickslip::doctor {

std::vector<Finding> examine(const Host& host, const Needs& needs) {
  const Finding priority = check_real_time_priority(host, needs);
  const Finding kernel = check_kernel(host);
  const Finding governor = check_governor(host);
  const Finding sleep = check_processor_sleep(host);
  const Wakeups wakeups = host.measure_wakeups(needs.rate_hz, needs.latency_duration_s);
  return {
      check_loopback(host),
      check_lcm_url(needs),
      check_lcm_route(host, needs),
      check_receive_buffer(host, needs),
      check_lcm_round_trip(host, needs),
      check_lcm_queue(needs),
      check_group(host),
      check_runtime_folder(host, needs),
      check_control_socket(host, needs),
      check_udev_rules(host, needs),
      check_usb(host, needs),
      check_hid(host),
      check_gpio(host, needs),
      priority,
      check_locked_memory(host, needs),
      check_real_time_share(host),
      sleep,
      governor,
      kernel,
      check_isolated_processors(host),
      check_clock_source(host),
      check_virtual_machine(host),
      check_wakeups(wakeups, needs, {priority, sleep, governor, kernel}),
      check_recording_space(host, needs),
      check_recording_speed(host, needs),
      check_wall_clock(host),
      check_clock_steps(wakeups),
  };
}

Verdict worst(const std::vector<Finding>& findings) {
  Verdict out = Verdict::ok;
  for (const Finding& each : findings) out = std::max(out, each.verdict);
  return out;
}

}  // namespace stickslip::doctor
