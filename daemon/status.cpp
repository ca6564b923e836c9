// SPDX-License-Identifier: Apache-2.0
#include "daemon/status.h"

#include "physics/number_text.h"

namespace stickslip::daemon {
namespace {

std::string microseconds(std::int64_t ns) { return std::to_string((ns + 500) / 1000); }

}  // namespace

Status status_of(const Snapshot& rig, const Ledger& ledger, const Timing& timing) {
  const auto value = [](const auto& counter) { return counter.load(std::memory_order_relaxed); };
  Status out;
  out.state = rig.state;
  out.interlock = rig.interlock;
  out.cause = rig.cause.c_str();
  out.amplifier_on = rig.amplifier_on;
  out.late_cycles = value(timing.late);
  out.read_p50_ns = timing.read.quantile_ns(0.5);
  out.read_p99_ns = timing.read.quantile_ns(0.99);
  out.read_max_ns = timing.read.longest_ns();
  out.repeated = value(timing.repeated);
  out.ledger = ledger.balance();
  out.cycles = value(timing.cycles);
  out.overruns = value(timing.overruns);
  out.skipped_periods = value(timing.skipped_periods);
  out.longest_overrun_ns = value(timing.longest_overrun_ns);
  out.lateness_count = timing.lateness.count();
  out.lateness_total_ns = timing.lateness.total_ns();
  out.lateness_mean_ns = timing.lateness.mean_ns();
  out.work_count = timing.work.count();
  out.work_total_ns = timing.work.total_ns();
  out.work_mean_ns = timing.work.mean_ns();
  out.lateness_p50_ns = timing.lateness.quantile_ns(0.5);
  out.lateness_p99_ns = timing.lateness.quantile_ns(0.99);
  out.lateness_max_ns = timing.lateness.longest_ns();
  out.work_p50_ns = timing.work.quantile_ns(0.5);
  out.work_p99_ns = timing.work.quantile_ns(0.99);
  out.work_max_ns = timing.work.longest_ns();
  out.missing_at_source = value(timing.missing_at_source);
  out.not_finite = value(timing.not_finite);
  out.failed_reads = value(timing.failed_reads);
  out.failed_writes = value(timing.failed_writes);
  out.lost_messages = value(timing.lost_events);
  return out;
}

std::string text(const Status& status) {
  std::string out = "ledger: " + status.ledger.text();
  for (std::size_t at = out.find('\n'); at != std::string::npos; at = out.find('\n', at + 1)) {
    out.insert(at + 1, "        ");
  }
  if (status.missing_at_source > 0) {
    out +=
        "\n        " + std::to_string(status.missing_at_source) + " more were lost by the source";
  }
  if (status.repeated > 0) {
    out += "\n        " + std::to_string(status.repeated) +
           " were repeated or out of order at the source and were left out";
  }
  if (status.lateness_max_ns > 0 || status.overruns > 0) {
    out += "\ntiming: wake-up late by " + microseconds(status.lateness_p50_ns) + " us (median), " +
           microseconds(status.lateness_p99_ns) + " us (99 %), " +
           microseconds(status.lateness_max_ns) + " us (longest); " +
           physics::counted(status.overruns, "overrun") + ", " +
           physics::counted(status.skipped_periods, "period") + " skipped";
  }
  return out;
}

}  // namespace stickslip::daemon
