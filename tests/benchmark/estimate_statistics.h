// SPDX-License-Identifier: Apache-2.0
// Statistics of estimates against the truth: relative error, coverage of intervals, area under the
// ROC curve, median and worst over recordings.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace stickslip::quality {

/// Root-mean-square error of an estimate over the root mean square of the truth.
class RelativeError {
 public:
  void add(double estimate, double truth);
  /// Absent where nothing was added or the truth was 0 throughout. Infinite where an estimate was
  /// not finite.
  std::optional<double> value() const;

 private:
  double error_square_ = 0.0;
  double truth_square_ = 0.0;
};

/// Share of truths within the 95 % interval of a Gaussian estimate.
class Coverage {
 public:
  void add(double estimate, double standard_deviation, double truth);
  /// Absent where nothing was added.
  std::optional<double> share() const;

 private:
  std::size_t count_ = 0;
  std::size_t inside_ = 0;
};

/// True within 1.96 standard deviations, the bounds included. An estimate or a standard deviation
/// that is not finite covers nothing.
bool covers(double estimate, double standard_deviation, double truth);

/// A sample of a classifier.
struct Scored {
  double score = 0.0;
  bool positive = false;
};

/// Area under the ROC curve: probability that a positive sample has a higher score than a negative
/// one, ties counted half; a NaN is below every number. Absent where one of the classes is empty.
std::optional<double> area_under_curve(std::vector<Scored> samples);

/// Median over recordings, and the most unfavourable of them.
struct Distribution {
  double median = 0.0;
  double worst = 0.0;
  std::size_t count = 0;
};

enum class Worst { largest, smallest };

/// Absent values are left out and not counted; absent where all are. The median of an even number
/// of values is the mean of the two in the middle.
std::optional<Distribution> distribution_of(const std::vector<std::optional<double>>& values,
                                            Worst worst);

}  // namespace stickslip::quality
