// SPDX-License-Identifier: Apache-2.0
#include "tools/interview/questions.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "config/model_names.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"
#include "tools/interview/quantity.h"

namespace stickslip::interview {

namespace {

using physics::Excitation;
using physics::FrictionLaw;
using physics::Parameter;

constexpr std::array kilograms = {Unit{"kg", 0, 1.0, 1.0}, Unit{"g", 0, 1e-3, 1.0},
                                  Unit{"", 0, 1.0, 1.0}};
constexpr std::array spring_units = {Unit{"Hz", 0, 1.0, 2.0}, Unit{"N/m", 1, 1.0, 5.0}};
constexpr std::array damping_units = {Unit{"", 0, 1.0, 50.0}, Unit{"N s/m", 1, 1.0, 50.0},
                                      Unit{"Ns/m", 1, 1.0, 50.0}};
constexpr std::array newtons = {Unit{"N", 0, 1.0, 5.0}, Unit{"", 0, 1.0, 5.0}};
constexpr std::array coefficients = {Unit{"", 0, 1.0, 20.0}, Unit{"N", 1, 1.0, 20.0}};
constexpr std::array rates = {Unit{"1/s", 0, 1.0, 50.0}, Unit{"/s", 0, 1.0, 50.0}};
constexpr std::array cell_masses = {Unit{"kg", 0, 1.0, 0.0}, Unit{"g", 0, 1e-3, 0.0}};
constexpr std::array cell_frequencies = {Unit{"Hz", 0, 1.0, 0.0}};
constexpr std::array cell_dampings = {Unit{"", 0, 1.0, 0.0}};

// Of the paper's rig: a state variable needs a transition of finite width.
constexpr double usual_transition_speed_m_s = 0.0025;
constexpr Parameter usual_rate_per_s{150.0, 75.0};
constexpr Parameter usual_cell_damping{0.02, 0.0};

/// Parts between commas, without blanks around them; none of an empty text.
std::vector<std::string_view> parts_of(std::string_view text) {
  std::vector<std::string_view> out;
  if (trimmed(text).empty()) return out;
  while (true) {
    const std::size_t comma = text.find(',');
    out.push_back(trimmed(text.substr(0, comma)));
    if (comma == std::string_view::npos) return out;
    text.remove_prefix(comma + 1);
  }
}

/// The first word, and the rest.
struct Words {
  std::string_view first;
  std::string_view rest;
};

Words words_of(std::string_view text) {
  text = trimmed(text);
  const std::size_t end = std::min(text.find_first_of(" \t"), text.size());
  return {text.substr(0, end), trimmed(text.substr(end))};
}

std::string refusal(std::string_view expected, std::string_view found) {
  std::string out("expected ");
  return out.append(expected).append(", found \"").append(trimmed(found)).append("\"");
}

/// Expectation of a number that is too small; "" if it is not.
std::string range_problem(const Quantity& quantity, bool above_zero, std::string_view answer) {
  if (!quantity.problem.empty()) return "expected " + quantity.problem;
  const double value = quantity.parameter.value;
  if (above_zero && value <= 0.0) return refusal("a number above 0", answer);
  if (value < 0.0) return refusal("a number, 0 or more", answer);
  return "";
}

bool always(const Draft&) { return true; }
bool moves_freely(const Draft& draft) { return !draft.imposed(); }
bool may_have_load_cell(const Draft& draft) {
  return !draft.imposed() && draft.measures(Channel::friction_force);
}

std::string no_proposal(const Draft&) { return ""; }
std::string none_proposed(const Draft&) { return "none"; }

/// True if a recording decides which channels there are.
bool recorded(const Draft& draft) { return draft.measured != Measured{}; }

/// A channel that the model needs and that is not among those measured; "" if there is none.
std::string_view missing_channel(const Draft& draft) {
  const auto lacks = [&draft](Channel channel) { return !draft.measures(channel); };
  const auto name = [](Channel channel) { return info(channel).stem; };
  if (draft.model.oscillator.excitation == Excitation::base && lacks(Channel::base_displacement)) {
    return name(Channel::base_displacement);
  }
  const bool measured_load =
      draft.model.normal_load && draft.model.normal_load->law == physics::NormalLoadLaw::measured;
  if (measured_load && lacks(Channel::normal_load)) return name(Channel::normal_load);
  if (draft.imposed() && lacks(Channel::friction_force)) return name(Channel::friction_force);
  if (lacks(Channel::displacement) && lacks(Channel::velocity)) return name(Channel::displacement);
  return {};
}

/// Of an answer that needs a channel which the recording does not have; "" if it has them all.
std::string recording_problem(const Draft& draft, std::string_view answer) {
  const std::string_view missing = recorded(draft) ? missing_channel(draft) : "";
  if (missing.empty()) return "";
  std::string expected("an answer that needs no ");
  return refusal(expected.append(missing).append(", which the recording does not have"), answer);
}

std::string excitation_proposed(const Draft& draft) {
  const bool base = !recorded(draft) || draft.measures(Channel::base_displacement);
  return base ? "base" : "force";
}

std::string take_excitation(Draft& draft, std::string_view answer) {
  const std::optional<Excitation> found =
      config::value_in(config::names<Excitation>, trimmed(answer));
  if (!found) return refusal("base, force or imposed", answer);
  draft.model.oscillator.excitation = *found;
  return recording_problem(draft, answer);
}

std::string take_mass(Draft& draft, std::string_view answer) {
  const Quantity mass = quantity_in(answer, kilograms);
  std::string problem = range_problem(mass, true, answer);
  if (problem.empty()) draft.model.oscillator.mass_kg = mass.parameter;
  return problem;
}

std::string take_spring(Draft& draft, std::string_view answer) {
  physics::Oscillator& oscillator = draft.model.oscillator;
  if (trimmed(answer) == "none") {
    oscillator.stiffness_n_m = Parameter{};
    return "";
  }
  const Quantity spring = quantity_in(answer, spring_units);
  std::string problem = range_problem(spring, true, answer);
  if (!problem.empty()) return problem.append("; \"none\" is a mass without a spring");
  (spring.kind == 0 ? oscillator.natural_frequency_hz : oscillator.stiffness_n_m) =
      spring.parameter;
  return "";
}

std::string damping_proposed(const Draft& draft) {
  return draft.has_spring() ? "0.02 +- 50 %" : "";
}

std::string take_damping(Draft& draft, std::string_view answer) {
  physics::Oscillator& oscillator = draft.model.oscillator;
  if (trimmed(answer) == "none") {
    oscillator.damping_n_s_m = Parameter{};
    return "";
  }
  const Quantity damping = quantity_in(answer, damping_units);
  std::string problem = range_problem(damping, false, answer);
  if (!problem.empty()) return problem;
  const bool ratio = damping.kind == 0;
  if (ratio && !draft.has_spring()) {
    return refusal("a number in N s/m: without a spring there is no damping ratio", answer);
  }
  (ratio ? oscillator.damping_ratio : oscillator.damping_n_s_m) = damping.parameter;
  return "";
}

std::string load_proposed(const Draft& draft) {
  return draft.measures(Channel::normal_load) ? "measured" : "none";
}

std::string take_load(Draft& draft, std::string_view answer) {
  const std::string_view word = trimmed(answer);
  if (word == "none") return "";
  if (word == "measured") {
    draft.model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::measured, {}, {}};
    return recording_problem(draft, answer);
  }
  const Quantity load = quantity_in(answer, newtons);
  std::string problem = range_problem(load, true, answer);
  if (!problem.empty()) return problem.append("; or \"measured\", or \"none\"");
  draft.model.normal_load =
      physics::NormalLoad{physics::NormalLoadLaw::constant, load.parameter, {}};
  return "";
}

/// Coefficient of friction, in newtons where no load is declared.
std::string take_coefficient(Parameter& mu, bool has_load, std::string_view text,
                             std::string_view answer) {
  const Quantity found = quantity_in(text, coefficients);
  std::string problem = range_problem(found, false, answer);
  if (!problem.empty()) return problem;
  if (found.kind == 1 && has_load) {
    return refusal("a coefficient without a unit, since a normal load is declared", answer);
  }
  mu = found.parameter;
  return "";
}

/// Coefficient of friction, and for a state variable its rate.
std::string take_friction_numbers(physics::Friction& friction, bool has_load,
                                  std::string_view numbers, std::string_view answer) {
  const std::vector<std::string_view> parts = parts_of(numbers);
  const bool memory = friction.law == FrictionLaw::state_variable;
  if (parts.empty() || parts.size() > (memory ? 2U : 1U)) {
    return refusal(memory ? "\"state_variable MU, RATE 1/s\"" : "\"coulomb MU\"", answer);
  }
  std::string problem = take_coefficient(friction.mu, has_load, parts[0], answer);
  if (!problem.empty() || !memory) return problem;
  friction.transition_speed_m_s.value = usual_transition_speed_m_s;
  friction.rate_per_s = usual_rate_per_s;
  if (parts.size() == 1) return "";
  const Quantity rate = quantity_in(parts[1], rates);
  friction.rate_per_s = rate.parameter;
  return range_problem(rate, true, answer);
}

/// Parameters that a law needs and that the term does not have: "stiffness_n_m NUMBER, ...".
std::string missing_parameters(const physics::Card& law, const physics::Term& term) {
  std::string out;
  for (std::size_t i = 0; i < law.parameters.size(); ++i) {
    const physics::ParameterCard& card = law.parameters[i];
    const bool needed = !card.fixed_default || law.transition_speed == i;
    if (!needed || term.parameters.contains(std::string(card.name))) continue;
    out.append(out.empty() ? "" : ", ").append(card.name).append(" NUMBER");
  }
  return out;
}

/// "stiffness_n_m 4000 N/m +- 20 %" of a law by name.
std::string take_law_parameter(physics::Term& term, const physics::Card& law,
                               std::string_view part) {
  const Words words = words_of(part);
  const auto card =
      std::find_if(law.parameters.begin(), law.parameters.end(),
                   [&](const physics::ParameterCard& each) { return each.name == words.first; });
  if (card == law.parameters.end()) {
    std::string names;
    for (const physics::ParameterCard& each : law.parameters) {
      names.append(names.empty() ? "" : ", ").append(each.name);
    }
    return refusal("a parameter of the law (" + names + ") with its number", part);
  }
  const std::array units = {Unit{card->unit, 0, 1.0, 50.0}, Unit{"", 0, 1.0, 50.0}};
  const Quantity found = quantity_in(words.rest, units);
  if (!found.problem.empty()) return "expected " + found.problem;
  const bool may_be_zero = card->fixed_default == 0.0;
  if (card->positive && found.parameter.value <= 0.0 &&
      !(may_be_zero && found.parameter.value == 0.0)) {
    return refusal(may_be_zero ? "a number, 0 or more" : "a number above 0", part);
  }
  term.parameters[std::string(card->name)] = found.parameter;
  return "";
}

/// "dahl MU, stiffness_n_m NUMBER".
std::string take_named_law(Draft& draft, const physics::Card& law, std::string_view numbers,
                           std::string_view answer) {
  physics::Term term;
  term.id = law.id;
  term.law = true;
  const std::vector<std::string_view> parts = parts_of(numbers);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::string problem =
        i == 0 ? take_coefficient(term.parameters["mu"], draft.model.normal_load.has_value(),
                                  parts[i], answer)
               : take_law_parameter(term, law, parts[i]);
    if (!problem.empty()) return problem;
  }
  const std::string missing = missing_parameters(law, term);
  if (parts.empty()) return refusal("\"" + term.id + " MU, ...\" with " + missing, answer);
  if (!missing.empty()) return refusal("also " + missing, answer);
  draft.model.friction = {};
  draft.model.terms.insert(draft.model.terms.begin(), std::move(term));
  return "";
}

std::string take_friction(Draft& draft, std::string_view answer) {
  const Words words = words_of(answer);
  const std::optional<FrictionLaw> law = config::value_in(config::names<FrictionLaw>, words.first);
  const physics::Effect* named = law ? nullptr : physics::find_law(words.first);
  if (named != nullptr) return take_named_law(draft, named->card(), words.rest, answer);
  if (!law || (*law == FrictionLaw::none && !words.rest.empty())) {
    return refusal(
        "none, \"coulomb MU\", \"state_variable MU, RATE 1/s\" or another law with MU and its "
        "parameters (`stickslip effects` lists the laws)",
        answer);
  }
  physics::Friction friction;
  friction.law = *law;
  std::string problem;
  if (*law != FrictionLaw::none) {
    problem =
        take_friction_numbers(friction, draft.model.normal_load.has_value(), words.rest, answer);
  }
  if (problem.empty()) draft.model.friction = friction;
  return problem;
}

std::string sensors_proposed(const Draft& draft) {
  std::string out;
  for (Channel channel : all_channels) {
    if (draft.measures(channel)) out.append(out.empty() ? "" : ", ").append(info(channel).stem);
  }
  if (!out.empty()) return out;
  switch (draft.model.oscillator.excitation) {
    case Excitation::base:
      return "displacement, friction_force, base_displacement";
    case Excitation::force:
      return "displacement, drive_force";
    case Excitation::imposed:
      break;
  }
  return "displacement, friction_force";
}

/// Noise "2e-5" or "2e-5 m"; "": unknown.
std::string take_noise(physics::Sensor& sensor, Channel channel, std::string_view text) {
  if (text.empty()) return "";
  const std::array units = {Unit{info(channel).unit}, Unit{""}};
  const Quantity noise = quantity_in(text, units);
  std::string problem = range_problem(noise, true, text);
  if (problem.empty()) sensor.noise_std = noise.parameter.value;
  return problem;
}

std::string stems() {
  std::string out;
  for (Channel channel : all_channels)
    out.append(out.empty() ? "" : ", ").append(info(channel).stem);
  return out;
}

std::string take_sensors(Draft& draft, std::string_view answer) {
  Draft changed = draft;
  for (const std::string_view part : parts_of(answer)) {
    const Words words = words_of(part);
    const std::optional<Channel> channel = channel_named(words.first);
    if (!channel) return refusal("names out of " + stems() + ", each with its noise", part);
    if (recorded(draft) && !draft.measures(*channel)) {
      return refusal("sensors that the recording has (" + sensors_proposed(draft) + ")", part);
    }
    changed.measured[index_of(*channel)] = true;
    std::string problem =
        take_noise(changed.model.sensors[index_of(*channel)], *channel, words.rest);
    if (!problem.empty()) return problem;
  }
  const std::string_view missing = missing_channel(changed);
  if (!missing.empty()) return refusal(std::string(missing).append(" among the sensors"), answer);
  draft = changed;
  return "";
}

std::string take_load_cell(Draft& draft, std::string_view answer) {
  if (trimmed(answer) == "none") return "";
  std::vector<std::string_view> parts = parts_of(answer);
  physics::LoadCell cell;
  if (!parts.empty()) {
    if (const auto found =
            config::value_in(config::names<physics::LoadCellDynamics>, parts.back())) {
      cell.dynamics = *found;
      parts.pop_back();
    }
  }
  if (parts.size() < 2 || parts.size() > 3) {
    return refusal(
        "none, or \"MASS g, FREQUENCY Hz\", then a damping ratio and quasi_static if "
        "they apply",
        answer);
  }
  const Quantity mass = quantity_in(parts[0], cell_masses);
  const Quantity frequency = quantity_in(parts[1], cell_frequencies);
  const Quantity damping = parts.size() == 3 ? quantity_in(parts[2], cell_dampings)
                                             : Quantity{usual_cell_damping, 0, {}};
  for (const auto& [number, above_zero] :
       {std::pair(&mass, true), std::pair(&frequency, true), std::pair(&damping, false)}) {
    std::string problem = range_problem(*number, above_zero, answer);
    if (!problem.empty()) return problem;
  }
  cell.mass_kg = mass.parameter;
  cell.natural_frequency_hz = frequency.parameter;
  cell.damping_ratio = damping.parameter;
  draft.model.load_cell = cell;
  return "";
}

}  // namespace

const std::array<Question, question_count>& questions() {
  static constexpr std::array<Question, question_count> all = {{
      {"--excitation", "Excitation", "Excitation: base, force or imposed",
       "base: a shaker moves the frame, and its motion is recorded. force: a motor or coil pushes "
       "the mass, and its force is recorded (or nothing drives it, after a pluck). imposed: the "
       "motion itself is prescribed and recorded, as on a tribometer.",
       "base | force | imposed", always, excitation_proposed, take_excitation},
      {"--mass", "Mass", "Moving mass with its uncertainty: \"60 g +- 1 %\"",
       "Everything that moves, a third of the spring included. Weigh it; the uncertainty is that "
       "of the scale and of what cannot be weighed. Without +-: 1 %.",
       "60 g +- 0.6 g | 95 kg +- 5 % | 0.06", moves_freely, no_proposal, take_mass},
      {"--spring", "Spring", "Spring: \"2.4 Hz +- 0.05\", \"34 N/m\" or none",
       "Natural frequency without friction (lift the pad, pluck, count periods), or stiffness "
       "(hang weights, read the deflection), or none. Without +-: 2 % of a frequency, 5 % of a "
       "stiffness.",
       "2.4 Hz +- 0.05 | 34 N/m +- 5 % | none", moves_freely, no_proposal, take_spring},
      {"--damping", "Viscous damping", "Damping: ratio \"0.015 +- 0.005\", \"200 N s/m\" or none",
       "Damping ratio of mass and spring (lift the pad, pluck: 0.11 over the number of periods "
       "in which the swing halves), or a coefficient in N s/m. Guess, and say so with a "
       "large +-. Without +-: 50 %.",
       "0.015 +- 0.005 | 200 N s/m +- 50 % | none", moves_freely, damping_proposed, take_damping},
      {"--load", "Normal load", "Normal load: \"0.15 N +- 5 %\", measured or none",
       "The force that presses the surfaces together, summed over both pads; measured: it is "
       "recorded; none: unknown, and friction is a force in N. Without +-: 5 %.",
       "0.15 N +- 0.01 | measured | none", always, load_proposed, take_load},
      {"--friction", "Friction",
       "Friction law: none, \"coulomb 0.8\", \"state_variable 0.8, 150 1/s\", or another with its "
       "parameters: \"dahl 0.8, stiffness_n_m 4000\"",
       "The law that you believe in. coulomb MU: friction opposes the motion, whatever its speed. "
       "state_variable MU, RATE: it follows a reversal at that rate. none: a diagnosis finds dry "
       "friction that is there. Other laws (stribeck, dahl, lugre, ...; `stickslip effects` lists "
       "them) with MU, then their parameters by name. MU is in N without a normal load. Without "
       "+-: 20 % of MU, 50 % of a parameter.",
       "none | coulomb 0.8 +- 0.1 | coulomb 20 N | state_variable 0.8, 150 1/s | dahl 0.8, "
       "stiffness_n_m 4000",
       always, none_proposed, take_friction},
      {"--sensors", "Sensors and their noise",
       "Sensors, each with the standard deviation of its noise if known: \"displacement 2e-5, "
       "velocity\"",
       "The recorded channels: displacement, velocity, friction_force, normal_load, "
       "base_displacement, drive_force; behind each the standard deviation of its reading at rest, "
       "in m, m/s or N. Without a number the noise is estimated.",
       "displacement 2e-5, friction_force 4e-4, base_displacement", always, sensors_proposed,
       take_sensors},
      {"--load-cell", "Load cell", "Dynamics of the load cell: \"12.6 g, 19.3 Hz, 0.016\" or none",
       "The mass that rides on the load cell, its natural frequency (tap it) and damping ratio. "
       "none: rigid, or so stiff that it does not matter below its natural frequency. quasi_static "
       "at the end: only its inertia is corrected.",
       "none | 12.6 g, 19.3 Hz, 0.016 | 12.6 g, 19.3 Hz, quasi_static", may_have_load_cell,
       none_proposed, take_load_cell},
  }};
  return all;
}

}  // namespace stickslip::interview
