// SPDX-License-Identifier: Apache-2.0
// Numbers, quantities and names as printed in a report for readers outside the project.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/diagnosis.h"
#include "physics/result_units.h"

namespace stickslip::report {

/// `digits` significant digits without an e: "7300", "0.0125", "1.20 × 10⁻⁶", with a typographic
/// minus; "not known" if not finite.
std::string format_number(double value, int digits = 3);

/// With an SI prefix chosen for the larger of `value` and `reference`: "21.9 µm", "1.13 mm/s",
/// "130 mN". The unit "1" is omitted.
std::string format_quantity(double value, std::string_view unit, double reference = 0.0);

/// Factor and unit of an axis whose largest magnitude is `largest`.
struct AxisUnit {
  double factor = 1.0;
  std::string unit;
};
AxisUnit axis_unit(double largest, std::string_view unit);

/// A value and the ends of its interval, with as many digits as the interval's width supports.
struct EstimateText {
  std::string value;
  std::string low;
  std::string high;
};
EstimateText format_estimate(double value, double low, double high);

/// With which the residuals of a channel were judged; nullptr if not known.
const diagnosis::Noise* noise_of(const diagnosis::Diagnosis& d, Channel channel);

/// True if no reading depends on the parameter, or its interval spans decades.
bool is_undetermined(const diagnosis::Estimate& each);

/// "20.1 to 20.7", or "not determined" where the interval spans decades.
std::string interval_text(double value, double low, double high);
std::string interval_text(const diagnosis::Estimate& each);

/// A shift in standard deviations: "+1.2", "-0.3", "0.0".
std::string shift_text(double sigmas);

/// For a terminal: at least three significant digits, and enough to differ from `value`.
std::string distinct_text(double number, double value);

/// "90 %", "> 99.9 %", "< 0.1 %"; to be escaped for HTML.
std::string format_percent(double share);

/// "end stop (30 %)", "wrong gain (velocity, 30 %)".
std::string with_probability(std::string name, const std::string& percent);

/// "0.4 s", for durations set by a user or an option.
std::string format_seconds(double seconds, const physics::ResultUnits& units);

/// "friction force"
std::string channel_name(Channel channel);

/// Program text as prose: channel names without underscores, numbers without an exponent and with a
/// typographic minus.
std::string plain_text(std::string text);

/// The unit of a parameter as its catalogue entry states it, with that of its channel filled in;
/// empty if dimensionless. `units`: of the model.
std::string unit_text(std::string_view unit, const physics::Place& place,
                      const physics::ResultUnits& units);

/// "wrong gain (velocity)", "dry friction (proportional to load_n)"
std::string effect_name(const diagnosis::CandidateEffect& candidate);

/// Its id with its place: "gain_error of velocity", "dry_friction with load_n, proportional".
std::string id_of(const diagnosis::CandidateEffect& candidate);

/// The same from the id of a trial: "wrong gain (velocity) and ringing load cell".
std::string trial_name(const std::string& id);

/// The catalogue entry of an estimated parameter, or nullptr.
const physics::ParameterCard* parameter_card(const diagnosis::Finding& finding,
                                             const diagnosis::Estimate& estimate);

/// "one, two and three"
std::string enumeration(const std::vector<std::string>& names);

/// A hyphen replaced by a minus sign.
std::string with_minus(const std::string& text);

}  // namespace stickslip::report
