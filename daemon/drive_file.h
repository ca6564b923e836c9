// SPDX-License-Identifier: Apache-2.0
// A drive from a recording: a cubic spline through its samples.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/demand.h"
#include "config/rig.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// u(t) for t from 0 to length_s, twice continuously differentiable; if it repeats, periodically.
/// Evaluation does not allocate.
class DriveFile {
 public:
  DriveFile() = default;

  /// `channel` of the recording at settings.path. Throws InputError with the file's name if it
  /// cannot be read, lacks the channel or a sample of it, has fewer than four samples, or repeats
  /// and does not end at its first value.
  static DriveFile load(const config::DriveFile& settings, Channel channel);

  /// Samples at increasing times [s]; the first time becomes 0. Throws like `load`, with `name` for
  /// the file.
  DriveFile(std::vector<double> times_s, std::vector<double> values, bool periodic,
            const std::string& name);

  double length_s() const { return times_s_.empty() ? 0.0 : times_s_.back(); }

  /// Value at a time [m or N], clamped to the ends. Fast if times increase slowly between calls.
  double at(double time_s);

  /// Largest |u|, |u'| and |u''| in steps of a period.
  config::Demand demand(double period_s);

 private:
  std::vector<double> times_s_;
  std::vector<double> values_;
  std::vector<double> curvatures_;  // second derivatives at the samples
  std::size_t piece_ = 0;           // latest interval
};

}  // namespace stickslip::daemon
