// SPDX-License-Identifier: Apache-2.0
#include "physics/model.h"

#include "physics/formula_effect.h"

namespace stickslip::physics {

namespace {

void add(std::vector<NamedParameter>& list, const char* path, Parameter& parameter) {
  list.push_back({path, &parameter});
}

void add(std::vector<NamedParameter>& list, const char* path, std::optional<Parameter>& parameter) {
  if (parameter) list.push_back({path, &*parameter});
}

}  // namespace

bool operator==(const Term& a, const Term& b) {
  const bool same_formula = a.formula && b.formula
                                ? a.formula->declaration() == b.formula->declaration()
                                : a.formula == b.formula;
  return same_formula && a.id == b.id && a.channel == b.channel && a.from == b.from &&
         a.parameters == b.parameters && a.law == b.law;
}

std::string path_of(const Term& term) {
  if (term.law) return "friction";
  std::string path = "physics.";
  path += term.id;
  for (const std::optional<Channel>& channel : {term.channel, term.from}) {
    if (!channel) continue;
    path += '.';
    path += info(*channel).stem;
  }
  return path;
}

namespace {

void add_instruments(std::vector<NamedParameter>& list, Model& model) {
  for (const Channel channel : all_channels) {
    Sensor& sensor = model.sensors[index_of(channel)];
    const std::string path = instrument_path(channel);
    const auto put = [&](const char* key, std::optional<Parameter>& parameter) {
      if (parameter) list.push_back({path + key, &*parameter});
    };
    put("gain", sensor.gain);
    put("offset", sensor.offset);
    put("delay_s", sensor.delay_s);
    for (std::size_t i = 0; i < sensor.filters.size(); ++i) {
      list.push_back(
          {path + "filters." + std::to_string(i) + ".cutoff_hz", &sensor.filters[i].cutoff_hz});
    }
  }
}

}  // namespace

std::string instrument_path(Channel channel) {
  std::string path = "sensors.";
  path += info(channel).stem;
  return path + '.';
}

std::optional<InstrumentParameter> instrument_parameter(std::string_view path) {
  for (const Channel channel : all_channels) {
    const std::string begin = instrument_path(channel);
    if (!path.starts_with(begin)) continue;
    const std::string_view key = path.substr(begin.size());
    if (key == "gain") return InstrumentParameter{channel, InstrumentQuantity::gain};
    if (key == "offset") return InstrumentParameter{channel, InstrumentQuantity::offset};
    if (key == "delay_s") return InstrumentParameter{channel, InstrumentQuantity::delay};
  }
  return std::nullopt;
}

std::vector<NamedParameter> parameters_of(Model& model) {
  std::vector<NamedParameter> list;
  if (model.oscillator.excitation != Excitation::imposed) {
    add(list, "oscillator.mass_kg", model.oscillator.mass_kg);
    add(list, "oscillator.natural_frequency_hz", model.oscillator.natural_frequency_hz);
    add(list, "oscillator.stiffness_n_m", model.oscillator.stiffness_n_m);
    add(list, "oscillator.damping_ratio", model.oscillator.damping_ratio);
    add(list, "oscillator.damping_n_s_m", model.oscillator.damping_n_s_m);
    if (model.oscillator.two_well) {
      add(list, "oscillator.two_well.linear_n_m", model.oscillator.two_well->linear_n_m);
      add(list, "oscillator.two_well.cubic_n_m3", model.oscillator.two_well->cubic_n_m3);
    }
  }
  if (model.normal_load && model.normal_load->law != NormalLoadLaw::measured) {
    add(list, "normal_load.load_n", model.normal_load->load_n);
    if (model.normal_load->law == NormalLoadLaw::wedge) {
      add(list, "normal_load.slope_per_m", model.normal_load->slope_per_m);
    }
  }
  if (model.friction.law != FrictionLaw::none) {
    add(list, "friction.mu", model.friction.mu);
    add(list, "friction.transition_speed_m_s", model.friction.transition_speed_m_s);
    if (model.friction.law == FrictionLaw::state_variable) {
      add(list, "friction.rate_per_s", model.friction.rate_per_s);
    }
  }
  if (model.load_cell) {
    add(list, "load_cell.mass_kg", model.load_cell->mass_kg);
    add(list, "load_cell.natural_frequency_hz", model.load_cell->natural_frequency_hz);
    add(list, "load_cell.damping_ratio", model.load_cell->damping_ratio);
  }
  add_instruments(list, model);
  for (Term& term : model.terms) {
    const std::string path = path_of(term) + '.';
    for (auto& [name, parameter] : term.parameters) list.push_back({path + name, &parameter});
  }
  return list;
}

std::size_t declared_parameter_count(const Model& model) {
  Model declared = model;
  declared.terms.clear();
  return parameters_of(declared).size();
}

}  // namespace stickslip::physics
