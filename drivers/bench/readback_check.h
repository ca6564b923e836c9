// SPDX-License-Identifier: Apache-2.0
// Comparison of an output with what an input reads back of it, late by an unknown, limited time.
#pragma once

#include <array>
#include <cstdint>

namespace stickslip::drivers {

/// Within the longest delay a command must appear in the readings, and no reading may be what was
/// not commanded within that time before. Both are checked four times per delay; the output differs
/// once two checks in a row fail, at most three delays after the failure. Single readings do not
/// count, nor do times without readings. Does not allocate.
class ReadbackCheck {
 public:
  struct Settings {
    std::int64_t longest_delay_ns = 0;  ///< from a command to its reading; above 0
    double tolerance = 0.0;             ///< of a reading
  };
  /// Reading, and the limits of what was commanded.
  struct Difference {
    double reading = 0.0;
    double low = 0.0;
    double high = 0.0;
  };

  explicit ReadbackCheck(const Settings& settings);

  /// Forgets everything.
  void restart();
  /// The output from then on, as it should read. Times do not decrease.
  void command(double value, std::int64_t time_ns);
  /// Times do not decrease, and are not later than those of the next commands.
  void reading(double value, std::int64_t time_ns);

  bool differs() const { return failures_ >= 2; }
  /// Of the latest check that failed.
  const Difference& difference() const { return difference_; }

 private:
  // A quarter of the longest delay.
  struct Slice {
    std::int64_t number = -1;
    double command_low = 0.0;
    double command_high = 0.0;
    double reading_low = 0.0;
    double reading_high = 0.0;
    double reading_sum = 0.0;
    int readings = 0;
  };
  struct Span {
    double low = 0.0;
    double high = 0.0;
  };

  Slice& at(std::int64_t number) {
    return slices_[static_cast<std::size_t>(number) % slices_.size()];
  }
  bool commanded(std::int64_t first, std::int64_t last, Span& span);
  void check(std::int64_t number);
  bool fails(std::int64_t number);

  std::int64_t slice_ns_;
  double tolerance_;
  std::array<Slice, 64> slices_{};
  std::int64_t commanded_ = -1;  // slice of the latest command
  double value_ = 0.0;           // the latest command
  std::int64_t read_ = -1;       // slice of the latest reading
  int failures_ = 0;             // in a row
  Difference difference_;
};

}  // namespace stickslip::drivers
