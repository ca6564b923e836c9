// SPDX-License-Identifier: Apache-2.0
#include "config/model_file.h"

#include <algorithm>
#include <optional>
#include <string>

#include "config/document.h"
#include "config/formula_table.h"
#include "config/model_names.h"
#include "config/toml_text.h"
#include "physics/friction_laws.h"
#include "physics/model_consistency.h"

namespace stickslip::config {

namespace {

void write(TomlWriter& out, std::string_view key, const physics::Parameter& value) {
  out.line(key, parameter_text(value));
}

void write(TomlWriter& out, std::string_view key, const std::optional<physics::Parameter>& value) {
  if (value) write(out, key, *value);
}

template <Named Enum>
void write(TomlWriter& out, std::string_view key, Enum value) {
  out.text(key, name_of(value));
}

void write(TomlWriter& out, const physics::Oscillator& oscillator) {
  out.table("oscillator");
  write(out, "excitation", oscillator.excitation);
  if (oscillator.excitation == physics::Excitation::imposed) return;
  write(out, "mass_kg", oscillator.mass_kg);
  write(out, "natural_frequency_hz", oscillator.natural_frequency_hz);
  write(out, "stiffness_n_m", oscillator.stiffness_n_m);
  write(out, "damping_ratio", oscillator.damping_ratio);
  write(out, "damping_n_s_m", oscillator.damping_n_s_m);
  if (!oscillator.two_well) return;
  out.table("oscillator.two_well");
  write(out, "linear_n_m", oscillator.two_well->linear_n_m);
  write(out, "cubic_n_m3", oscillator.two_well->cubic_n_m3);
}

void write(TomlWriter& out, const physics::NormalLoad& load) {
  out.table("normal_load");
  write(out, "law", load.law);
  if (load.law == physics::NormalLoadLaw::measured) return;
  write(out, "load_n", load.load_n);
  if (load.law == physics::NormalLoadLaw::wedge) write(out, "slope_per_m", load.slope_per_m);
}

void write_friction(TomlWriter& out, const physics::Model& model) {
  out.table("friction");
  if (const physics::Term* law = physics::law_term(model)) {
    out.text("law", law->id);
    for (const auto& [name, parameter] : law->parameters) write(out, name, parameter);
    return;
  }
  const physics::Friction& friction = model.friction;
  write(out, "law", friction.law);
  if (friction.law == physics::FrictionLaw::none) return;
  write(out, "mu", friction.mu);
  write(out, "transition_speed_m_s", friction.transition_speed_m_s);
  if (friction.law == physics::FrictionLaw::state_variable) {
    write(out, "rate_per_s", friction.rate_per_s);
  }
}

void write(TomlWriter& out, const physics::LoadCell& cell) {
  out.table("load_cell");
  write(out, "mass_kg", cell.mass_kg);
  write(out, "natural_frequency_hz", cell.natural_frequency_hz);
  write(out, "damping_ratio", cell.damping_ratio);
  write(out, "dynamics", cell.dynamics);
}

void write(TomlWriter& out, const physics::NormalLoadBridge& bridge) {
  out.table("normal_load_bridge");
  out.number("mismatch", bridge.mismatch);
  out.number("share", bridge.share);
  out.number("share_slope_per_m", bridge.share_slope_per_m);
}

std::string text_of(const physics::Filter& filter) {
  std::string text = "{ kind = " + toml_string(name_of(filter.kind)) + ", ";
  if (filter.kind == physics::FilterKind::butterworth_lowpass) {
    text += "order = " + std::to_string(filter.order) + ", ";
  }
  return text + "cutoff_hz = " + parameter_text(filter.cutoff_hz) + " }";
}

void write(TomlWriter& out, Channel channel, const physics::Sensor& sensor) {
  if (sensor == physics::Sensor{}) return;
  out.table("sensors." + std::string(info(channel).stem));
  if (sensor.noise_std) out.number("noise_std", *sensor.noise_std);
  if (sensor.noise_correlation_s) out.number("noise_correlation_s", *sensor.noise_correlation_s);
  write(out, "gain", sensor.gain);
  write(out, "offset", sensor.offset);
  write(out, "delay_s", sensor.delay_s);
  if (sensor.filters.empty()) return;
  std::string list;
  for (const physics::Filter& filter : sensor.filters) {
    list += (list.empty() ? " " : ", ") + text_of(filter);
  }
  out.line("filters", "[" + list + " ]");
}

void write_formula(TomlWriter& out, const physics::Term& term) {
  const physics::FormulaDeclaration& formula = term.formula->declaration();
  out.text("relation", physics::name_of(physics::relation_of(formula.quantity)));
  std::string key(physics::name_of(formula.quantity));
  if (formula.channel) key.append(".").append(info(*formula.channel).stem);
  out.text(key, formula.text);
  if (!formula.parameters.empty()) out.line("parameters", parameters_text(term));
  if (!formula.states.empty()) out.line("states", states_text(formula));
}

void write(TomlWriter& out, std::string_view table, const physics::Term& term) {
  out.tables(table);
  out.text("id", term.id);
  if (term.formula) return write_formula(out, term);
  if (term.channel) write(out, "channel", *term.channel);
  if (term.from) write(out, "from", *term.from);
  for (const auto& [name, parameter] : term.parameters) write(out, name, parameter);
}

}  // namespace

physics::Model load_model(const std::filesystem::path& file) {
  return parse_model(read_text(file), file.string());
}

physics::Model parse_model(std::string_view text, const std::string& name) {
  return parse_model(text, name,
                     [](const physics::Model&) { return std::vector<physics::Inconsistency>{}; });
}

physics::Model parse_model(std::string_view text, const std::string& name,
                           const ModelCheck& check) {
  Document document(text, name, keys_of<physics::Model>());
  physics::Model model;
  if (document.sound()) {
    document.read(model);
    physics::settle_law(model);
    const auto report = [&document](const std::vector<physics::Inconsistency>& found) {
      for (const physics::Inconsistency& each : found) document.report(each.path, each.message);
    };
    report(physics::inconsistencies_of(model));
    if (document.sound()) report(check(model));
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return model;
}

void add_candidates(const std::filesystem::path& file, physics::Model& model) {
  const std::string name = file.string();
  Document document(read_text(file), name, keys_of<CandidateFile>());
  CandidateFile read;
  if (document.sound()) {
    document.read(read);
    physics::Model extended = model;
    extended.candidates.insert(extended.candidates.end(), read.candidates.begin(),
                               read.candidates.end());
    for (const physics::Inconsistency& each : physics::inconsistencies_of(extended)) {
      if (each.path.starts_with("candidate.")) document.report(each.path, each.message);
    }
    if (document.sound()) model = std::move(extended);
  }
  if (!document.sound()) throw InputError(document.take_problems());
}

std::string parameter_text(const physics::Parameter& parameter) {
  if (parameter.sigma == 0.0) return toml_number(parameter.value);
  return "{ value = " + toml_number(parameter.value) + ", sigma = " + toml_number(parameter.sigma) +
         " }";
}

std::string model_text(const physics::Model& model) {
  TomlWriter out;
  out.line("schema", "1");
  if (model.dimensionless) out.line("dimensionless", "true");
  write(out, model.oscillator);
  if (model.normal_load) write(out, *model.normal_load);
  write_friction(out, model);
  if (model.load_cell) write(out, *model.load_cell);
  if (model.normal_load_bridge) write(out, *model.normal_load_bridge);
  for (Channel channel : all_channels) write(out, channel, model.sensors[index_of(channel)]);
  for (const physics::Term& term : model.terms) {
    if (!term.law) write(out, "physics", term);
  }
  for (const physics::Term& candidate : model.candidates) {
    const bool found = std::any_of(model.terms.begin(), model.terms.end(),
                                   [&](const auto& term) { return term.id == candidate.id; });
    if (!found) write(out, "candidate", candidate);
  }
  return out.take();
}

}  // namespace stickslip::config
