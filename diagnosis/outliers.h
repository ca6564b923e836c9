// SPDX-License-Identifier: Apache-2.0
// Single bad samples of a recording: a loose contact, a bit that flipped, a line that was read
// wrongly. They are found before anything else uses the channel, and count as not measured.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "physics/frame.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

/// A reading that stands alone: neither the samples around it nor another channel lead to it.
struct Outlier {
  Channel channel = Channel::displacement;
  std::size_t frame = 0;  ///< its index in the recording
  double time_s = 0.0;
  double value = 0.0;
  double expected = 0.0;  ///< halfway between its good neighbours
};

/// The outliers, by channel and time. Single samples and runs of up to eight that leave the range
/// of the channel, and single samples within it that no motion explains. Judged by the noise of the
/// channel and by what the signal does next to them, so that edges, rails, coarse steps and ringing
/// are none. A channel where they are not rare has none: they belong to its signal.
std::vector<Outlier> outliers_of(const protocol::Recording& recording);

/// A recording in which outliers are not measured; a copy only where there are any.
class Cleaned {
 public:
  /// `recording` must outlive this.
  explicit Cleaned(const protocol::Recording& recording);

  const protocol::Recording& recording() const { return copy_ ? *copy_ : original_; }
  const std::vector<Outlier>& outliers() const { return outliers_; }

 private:
  const protocol::Recording& original_;
  std::vector<Outlier> outliers_;
  std::optional<protocol::Recording> copy_;
};

}  // namespace stickslip::diagnosis
