// SPDX-License-Identifier: Apache-2.0
// The checks of `stickslip doctor`: properties of the host against the requirements of a rig.
#pragma once

#include <string>
#include <vector>

#include "tools/doctor/finding.h"
#include "tools/doctor/host.h"
#include "tools/doctor/requirements.h"

namespace stickslip::doctor {

// Telemetry: delivery by LCM, confinement to this host.
Finding check_lcm_url(const Requirements& required);
Finding check_loopback(const Host& host);
Finding check_lcm_route(const Host& host, const Requirements& required);
Finding check_receive_buffer(const Host& host, const Requirements& required);
Finding check_lcm_round_trip(const Host& host, const Requirements& required);
Finding check_lcm_queue(const Requirements& required);

// Access: to the control socket, the devices and the recordings.
Finding check_group(const Host& host);
Finding check_runtime_folder(const Host& host, const Requirements& required);
Finding check_control_socket(const Host& host, const Requirements& required);
Finding check_udev_rules(const Host& host, const Requirements& required);
Finding check_usb(const Host& host, const Requirements& required);
Finding check_hid(const Host& host);
Finding check_gpio(const Host& host, const Requirements& required);
/// Only its command port: a board sends its stream to every connection to the other one.
Finding check_network_board(const Host& host, const NetworkBoard& board);
/// Reception by FTDI adapters: of the rig's Modbus lines, without a rig of all that are present.
Finding check_serial_latency(const Host& host, const Requirements& required);
Finding check_recording_space(const Host& host, const Requirements& required);
Finding check_recording_speed(const Host& host, const Requirements& required);

// Timing of the loop.
Finding check_real_time_priority(const Host& host, const Requirements& required);
Finding check_locked_memory(const Host& host, const Requirements& required);
Finding check_processor_sleep(const Host& host);
Finding check_real_time_share(const Host& host);
Finding check_kernel(const Host& host);
Finding check_governor(const Host& host);
Finding check_isolated_processors(const Host& host);
Finding check_clock_source(const Host& host);
Finding check_virtual_machine(const Host& host);
/// `causes`: findings that may explain late wake-ups; the first with a command provides the remedy.
Finding check_wakeups(const Wakeups& wakeups, const Requirements& required,
                      const std::vector<Finding>& causes);
Finding check_wall_clock(const Host& host);
Finding check_clock_steps(const Wakeups& wakeups);

/// All findings, in the order in which problems are best solved.
std::vector<Finding> run_checks(const Host& host, const Requirements& required);

/// Worst verdict; ok for an empty list.
Verdict worst(const std::vector<Finding>& findings);

}  // namespace stickslip::doctor
