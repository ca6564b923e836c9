#include "diagnosis/report/words.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "physics/effects/catalogue.h"
#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

constexpr double sure = 0.95;

std::string printed(const char* format, int digits, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, digits, value);
  return text;
}

// A hyphen is not a minus.
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

std::string raised(int exponent) {
  constexpr std::array<const char*, 10> digit = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                                 "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
  std::string out = exponent < 0 ? "\u207b" : "";
  for (const char c : std::to_string(std::abs(exponent))) {
    out += digit[static_cast<std::size_t>(c - '0')];
  }
  return out;
}

// The power of ten of the first digit, after rounding to `digits`.
int exponent_of(double value, int digits) {
  const std::string text = printed("%.*e", digits - 1, value);
  return std::atoi(text.c_str() + text.find('e') + 1);
}

// Only units that people put a prefix to.
bool takes_prefix(std::string_view unit) {
  return unit == "m" || unit == "m/s" || unit == "N" || unit == "s";
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) out += i + 1 == names.size() ? " and " : ", ";
    out += names[i];
  }
  return out;
}

// One part of a trial's name: "gain_error of velocity".
std::string part_words(const std::string& part) {
  const std::size_t of = part.find(" of ");
  const physics::Effect* effect = physics::find_effect(part.substr(0, of));
  if (effect == nullptr) return part;
  std::string out(effect->card().name);
  if (of != std::string::npos) out += " (" + plain_words(part.substr(of + 4)) + ")";
  return out;
}

const char* count_words(std::size_t count) {
  constexpr std::array<const char*, 4> words = {"no", "one", "two", "three"};
  return count < words.size() ? words[count] : "several";
}

// What was left out, by kind: a fault of a sensor is no physics of the rig.
std::string left_out_words(const Diagnosis& d) {
  const bool instrument =
      std::all_of(d.findings.begin(), d.findings.end(), [](const Finding& finding) {
        const physics::Relation relation = finding.effect->card().relation;
        return relation == physics::Relation::sensor || relation == physics::Relation::kinematics;
      });
  const bool one = d.findings.size() == 1;
  return std::string(count_words(d.findings.size())) +
         (instrument ? (one ? " property of the instruments" : " properties of the instruments")
                     : (one ? " piece of physics" : " pieces of physics"));
}

std::vector<std::string> found_words(const Diagnosis& d) {
  std::vector<std::string> names;
  for (const Finding& finding : d.findings) {
    names.push_back(suspect_words({finding.effect, finding.place}));
  }
  return names;
}

}  // namespace

std::string number_words(double value, int digits) {
  if (!std::isfinite(value)) return "not known";
  if (value == 0.0) return "0";
  const int exponent = exponent_of(value, digits);
  if (exponent >= -4 && exponent < 6) {
    const int decimals = std::max(0, digits - 1 - exponent);
    // Digits beyond those that count are zeros.
    const double rounded = std::strtod(printed("%.*e", digits - 1, value).c_str(), nullptr);
    return with_minus(printed("%.*f", decimals, rounded));
  }
  const std::string text = printed("%.*e", digits - 1, value);
  return with_minus(text.substr(0, text.find('e'))) + " \u00d7 10" + raised(exponent);
}

AxisUnit axis_unit(double largest, std::string_view unit) {
  AxisUnit out{1.0, std::string(unit)};
  if (!takes_prefix(unit) || !(largest > 0.0) || largest >= 0.2) return out;
  if (largest >= 0.2e-3) return {1.0e3, std::string("m").append(unit)};
  if (largest >= 0.2e-6) return {1.0e6, std::string("\u00b5").append(unit)};
  return {1.0e9, std::string("n").append(unit)};
}

std::string quantity_words(double value, std::string_view unit, double beside) {
  const AxisUnit scaled = axis_unit(std::max(std::abs(value), std::abs(beside)), unit);
  const std::string number = number_words(value * scaled.factor);
  return unit == "1" || unit.empty() ? number : number + "\u00a0" + scaled.unit;
}

EstimateWords estimate_words(double value, double low, double high) {
  const double half = 0.5 * std::abs(high - low);
  int digits = 3;
  if (half > 0.0 && std::isfinite(half) && value != 0.0) {
    digits = std::clamp(exponent_of(value, 3) - exponent_of(half, 2) + 2, 2, 12);
  }
  // Ends that are a power of ten away from the value have as many decimals, not as many digits.
  const auto end = [&](double each) {
    if (each == 0.0 || value == 0.0) return number_words(each);
    const int more = exponent_of(each, digits) - exponent_of(value, digits);
    return number_words(each, std::clamp(digits + more, 1, 15));
  };
  return {number_words(value, digits), end(low), end(high)};
}

std::string percent_words(double share) {
  if (share > 0.999) return "over 99.9\u00a0%";
  if (share < 0.001) return "under 0.1\u00a0%";
  return printed("%.*g", 3, 100.0 * share) + "\u00a0%";
}

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The numbers of a text that a program has written with an exponent, "2.5e-03", as people write
/// them.
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
    // It knows no plus.
    const auto [stop, error] = std::from_chars(*at == '+' ? at + 1 : at, end, value);
    const char* const exponent = std::find(at, stop, 'e');
    const bool programmed = error == std::errc() && exponent != stop && !is_digit(exponent[1]);
    out += programmed ? number_words(value) : std::string(at, stop);
    at = stop;
  }
  return out;
}

}  // namespace

std::string channel_words(Channel channel) { return plain_words(std::string(info(channel).stem)); }

std::string plain_words(std::string text) {
  for (const Channel channel : all_channels) {
    const std::string_view stem = info(channel).stem;
    for (std::size_t at = text.find(stem); at != std::string::npos; at = text.find(stem, at + 1)) {
      std::replace(text.begin() + static_cast<std::ptrdiff_t>(at),
                   text.begin() + static_cast<std::ptrdiff_t>(at + stem.size()), '_', ' ');
    }
  }
  return without_exponents(text);
}

std::string unit_words(std::string_view unit, const physics::Place& place) {
  constexpr std::string_view of_channel = "unit of the channel";
  if (unit == "1") return "";
  if (unit.starts_with(of_channel) && place.channel) {
    return std::string(info(*place.channel).unit).append(unit.substr(of_channel.size()));
  }
  // "N/m3" or "N/m^3"
  std::string out;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const bool power = i > 0 && unit[i] >= '2' && unit[i] <= '9' && unit[i - 1] != ' ';
    if (power) {
      out += raised(unit[i] - '0');
    } else if (unit[i] != '^') {
      out += unit[i];
    }
  }
  return out;
}

std::string seconds_words(double seconds) { return physics::number_text(seconds) + "\u00a0s"; }

std::string suspect_words(const Suspect& suspect) {
  std::string out(suspect.effect->card().name);
  if (suspect.place.channel) {
    out += " (" + channel_words(*suspect.place.channel);
    if (suspect.place.from) out += " from " + channel_words(*suspect.place.from);
    out += ")";
  }
  return out;
}

std::string trial_words(const std::string& id) {
  std::vector<std::string> names;
  for (std::size_t from = 0; from <= id.size();) {
    const std::size_t to = std::min(id.find(" + ", from), id.size());
    names.push_back(part_words(id.substr(from, to - from)));
    from = to + 3;
  }
  return joined(names);
}

Answer answer_of(const Diagnosis& d) {
  if (d.verdict == Verdict::consistent) return Answer::consistent;
  if (d.verdict == Verdict::unexplained) return Answer::unexplained;
  const bool doubtful = std::any_of(d.findings.begin(), d.findings.end(), [](const Finding& each) {
    return each.probability < sure && !each.alternatives.empty();
  });
  return doubtful ? Answer::ambiguous : Answer::named;
}

std::string headline_of(const Diagnosis& d) {
  const std::string names = joined(found_words(d));
  switch (answer_of(d)) {
    case Answer::consistent:
      return "Nothing is missing: the model explains the recording to within its noise.";
    case Answer::unexplained:
      return d.findings.empty()
                 ? "The model and the recording differ, and nothing that was tried explains why."
                 : "The model and the recording differ, and what was found explains only part of "
                   "it: " +
                       names + ".";
    case Answer::ambiguous: {
      for (const Finding& finding : d.findings) {
        if (finding.probability >= sure || finding.alternatives.empty()) continue;
        return "The model leaves out " + left_out_words(d) + ", most probably " + names +
               "; this recording alone does not rule out " +
               suspect_words(finding.alternatives.front().suspect) + ".";
      }
      break;
    }
    case Answer::named:
      break;
  }
  return "The model leaves out " + left_out_words(d) + ": " + names + ".";
}

std::string rig_words(const physics::Model& model) {
  const physics::Oscillator& oscillator = model.oscillator;
  std::string out;
  if (oscillator.excitation == physics::Excitation::imposed) {
    out += "A motion that is imposed";
  } else {
    out += std::string("A mass of ") + number_words(oscillator.mass_kg.value) + "\u00a0kg";
    if (oscillator.two_well) {
      out += " between magnets that give it two places of rest";
    } else if (oscillator.natural_frequency_hz) {
      out += " on a spring (natural frequency " +
             number_words(oscillator.natural_frequency_hz->value) + "\u00a0Hz)";
    } else if (oscillator.stiffness_n_m && oscillator.stiffness_n_m->value > 0.0) {
      out += " on a spring of " + number_words(oscillator.stiffness_n_m->value) + "\u00a0N/m";
    }
    out += oscillator.excitation == physics::Excitation::base ? ", shaken at its base"
                                                              : ", driven by a force";
  }
  const physics::Friction& friction = model.friction;
  if (friction.law == physics::FrictionLaw::none) {
    out += ", without friction";
  } else {
    out += ", rubbing with ";
    out += model.normal_load ? "a coefficient of friction of " + number_words(friction.mu.value)
                             : "a friction of " + number_words(friction.mu.value) + "\u00a0N";
    out += friction.law == physics::FrictionLaw::state_variable
               ? " (a law with memory, rate " + number_words(friction.rate_per_s.value) +
                     "\u00a0per second)"
               : " (Coulomb's law)";
  }
  if (model.normal_load) {
    switch (model.normal_load->law) {
      case physics::NormalLoadLaw::constant:
        out += " under a constant load of " + quantity_words(model.normal_load->load_n.value, "N");
        break;
      case physics::NormalLoadLaw::wedge:
        out += " under a load of " + quantity_words(model.normal_load->load_n.value, "N") +
               " that changes along the track";
        break;
      case physics::NormalLoadLaw::measured:
        out += " under the load that was recorded";
        break;
    }
  }
  if (model.load_cell) {
    out += model.load_cell->dynamics == physics::LoadCellDynamics::resonant
               ? "; its friction is measured by a load cell that may ring"
               : "; its friction is measured by a load cell that is taken to be stiff";
  }
  return out + ".";
}

}  // namespace stickslip::diagnosis
