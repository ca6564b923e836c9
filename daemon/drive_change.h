// SPDX-License-Identifier: Apache-2.0
// Another drive for a rig at rest: one of samples that a client sent, played once, or the
// configured one again. It is built and freed on the thread that serves clients; the loop only
// swaps it.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "config/rig.h"
#include "daemon/command.h"
#include "daemon/event.h"
#include "daemon/excitation.h"

namespace stickslip::daemon {

/// A drive as a client sends it.
struct DriveSamples {
  double period_s = 0.0;
  std::vector<double> values;  ///< [m] or [N]; empty: the configured drive
};

/// Not thread-safe, but the loop may use the excitation meanwhile.
class DriveChange {
 public:
  /// A command to the loop with a drive for this rig. Throws InputError for samples that are no
  /// drive or exceed the rig's limits, or where excitation.enabled is false, and while a proposal
  /// is not answered. The return of the configured drive is always possible otherwise.
  Command propose(const config::Rig& rig, DriveSamples samples);

  /// The loop's answer to the latest proposal; also to be called, with a refusal, if the command
  /// could not be queued. The settings of the excitation that the loop has now, if it has taken the
  /// drive.
  std::optional<config::Excitation> finish(const Answer& answer);

  /// The samples that were proposed last.
  const DriveSamples& samples() const { return samples_; }

 private:
  DriveSamples samples_;
  config::Excitation settings_;                   // of the proposal
  config::Excitation before_;                     // configured, when it was made
  std::optional<config::Excitation> configured_;  // while the loop plays samples
  // The configured drive meanwhile: its return cannot fail, whatever became of its file.
  std::unique_ptr<Excitation> replaced_;
  std::unique_ptr<Excitation> proposed_;  // until its answer
};

/// "drive_changed", with the number of samples and their duration. `answer`: the loop's.
Event changed_event(const DriveSamples& samples, const Answer& answer);

}  // namespace stickslip::daemon
