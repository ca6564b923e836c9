// SPDX-License-Identifier: Apache-2.0
#include "drivers/bench/output_checks.h"

#include "config/readback.h"

namespace stickslip::drivers {

namespace {

// A contact that bounces reads as something between off, 0, and on, 1.
constexpr double contact_tolerance = 0.25;

ReadbackCheck check_of(double delay_s, double tolerance) {
  return ReadbackCheck({static_cast<std::int64_t>(delay_s * 1e9), tolerance});
}

}  // namespace

OutputChecks::OutputChecks(const config::Bench& bench, double rate_hz) : settings_(bench.readback) {
  if (settings_.drive) {
    const config::ReadbackLimits limits = config::drive_readback_limits(bench, rate_hz);
    drive_ = check_of(limits.delay_s, limits.tolerance_v);
  }
  if (settings_.enable) {
    const config::ReadbackLimits limits = config::enable_readback_limits(bench, rate_hz);
    enable_ = check_of(limits.delay_s, contact_tolerance);
  }
}

void OutputChecks::restart() {
  if (drive_) drive_->restart();
  if (enable_) enable_->restart();
}

void OutputChecks::command(double drive_v, bool amplifier_on, std::int64_t time_ns) {
  if (drive_) drive_->command(settings_.drive->offset_v + settings_.drive->gain * drive_v, time_ns);
  if (enable_) enable_->command(amplifier_on ? 1.0 : 0.0, time_ns);
}

void OutputChecks::read(const OutputReadings& readings, std::int64_t time_ns) {
  if (drive_ && readings.drive_v) drive_->reading(*readings.drive_v, time_ns);
  if (!enable_ || !readings.enable_v) return;
  const bool high = *readings.enable_v > settings_.enable->on_above_v;
  enable_->reading(high != settings_.enable->active_low ? 1.0 : 0.0, time_ns);
}

DifferingOutput OutputChecks::differing() const {
  const auto of = [](const char* name, const ReadbackCheck& check, const char* unit) {
    const ReadbackCheck::Difference& found = check.difference();
    return DifferingOutput{name, found.reading, found.low, found.high, unit};
  };
  if (enable_ && enable_->differs()) {
    return of("the amplifier's enable contact (1: on)", *enable_, "");
  }
  if (drive_ && drive_->differs()) return of("the drive", *drive_, " V");
  return {};
}

}  // namespace stickslip::drivers
