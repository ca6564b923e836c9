// Every check of `stickslip doctor`: a question to the host, held against what the rig needs.
#pragma once

#include <string>
#include <vector>

#include "tools/doctor/finding.h"
#include "tools/doctor/host.h"
#include "tools/doctor/needs.h"

namespace stickslip::doctor {

// Telemetry: does LCM carry what the rig publishes, and does it stay on this host?
Finding check_lcm_url(const Needs& needs);
Finding check_loopback(const Host& host);
Finding check_lcm_route(const Host& host, const Needs& needs);
Finding check_receive_buffer(const Host& host, const Needs& needs);
Finding check_lcm_round_trip(const Host& host, const Needs& needs);
Finding check_lcm_queue(const Needs& needs);

// Places: who may command the rig, reach its devices, write its recordings?
Finding check_group(const Host& host);
Finding check_runtime_folder(const Host& host, const Needs& needs);
Finding check_control_socket(const Host& host, const Needs& needs);
Finding check_udev_rules(const Host& host, const Needs& needs);
Finding check_usb(const Host& host, const Needs& needs);
Finding check_hid(const Host& host);
Finding check_gpio(const Host& host, const Needs& needs);
Finding check_recording_space(const Host& host, const Needs& needs);
Finding check_recording_speed(const Host& host, const Needs& needs);

// Time: is the loop on time?
Finding check_real_time_priority(const Host& host, const Needs& needs);
Finding check_locked_memory(const Host& host, const Needs& needs);
Finding check_processor_sleep(const Host& host);
Finding check_real_time_share(const Host& host);
Finding check_kernel(const Host& host);
Finding check_governor(const Host& host);
Finding check_isolated_processors(const Host& host);
Finding check_clock_source(const Host& host);
Finding check_virtual_machine(const Host& host);
/// `remedies`: findings that may be the cause; the command of the first that has one is the cure.
Finding check_wakeups(const Wakeups& wakeups, const Needs& needs,
                      const std::vector<Finding>& remedies);
Finding check_wall_clock(const Host& host);
Finding check_clock_steps(const Wakeups& wakeups);

/// All of them, in the order in which a person would mend them.
std::vector<Finding> examine(const Host& host, const Needs& needs);

/// The worst of them.
Verdict worst(const std::vector<Finding>& findings);

}  // namespace stickslip::doctor
