// SPDX-License-Identifier: Apache-2.0
// Quality of the observer on one concealed recording: filter, smoother, live check and estimates by
// hand against the true states of the reference simulator.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "observer/observer.h"
#include "physics/simulator.h"
#include "tests/benchmark/hand_estimates.h"
#include "tools/concealment/concealment.h"

namespace stickslip::quality {

/// Of the filter or the smoother, over the frames marked good. Absent: the rig does not have the
/// quantity, or no frame was good.
struct EstimatorQuality {
  double good_share = 0.0;                   ///< of all frames
  std::optional<double> force, theta, slip;  ///< RMS errors relative to the RMS of the truth
  /// Coverage of 95 % intervals, shares of the frames.
  std::optional<double> force_coverage, theta_coverage, slip_coverage, mu_coverage, load_coverage;
  std::optional<bool> final_mu_covered;
  /// NEES of x, v, theta and mu: mean per degree of freedom, and share of frames within its 95 %
  /// bounds.
  std::optional<double> nees, nees_inside;
  std::optional<double> auc;   ///< of stick against slip
  double largest_theta = 0.0;  ///< abs(theta); infinite where one was not finite
  std::uint64_t restarts = 0;
};

/// The most probable explanation of an alarm of the live check.
struct Explained {
  bool certain = false;  ///< false: the daemon says that the cause is not certain
  bool right = false;    ///< its relation, and the channel of a sensor
  double probability = 0.0;
  std::string effect;  ///< name of the effect; empty: none
};

/// The first alarm of the live check on a rig with a hidden effect.
struct Notice {
  double after_s = 0.0;  ///< from the beginning of the recording
  Explained at_once;     ///< from the frames up to the alarm
  Explained at_last;     ///< the first certain one, or the last
};

struct RecordingQuality {
  std::string name;
  std::string world;
  std::string effect;  ///< empty: none is hidden
  double duration_s = 0.0;
  std::string unsupported;  ///< reason; empty: the observer supports the model
  HandEstimates by_hand;
  EstimatorQuality filter, smoother;
  std::uint64_t alarms = 0;
  std::optional<Notice> notice;  ///< the first alarm; of a rig with a hidden effect only
};

/// abs(theta) that no friction reaches.
inline constexpr double unphysical_theta = 1.5;

/// Evaluates filter, smoother, live check and estimates by hand, of a sound rig.
RecordingQuality quality_of(const concealment::Case& recorded);

/// Evaluates the live check on a sound rig: its alarms.
RecordingQuality false_alarms_of(const concealment::Case& recorded);

/// Evaluates the live check on a rig with a hidden effect, with the explanations of the first
/// alarm.
RecordingQuality live_check_of(const concealment::Case& recorded);

}  // namespace stickslip::quality
