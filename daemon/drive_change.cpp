// SPDX-License-Identifier: Apache-2.0
#include "daemon/drive_change.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

constexpr const char* name = "the drive";

[[noreturn]] void refuse(const std::string& why) { throw InputError(Problem{name, 0, 0, why}); }

DriveFile file_of(const DriveSamples& samples) {
  const std::vector<double>& values = samples.values;
  if (!(samples.period_s >= 1.0e-5 && samples.period_s <= 1.0)) {
    refuse("has a period of " + physics::number_text(samples.period_s, 6) +
           " s: expected 0.00001 to 1");
  }
  if (!std::all_of(values.begin(), values.end(), [](double u) { return std::isfinite(u); })) {
    refuse("has samples that are not finite");
  }
  if (values.front() != 0.0 || values.back() != 0.0) {
    refuse("does not begin and end at rest: expected the samples 0 at both ends");
  }
  std::vector<double> times_s(values.size());
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    times_s[k] = samples.period_s * static_cast<double>(k);
  }
  return DriveFile(std::move(times_s), values, false, name);
}

// Samples begin and end at rest, so that a ramp has nothing to do but after a stop.
config::Excitation settings_of_samples(const config::Excitation& configured) {
  constexpr double longest_ramp_s = 0.2;
  config::Excitation out = configured;
  out.kind = config::ExcitationKind::file;
  out.file = {};
  out.control.enabled = false;
  out.ramp_s = std::min(out.ramp_s, longest_ramp_s);
  return out;
}

}  // namespace

Command DriveChange::propose(const config::Rig& rig, DriveSamples samples) {
  if (proposed_) refuse("is being changed by another command; try again");
  if (!samples.values.empty() && !rig.excitation.enabled) {
    refuse("is off: excitation.enabled is false");
  }
  before_ = configured_ ? *configured_ : rig.excitation;
  if (samples.values.empty()) {
    settings_ = before_;
    proposed_ = std::move(replaced_);
    if (!proposed_) proposed_ = std::make_unique<Excitation>(settings_, driven_rig(rig));
  } else {
    settings_ = settings_of_samples(before_);
    proposed_ = std::make_unique<Excitation>(settings_, driven_rig(rig), file_of(samples), name);
  }
  samples_ = std::move(samples);
  Command out;
  out.kind = Command::Kind::drive;
  out.excitation = proposed_.get();
  return out;
}

std::optional<config::Excitation> DriveChange::finish(const Answer& answer) {
  std::unique_ptr<Excitation> exchanged = std::move(proposed_);
  const bool has_samples = !samples_.values.empty();
  if (!answer.accepted) {
    if (!has_samples && configured_) replaced_ = std::move(exchanged);
    return std::nullopt;
  }
  if (has_samples) {
    if (!configured_) replaced_ = std::move(exchanged);
    configured_ = before_;
  } else {
    configured_.reset();
  }
  return settings_;
}

Event changed_event(const DriveSamples& samples, const Answer& answer) {
  Event out;
  out.code = "drive_changed";
  out.time_ns = answer.time_ns;
  out.sequence = answer.sequence;
  if (samples.values.empty()) {
    out.message = "the drive is the configured one again";
    return out;
  }
  const double length_s = samples.period_s * static_cast<double>(samples.values.size() - 1);
  out.message = "the drive is one of " + physics::counted(samples.values.size(), "sample") +
                " over " + physics::number_text(length_s, 4) + " s from the control socket";
  return out;
}

}  // namespace stickslip::daemon
