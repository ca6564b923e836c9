// SPDX-License-Identifier: Apache-2.0
// State of the daemon at one moment, as it is published, recorded and logged.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/ledger.h"
#include "daemon/loop.h"
#include "daemon/message_writer.h"
#include "daemon/safety.h"
#include "daemon/timing.h"
#include "diagnosis/live_check.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

struct Status {
  RigState state = RigState::faulted;
  Interlock interlock = Interlock::none;  ///< of a fault
  std::string cause;
  bool amplifier_on = false;
  std::int64_t uptime_ns = 0;
  Balance ledger;
  std::uint64_t cycles = 0;
  std::uint64_t overruns = 0;
  std::uint64_t late_cycles = 0;
  std::uint64_t skipped_periods = 0;
  std::int64_t longest_overrun_ns = 0;
  bool degraded = false;             ///< late cycles since the previous status
  std::uint64_t lateness_count = 0;  ///< wake-ups counted; 0 unless paced by deadlines
  std::uint64_t lateness_total_ns = 0;
  std::int64_t lateness_mean_ns = 0;
  std::int64_t lateness_p50_ns = 0;  ///< of the wake-up; 0 unless paced by deadlines
  std::int64_t lateness_p99_ns = 0;
  std::int64_t lateness_max_ns = 0;
  std::uint64_t work_count = 0;  ///< cycles counted
  std::uint64_t work_total_ns = 0;
  std::int64_t work_mean_ns = 0;
  std::int64_t work_p50_ns = 0;  ///< of a cycle
  std::int64_t work_p99_ns = 0;
  std::int64_t work_max_ns = 0;
  std::int64_t read_p50_ns = 0;  ///< of a read of the device
  std::int64_t read_p99_ns = 0;
  std::int64_t read_max_ns = 0;
  std::uint64_t missing_at_source = 0;
  std::uint64_t repeated = 0;
  std::uint64_t not_finite = 0;
  std::uint64_t failed_reads = 0;
  std::uint64_t failed_writes = 0;
  drivers::Counts devices;                      ///< the devices' own counts
  std::optional<diagnosis::LiveVerdict> model;  ///< of the live model check; absent: off
  bool recording_failing = false;               ///< frames are being lost by the recording
  std::optional<RecordingProgress> recording;   ///< absent: nothing is recorded
  std::optional<std::uint64_t> free_bytes;      ///< on the disk of the recording
  std::uint64_t lost_messages = 0;              ///< events, estimates and status messages
};

/// Present values; the loop may be running.
Status status_of(const Snapshot& rig, const Ledger& ledger, const Timing& timing);

/// Ledger and timing in a few lines of text.
std::string text(const Status& status);

}  // namespace stickslip::daemon
