// SPDX-License-Identifier: Apache-2.0
// The dialogue with a person who calibrates a channel, without I/O: it yields questions as text and
// accepts typed lines and averaged readings.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.h"
#include "physics/frame.h"
#include "tools/calibration/line_fit.h"

namespace stickslip::calibration {

/// Raw values averaged over some seconds at rest.
struct Reading {
  double mean = 0.0;
  double std = 0.0;  ///< of single values
  /// Number of independent values, 1 or more; smaller than the number of values if they are
  /// filtered.
  double n = 1.0;
};

struct DialogSettings {
  Channel channel = Channel::friction_force;
  std::string raw_unit;    ///< as the driver names it; empty: unknown
  std::string date;        ///< of the new calibration, ISO 8601
  double reading_s = 5.0;  ///< averaging time of a reading, for the text
  /// Local gravity, which converts masses to forces. Absent: standard gravity with the standard
  /// deviation of gravity over the Earth, so the gain is known to 0.15 % at best.
  std::optional<double> gravity_m_s2;
  std::optional<config::ChannelCalibration> before;  ///< the current calibration
  FitOptions fit;  ///< its unit and scale_sigma are set by the dialogue
};

/// A typed reference value: "200 g", "0.2 kg", "-1.5 N", "10 mm", "250 um", "0".
struct KnownValue {
  double si = 0.0;
  bool by_mass = false;  ///< converted from a mass
};

/// None if the text is not a number with a unit that fits the channel.
std::optional<KnownValue> known_value(std::string_view text, Channel channel, double gravity_m_s2);

class Dialog {
 public:
  enum class Wants {
    answer,   ///< a typed line
    reading,  ///< raw values, averaged from now on
    nothing,  ///< finished
  };

  explicit Dialog(DialogSettings settings);

  Wants wants() const;

  /// The text since the last call; ends with a question while an answer is wanted.
  std::string take_text();

  /// To be called while an answer is wanted. Every question accepts `quit` (end without a change),
  /// `again N` (repeat point N) and `list` (show the points).
  void answer(std::string_view line);

  /// To be called while a reading is wanted.
  void offer(const Reading& reading);

  /// To be called while a reading is wanted and none is available; `why` is a sentence.
  void reading_failed(const std::string& why);

  /// The accepted calibration once finished; none if the person quit.
  const std::optional<config::ChannelCalibration>& result() const { return result_; }

  const std::vector<Point>& points() const { return points_; }

 private:
  enum class Step {
    reference,
    person,
    uncertainty,
    zero,
    up,
    down,
    last_zero,
    again,
    review,
    range,
    over
  };

  void say(const std::string& text) { text_ += text + "\n"; }
  void ask();
  bool command(const std::string& line);
  void answer_uncertainty(const std::string& line);
  void answer_up(const std::string& line);
  void answer_down(const std::string& line);
  void answer_review(const std::string& line);
  void answer_range(const std::string& line);
  void begin_down();
  void read(double reference_si);
  void after_reading();
  void review();
  std::string value_text(double si) const;

  DialogSettings settings_;
  Step step_ = Step::reference;
  Step back_ = Step::reference;  // the step to which `again` returns
  bool reading_ = false;
  std::string text_;
  std::string reference_;
  std::string by_;
  double absolute_sigma_ = 0.0;  // of each reference, SI
  double relative_sigma_ = 0.0;
  bool by_mass_ = false;
  std::size_t target_ = 0;  // index of the point being read
  double target_si_ = 0.0;
  std::vector<Point> points_;
  std::vector<double> way_down_;  // remaining references, the next one last
  double smallest_std_ = 0.0;
  std::optional<LineFit> fit_;
  std::optional<config::ChannelCalibration> proposed_;
  std::optional<config::ChannelCalibration> result_;
};

}  // namespace stickslip::calibration
