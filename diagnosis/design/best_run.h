// SPDX-License-Identifier: Apache-2.0
// Search for the run that separates hypotheses best in its time, within the limits of the rig.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "diagnosis/design/expected_motion.h"
#include "diagnosis/design/expected_separation.h"
#include "diagnosis/design/families.h"
#include "diagnosis/open_hypotheses.h"

namespace stickslip::design {

struct DesignRequest {
  std::vector<diagnosis::OpenHypothesis> hypotheses;  ///< most probable first
  RunRange range;
  MotionRanges motion;
  SeparationSettings separation;
  /// Runs made before: a repetition of one shows what it showed.
  std::vector<RunPlan> made = {};
  double overhead_s = 3.0;  ///< rig time that every run takes beside its motion
  int evaluations = 90;     ///< of runs, the usual ones included
  int threads = 1;
  std::stop_token stop = {};  ///< once requested, the search ends with Interrupted
  std::function<void(double done)> progress = {};
};

struct DesignedRun {
  RunPlan run;
  Drive drive;  ///< with all limits, of which the run alone knows those of the drive
  DrivePeaks peaks;
  Extent extent;  ///< of the channels, over all models and stiffnesses
  std::vector<PairSeparation> separations;
  double gain = 0.0;    ///< expected_gain
  double factor = 1.0;  ///< by which the ranges of the channels made the drive smaller
  int evaluations = 0;

  /// Expected gain by the second of rig time.
  double rate(double overhead_s) const { return gain / (drive.duration_s() + overhead_s); }
};

/// Share of the ranges of the channels that a designed run may use.
inline constexpr double used_share = 0.85;

/// The best of the usual runs and of those around them; nothing where no run stays within the
/// ranges. Deterministic, whatever the number of threads.
std::optional<DesignedRun> best_run(const DesignRequest& request);

/// The given run, bounded and evaluated as best_run does.
std::optional<DesignedRun> evaluated(const DesignRequest& request, const RunPlan& run);

/// Frequencies around the natural one of a model that runs go through, at most those that the rate
/// resolves.
void set_frequencies(const physics::Model& model, double rate_hz, RunRange& range);

}  // namespace stickslip::design
