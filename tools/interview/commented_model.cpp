// SPDX-License-Identifier: Apache-2.0
#include "tools/interview/commented_model.h"

#include <cctype>
#include <string_view>

#include "config/model_file.h"
#include "config/model_names.h"
#include "config/toml_text.h"
#include "physics/friction_laws.h"

namespace stickslip::interview {

namespace {

using config::TomlWriter;
using physics::Parameter;

/// Each line of the text as a comment.
void comment(TomlWriter& out, std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    out.comment(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

/// The text as comments of at most 100 columns.
void comment_wrapped(TomlWriter& out, std::string_view text) {
  constexpr std::size_t columns = 98;
  while (text.size() > columns) {
    const std::size_t end = text.rfind(' ', columns);
    out.comment(text.substr(0, end));
    text.remove_prefix(end + 1);
  }
  out.comment(text);
}

void number(TomlWriter& out, std::string_view key, const Parameter& parameter) {
  out.line(key, config::parameter_text(parameter));
}

constexpr std::string_view beginning =
    "# Model of a rig: the physics that its experimenter believes in. Edit it freely; it was begun "
    "by\n"
    "# `stickslip model new`. docs/formats.md, section 3, has every key.\n"
    "#\n"
    "# A plain number is exact. { value = 2.4, sigma = 0.05 } is known with that standard "
    "deviation: the\n"
    "# true value is within 2.35 to 2.45 in two of three cases, within 2.3 to 2.5 in 19 of 20. A "
    "diagnosis\n"
    "# adjusts such a number to the recording and calls it wrong beyond three sigma. A sigma that "
    "is too\n"
    "# small makes it blame the number; one that is too large hides small effects.\n"
    "#\n"
    "# Units are SI, and each key ends in its unit.\n";

void write_spring(TomlWriter& out, const physics::Oscillator& oscillator) {
  if (oscillator.natural_frequency_hz) {
    comment(out,
            "Natural frequency without friction [Hz]. Measure: lift the pad, pluck, count 20 "
            "periods; the\n"
            "sigma is the scatter of repetitions. Alternative: stiffness_n_m.");
    number(out, "natural_frequency_hz", *oscillator.natural_frequency_hz);
  } else if (oscillator.stiffness_n_m->value > 0.0) {
    comment(out,
            "Stiffness of the spring [N/m]. Measure: hang weights, read the deflection; the sigma "
            "is that\n"
            "of the slope. Alternative: natural_frequency_hz.");
    number(out, "stiffness_n_m", *oscillator.stiffness_n_m);
  } else {
    comment(out, "Stiffness of the spring [N/m]: 0, no spring.");
    number(out, "stiffness_n_m", *oscillator.stiffness_n_m);
  }
}

void write_damping(TomlWriter& out, const physics::Oscillator& oscillator) {
  if (oscillator.damping_ratio) {
    comment(out,
            "Damping ratio of mass and spring [1]. Measure: lift the pad, pluck; 0.11 over the "
            "number of\n"
            "periods in which the swing halves. Alternative: damping_n_s_m.");
    number(out, "damping_ratio", *oscillator.damping_ratio);
    return;
  }
  comment(out,
          "Viscous damping [N s/m]: the force per speed, dry friction left out. Measure: the force "
          "at two\n"
          "constant speeds, its difference over theirs. If it is a guess, sigma is half of it.");
  number(out, "damping_n_s_m", *oscillator.damping_n_s_m);
}

void write_oscillator(TomlWriter& out, const physics::Oscillator& oscillator) {
  out.table("oscillator");
  comment(out,
          "base: the frame is shaken, its motion is base_displacement_m. force: drive_force_n acts "
          "on the\n"
          "mass. imposed: the motion is prescribed, and nothing else stands in [oscillator].");
  out.text("excitation", config::name_of(oscillator.excitation));
  if (oscillator.excitation == physics::Excitation::imposed) return;
  comment(out,
          "Everything that moves, a third of the spring included [kg]. Measure: weigh it; sigma is "
          "that of\n"
          "the scale and of what cannot be weighed.");
  number(out, "mass_kg", oscillator.mass_kg);
  write_spring(out, oscillator);
  write_damping(out, oscillator);
}

void write_load(TomlWriter& out, const physics::NormalLoad& load) {
  out.table("normal_load");
  comment(out,
          "constant: N = load_n. wedge: N = load_n (1 + slope_per_m x), where the plates are not "
          "parallel.\n"
          "measured: the recorded channel normal_load_n.");
  out.text("law", config::name_of(load.law));
  if (load.law == physics::NormalLoadLaw::measured) return;
  comment(out,
          "Force that presses the surfaces together, summed over both pads [N]. Measure: weigh the "
          "pad, or\n"
          "pull it off with a spring balance; sigma is the scatter of repetitions.");
  number(out, "load_n", load.load_n);
}

/// [friction] of a law by name: its card has the comments.
void write_named_law(TomlWriter& out, const physics::Term& term) {
  const physics::Card& law = physics::find_law(term.id)->card();
  out.table("friction");
  comment_wrapped(out, law.sentence);
  comment_wrapped(out, "`stickslip effects " + term.id +
                           "` has its equation; `stickslip laws` compares it with the others.");
  out.text("law", term.id);
  for (const physics::ParameterCard& card : law.parameters) {
    const auto found = term.parameters.find(std::string(card.name));
    if (found == term.parameters.end()) continue;
    std::string text(card.meaning);
    text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
    comment_wrapped(out, text.append(" [").append(card.unit).append("]."));
    number(out, card.name, found->second);
  }
}

void write_friction(TomlWriter& out, const physics::Friction& friction, bool has_load) {
  out.table("friction");
  comment(out,
          "none: a diagnosis finds dry friction that is there. coulomb: it opposes the slip, "
          "whatever its\n"
          "speed. state_variable: it follows a reversal at rate_per_s. `stickslip effects` lists "
          "other laws.");
  out.text("law", config::name_of(friction.law));
  if (friction.law == physics::FrictionLaw::none) return;
  comment(out, has_load ? "Coefficient of friction [1]. Measure: pull slowly, force over normal "
                          "load; sigma is the\n"
                          "scatter along the track."
                        : "Friction force [N], since no normal load is declared. Measure: pull "
                          "slowly; sigma is the\n"
                          "scatter along the track.");
  number(out, "mu", friction.mu);
  comment(out,
          "Speed over which friction changes its sign, tanh(v / transition_speed_m_s) [m/s]; 0: at "
          "once, and\n"
          "the contact sticks.");
  number(out, "transition_speed_m_s", friction.transition_speed_m_s);
  if (friction.law != physics::FrictionLaw::state_variable) return;
  comment(out,
          "Rate at which friction follows a reversal [1/s]: at speed v over a length of about\n"
          "v / rate_per_s. Unknown for most surfaces: leave a wide sigma.");
  number(out, "rate_per_s", friction.rate_per_s);
}

void write_load_cell(TomlWriter& out, const physics::LoadCell& cell) {
  out.table("load_cell");
  comment(out, "Mass that rides on the load cell, pads included [kg]. Measure: weigh it.");
  number(out, "mass_kg", cell.mass_kg);
  comment(out,
          "Natural frequency [Hz] and damping ratio [1]. Measure: tap it, with the pads apart.");
  number(out, "natural_frequency_hz", cell.natural_frequency_hz);
  number(out, "damping_ratio", cell.damping_ratio);
  comment(out,
          "resonant: its whole equation, it may ring. quasi_static: only the inertia of its mass "
          "is corrected.");
  out.text("dynamics", config::name_of(cell.dynamics));
}

void write_sensor(TomlWriter& out, Channel channel, const physics::Sensor& sensor, bool first) {
  const std::string unit(info(channel).unit);
  out.table(std::string("sensors.").append(info(channel).stem));
  if (first) {
    comment(out,
            "noise_std: standard deviation of the reading at rest, in the channel's unit. Measure: "
            "record\n"
            "10 s at rest, drive and amplifier on. Without it the noise is estimated from the "
            "recording.\n"
            "Analogue filters between sensor and converter, in the order of the signal:\n"
            "  filters = [ { kind = \"butterworth_lowpass\", order = 4, cutoff_hz = 25.0 } ]\n"
            "How well the instrument is known; without these lines 0.5 % of gain, 1 % of the "
            "channel's\n"
            "standard deviation and 0.3 samples are allowed for. sigma: of the calibration.\n"
            "  gain = { value = 1.0, sigma = 0.005 }     reading over true value\n"
            "  offset = { value = 0.0, sigma = 1.0e-4 }  reading at 0, in the channel's unit\n"
            "  delay_s = { value = 0.0, sigma = 2.0e-4 } beyond the filters");
  }
  if (sensor.noise_std) {
    out.line("noise_std", config::toml_number(*sensor.noise_std).append("  # ").append(unit));
  } else {
    comment(out, "noise_std = ...  # " + unit + "; unknown: estimated");
  }
}

void write_sensors(TomlWriter& out, const Draft& draft) {
  bool first = true;
  for (Channel channel : all_channels) {
    if (!draft.measures(channel)) continue;
    write_sensor(out, channel, draft.model.sensors[index_of(channel)], first);
    first = false;
  }
}

}  // namespace

std::string commented_model(const Draft& draft) {
  const physics::Model& model = draft.model;
  TomlWriter out;
  out.line("schema", "1");
  write_oscillator(out, model.oscillator);
  if (model.normal_load) write_load(out, *model.normal_load);
  if (const physics::Term* law = physics::law_term(model)) {
    write_named_law(out, *law);
  } else {
    write_friction(out, model.friction, model.normal_load.has_value());
  }
  if (model.load_cell) write_load_cell(out, *model.load_cell);
  write_sensors(out, draft);
  return std::string(beginning).append(out.take());
}

}  // namespace stickslip::interview
