// How a report says numbers, names and verdicts to a person who has never seen the project.
#pragma once

#include <string>
#include <string_view>

#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {

/// So many significant digits as a person writes them: "7300", "0.0125", "1.20 × 10⁻⁶", with a real
/// minus; "not known" for what is no number.
std::string number_words(double value, int digits = 3);

/// With the unit's prefix that suits it, or the larger `beside` which it stands: "21.9 µm",
/// "1.13 mm/s", "130 mN"; a unit of "1" is left out.
std::string quantity_words(double value, std::string_view unit, double beside = 0.0);

/// By which factor values up to `largest` are multiplied for an axis, and the unit they then have.
struct AxisUnit {
  double factor = 1.0;
  std::string unit;
};
AxisUnit axis_unit(double largest, std::string_view unit);

/// A value and the ends of its interval, all to the digits that the interval leaves.
struct EstimateWords {
  std::string value;
  std::string low;
  std::string high;
};
EstimateWords estimate_words(double value, double low, double high);

/// "90 %", "over 99.9 %", "under 0.1 %"
std::string percent_words(double share);

/// "friction force"
std::string channel_words(Channel channel);
/// A text of the program's, as a person reads it: names of channels without underscores, numbers
/// without an e.
std::string plain_words(std::string text);
/// The unit of a parameter as its card has it, with that of the channel it is about; empty for a
/// plain number.
std::string unit_words(std::string_view unit, const physics::Place& place);
/// "0.4 s", for lengths of time that somebody chose.
std::string seconds_words(double seconds);

/// "wrong gain (velocity)"
std::string suspect_words(const Suspect& suspect);
/// The same of the names that trials have: "wrong gain (velocity) and ringing load cell".
std::string trial_words(const std::string& id);

/// Which kind of answer a diagnosis is. A finding is ambiguous where something else is left with
/// more than 5 %.
enum class Answer { consistent, named, ambiguous, unexplained };
Answer answer_of(const Diagnosis& diagnosis);

/// One sentence: the verdict.
std::string headline_of(const Diagnosis& diagnosis);

/// What the rig is, with the numbers of this model.
std::string rig_words(const physics::Model& model);

}  // namespace stickslip::diagnosis
