// The talk with a person who calibrates a channel, without any input or output: it asks in text,
// takes lines that a person typed and readings that the caller averaged.
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

/// Raw values over some seconds at rest.
struct Reading {
  double mean = 0.0;
  double std = 0.0;  ///< of single values
  /// How many of them were independent, 1 or more. Filtered values are not: where every value is
  /// like the ten before it, a tenth of their number.
  double n = 1.0;
};

struct DialogSettings {
  Channel channel = Channel::friction_force;
  std::string raw_unit;    ///< as the driver names it; empty: not known
  std::string date;        ///< of the new calibration, ISO 8601
  double reading_s = 5.0;  ///< how long readings are averaged, for the text
  /// Local gravity, which makes masses forces. Absent: standard gravity, and as nobody said where
  /// on Earth it is, a gain that is known to 0.15 % at best.
  std::optional<double> gravity_m_s2;
  std::optional<config::ChannelCalibration> before;  ///< what holds now
  FitOptions fit;  ///< its unit and what references have in common are set here
};

/// A known value as a person types it: "200 g", "0.2 kg", "-1.5 N", "10 mm", "250 um", "0".
struct KnownValue {
  double si = 0.0;
  bool by_mass = false;  ///< it took gravity to make it a force
};

/// Nothing where the text is no number with a unit that fits the channel.
std::optional<KnownValue> known_value(std::string_view text, Channel channel, double gravity_m_s2);

class Dialog {
 public:
  enum class Wants {
    answer,   ///< a line that a person types
    reading,  ///< raw values, averaged from now on
    nothing,  ///< it is over
  };

  explicit Dialog(DialogSettings settings);

  Wants wants() const;

  /// What is to be shown since the last call; ends with a question while an answer is wanted.
  std::string take_text();

  /// While an answer is wanted. In every question `quit` ends without a change, `again N` takes
  /// point N anew, `list` shows the points.
  void answer(std::string_view line);

  /// While a reading is wanted.
  void offer(const Reading& reading);

  /// While a reading is wanted and there is none: why, as a sentence.
  void reading_failed(const std::string& why);

  /// What was accepted, once it is over; nothing where the person quit.
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
  Step back_ = Step::reference;  // where `again` returns to
  bool reading_ = false;
  std::string text_;
  std::string reference_;
  std::string by_;
  double absolute_sigma_ = 0.0;  // of each reference, SI
  double relative_sigma_ = 0.0;
  bool by_mass_ = false;
  std::size_t target_ = 0;  // the point that the reading is for
  double target_si_ = 0.0;
  std::vector<Point> points_;
  std::vector<double> way_down_;  // last is next
  double calmest_std_ = 0.0;
  std::optional<LineFit> fit_;
  std::optional<config::ChannelCalibration> proposed_;
  std::optional<config::ChannelCalibration> result_;
};

}  // namespace stickslip::calibration
