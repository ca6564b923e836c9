// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/formatting.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "physics/catalogue.h"
#include "physics/number_text.h"

namespace stickslip::report {

namespace {

std::string printed(const char* format, int digits, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, digits, value);
  return text;
}

std::string superscript(int exponent) {
  constexpr std::array<const char*, 10> digit = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                                 "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
  std::string out = exponent < 0 ? "\u207b" : "";
  for (const char c : std::to_string(std::abs(exponent))) {
    out += digit[static_cast<std::size_t>(c - '0')];
  }
  return out;
}

// Decimal exponent after rounding to `digits` significant digits.
int exponent_of(double value, int digits) {
  const std::string text = printed("%.*e", digits - 1, value);
  return std::atoi(text.c_str() + text.find('e') + 1);
}

bool takes_prefix(std::string_view unit) {
  return unit == "m" || unit == "m/s" || unit == "N" || unit == "s";
}

std::string with_notes(std::string_view name, const std::vector<std::string>& notes) {
  std::string out(name);
  for (const std::string& note : notes) out += (&note == &notes.front() ? " (" : ", ") + note;
  return notes.empty() ? out : out + ")";
}

constexpr const char* in_each_recording = "different in each recording";

// One part of a trial's name: "gain_error of velocity", "dry_friction with load_n".
std::string part_name(std::string part) {
  std::string sharing;
  if (const std::size_t own = part.find(" in each recording"); own != std::string::npos) {
    sharing = in_each_recording;
    part.resize(own);
  } else if (const std::size_t with = part.find(" with "); with != std::string::npos) {
    sharing = "depending on " + part.substr(with + 6);
    part.resize(with);
  }
  const std::size_t of = part.find(" of ");
  const physics::Effect* effect = physics::find_effect(part.substr(0, of));
  if (effect == nullptr) return part;
  std::vector<std::string> notes;
  if (of != std::string::npos) notes.push_back(plain_text(part.substr(of + 4)));
  if (!sharing.empty()) notes.push_back(sharing);
  return with_notes(effect->card().name, notes);
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool is_in_word(char c) {
  return is_digit(c) || c == '_' || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// True if a number with a minus stands at `at`.
bool begins_negative(const std::string& text, std::size_t at) {
  return text[at] == '-' && at + 1 < text.size() && is_digit(text[at + 1]) &&
         (at == 0 || text[at - 1] == ' ' || text[at - 1] == '(');
}

// Numbers printed with an exponent ("2.5e-03") reformatted by format_number.
std::string without_exponents(const std::string& text) {
  std::string out;
  const char* const end = text.data() + text.size();
  for (const char* at = text.data(); at != end;) {
    const bool has_sign = (*at == '-' || *at == '+') && at + 1 != end;
    if (!is_digit(has_sign ? at[1] : *at)) {
      out += *at++;
      continue;
    }
    double value = 0.0;
    // from_chars accepts no plus sign.
    const auto [stop, error] = std::from_chars(*at == '+' ? at + 1 : at, end, value);
    const char* const exponent = std::find(at, stop, 'e');
    const bool scientific = error == std::errc() && exponent != stop && !is_digit(exponent[1]);
    const std::string number(at, stop);
    const auto place = static_cast<std::size_t>(at - text.data());
    const bool negative = begins_negative(text, place);
    out += scientific ? format_number(value) : negative ? with_minus(number) : number;
    at = stop;
  }
  return out;
}

}  // namespace

std::string with_minus(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '-') {
      out += "\u2212";
    } else {
      out += c;
    }
  }
  return out;
}

std::string enumeration(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) out += i + 1 == names.size() ? " and " : ", ";
    out += names[i];
  }
  return out;
}

std::string format_number(double value, int digits) {
  if (!std::isfinite(value)) return "not known";
  if (value == 0.0) return "0";
  const int exponent = exponent_of(value, digits);
  if (exponent >= -4 && exponent < 6) {
    const int decimals = std::max(0, digits - 1 - exponent);
    // Zeros beyond the significant digits.
    const double rounded = std::strtod(printed("%.*e", digits - 1, value).c_str(), nullptr);
    return with_minus(printed("%.*f", decimals, rounded));
  }
  const std::string text = printed("%.*e", digits - 1, value);
  return with_minus(text.substr(0, text.find('e'))) + " \u00d7 10" + superscript(exponent);
}

AxisUnit axis_unit(double largest, std::string_view unit) {
  AxisUnit out{1.0, std::string(unit)};
  if (!takes_prefix(unit) || !(largest > 0.0) || largest >= 0.2) return out;
  if (largest >= 0.2e-3) return {1.0e3, std::string("m").append(unit)};
  if (largest >= 0.2e-6) return {1.0e6, std::string("\u00b5").append(unit)};
  return {1.0e9, std::string("n").append(unit)};
}

std::string format_quantity(double value, std::string_view unit, double reference) {
  const AxisUnit scaled = axis_unit(std::max(std::abs(value), std::abs(reference)), unit);
  const std::string number = format_number(value * scaled.factor);
  return unit == "1" || unit.empty() ? number : number + "\u00a0" + scaled.unit;
}

EstimateText format_estimate(double value, double low, double high) {
  const double half = 0.5 * std::abs(high - low);
  int digits = 3;
  if (half > 0.0 && std::isfinite(half) && value != 0.0) {
    digits = std::clamp(exponent_of(value, 3) - exponent_of(half, 2) + 2, 2, 12);
  }
  // Down to the second digit of the width, whatever the decade of the end.
  const auto end = [&](double each) {
    if (each == 0.0 || !(half > 0.0) || !std::isfinite(half)) return format_number(each);
    const int more = exponent_of(each, digits) - exponent_of(half, 2);
    return format_number(each, std::clamp(2 + more, 1, 15));
  };
  return {format_number(value, digits), end(low), end(high)};
}

const diagnosis::Noise* noise_of(const diagnosis::Diagnosis& d, Channel channel) {
  const auto found = std::find_if(d.noise.begin(), d.noise.end(),
                                  [&](const auto& each) { return each.channel == channel; });
  return found == d.noise.end() ? nullptr : &*found;
}

namespace {

bool spans_decades(double low, double high) {
  constexpr double decades = 1.0e3;
  const bool one_sign = low > 0.0 || high < 0.0;
  const double least = std::min(std::abs(low), std::abs(high));
  const double most = std::max(std::abs(low), std::abs(high));
  return !std::isfinite(most) || (one_sign && most > decades * least);
}

}  // namespace

bool is_undetermined(const diagnosis::Estimate& each) {
  return !each.determined || spans_decades(each.low, each.high);
}

std::string interval_text(double value, double low, double high) {
  if (spans_decades(low, high)) return "not determined";
  const EstimateText text = format_estimate(value, low, high);
  return text.low + " to " + text.high;
}

std::string interval_text(const diagnosis::Estimate& each) {
  return each.determined ? interval_text(each.value, each.low, each.high) : "not determined";
}

std::string shift_text(double sigmas) {
  const std::string text = physics::fixed_text(sigmas, 1, true);
  return text == "+0.0" ? "0.0" : text;
}

std::string distinct_text(double number, double value) {
  for (int digits = 3; digits <= 17; ++digits) {
    const std::string text = physics::number_text(number, digits);
    if (text != physics::number_text(value, digits)) return text;
  }
  return physics::number_text(number);
}

std::string format_percent(double share) {
  if (share > 0.999) return ">\u00a099.9\u00a0%";
  if (share < 0.001) return "<\u00a00.1\u00a0%";
  return printed("%.*g", 3, 100.0 * share) + "\u00a0%";
}

std::string with_probability(std::string name, const std::string& percent) {
  const bool has_notes = name.ends_with(')');
  if (has_notes) name.pop_back();
  return name + (has_notes ? ", " : " (") + percent + ")";
}

std::string channel_name(Channel channel) { return plain_text(std::string(info(channel).stem)); }

std::string plain_text(std::string text) {
  for (const Channel channel : all_channels) {
    const std::string_view stem = info(channel).stem;
    for (std::size_t at = text.find(stem); at != std::string::npos; at = text.find(stem, at + 1)) {
      const std::size_t end = at + stem.size();
      // Part of another name: "friction_force_n".
      if ((at > 0 && is_in_word(text[at - 1])) || (end < text.size() && is_in_word(text[end])))
        continue;
      std::replace(text.begin() + static_cast<std::ptrdiff_t>(at),
                   text.begin() + static_cast<std::ptrdiff_t>(at + stem.size()), '_', ' ');
    }
  }
  return without_exponents(text);
}

std::string unit_text(std::string_view unit, const physics::Place& place,
                      const physics::ResultUnits& units) {
  constexpr std::string_view of_channel = "unit of the channel";
  if (units.of(unit) == "1") return "";
  if (const std::size_t at = unit.find(of_channel); at != std::string_view::npos && place.channel) {
    std::string name(info(*place.channel).unit);
    if (at > 0 && name.find('/') != std::string::npos) name = "(" + name + ")";
    return std::string(unit.substr(0, at)).append(name).append(unit.substr(at + of_channel.size()));
  }
  // "N/m3" or "N/m^3"
  std::string out;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const bool power = i > 0 && unit[i] >= '2' && unit[i] <= '9' && unit[i - 1] != ' ';
    if (power) {
      out += superscript(unit[i] - '0');
    } else if (unit[i] != '^') {
      out += unit[i];
    }
  }
  return out;
}

std::string format_seconds(double seconds, const physics::ResultUnits& units) {
  return physics::number_text(seconds) + (units.dimensionless() ? "" : "\u00a0s");
}

std::string effect_name(const diagnosis::CandidateEffect& candidate) {
  std::vector<std::string> notes;
  if (candidate.is_number()) notes.push_back(candidate.parameter);
  if (candidate.place.channel) {
    notes.push_back(channel_name(*candidate.place.channel));
    if (candidate.place.from) notes.back() += " from " + channel_name(*candidate.place.from);
  }
  const physics::SharedNumber& shared = candidate.shared;
  if (shared.sharing == physics::Sharing::proportional) {
    notes.push_back("proportional to " + shared.condition);
  } else if (physics::follows(shared.sharing)) {
    notes.push_back("depending on " + shared.condition);
  } else if (shared.sharing == physics::Sharing::own) {
    notes.emplace_back(in_each_recording);
  }
  return with_notes(candidate.effect->card().name, notes);
}

std::string id_of(const diagnosis::CandidateEffect& candidate) {
  const bool proportional = candidate.shared.sharing == physics::Sharing::proportional;
  return candidate.name() + (proportional ? ", proportional" : "");
}

std::string trial_name(const std::string& id) {
  std::vector<std::string> names;
  for (std::size_t from = 0; from <= id.size();) {
    const std::size_t to = std::min(id.find(" + ", from), id.size());
    names.push_back(part_name(id.substr(from, to - from)));
    from = to + 3;
  }
  return enumeration(names);
}

const physics::ParameterCard* parameter_card(const diagnosis::Finding& finding,
                                             const diagnosis::Estimate& estimate) {
  for (const physics::ParameterCard& card : finding.effect->card().parameters) {
    if (card.name == estimate.name) return &card;
  }
  return nullptr;
}

}  // namespace stickslip::report
