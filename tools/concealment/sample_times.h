// SPDX-License-Identifier: Apache-2.0
// When the rows of a recording are sampled, and which times its file states.
#pragma once

#include <cstdint>
#include <vector>

#include "tools/concealment/random_source.h"

namespace stickslip::concealment {

/// The clock of a recorder.
struct Clock {
  double rate_hz = 500.0;     ///< true
  double jitter = 0.0;        ///< standard deviation of the sampling times over the period
  double written_to_s = 0.0;  ///< times in the file are multiples of this; 0: to the nanosecond
};

struct SampleTimes {
  std::vector<double> sampled_s;         ///< true, increasing
  std::vector<std::int64_t> written_ns;  ///< in the file, strictly increasing
};

/// The rows of a run of `duration_s`. Jittered times stand in the file as they are.
SampleTimes sample_times(const Clock& clock, double duration_s, RandomSource& random);

}  // namespace stickslip::concealment
