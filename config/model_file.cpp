#include "config/model_file.h"

#include <array>
#include <charconv>

#include "config/document.h"
#include "config/key.h"

namespace stickslip::config {

using physics::Model;
using physics::Parameter;

namespace {

void read_oscillator(Document& document, Model& model) {
  auto& oscillator = model.oscillator;
  document.require("oscillator.excitation");
  const std::string excitation = document.text("oscillator.excitation").value_or("base");
  if (excitation == "imposed") {
    oscillator.excitation = physics::Excitation::imposed;
    for (const char* key : {"mass_kg", "natural_frequency_hz", "stiffness_n_m", "damping_ratio",
                            "damping_n_s_m", "two_well"}) {
      const std::string path = std::string("oscillator.") + key;
      if (document.has(path)) {
        document.blame(
            path,
            "stands beside excitation = \"imposed\": the motion is given, so nothing else "
            "may stand in [oscillator]");
      }
    }
    return;
  }
  oscillator.excitation =
      excitation == "force" ? physics::Excitation::force : physics::Excitation::base;
  document.require("oscillator.mass_kg");
  oscillator.mass_kg = document.parameter("oscillator.mass_kg").value_or(Parameter{1.0, 0.0});
  oscillator.natural_frequency_hz = document.parameter("oscillator.natural_frequency_hz");
  oscillator.stiffness_n_m = document.parameter("oscillator.stiffness_n_m");
  oscillator.damping_ratio = document.parameter("oscillator.damping_ratio");
  oscillator.damping_n_s_m = document.parameter("oscillator.damping_n_s_m");
  if (document.has("oscillator.two_well")) {
    document.require("oscillator.two_well.linear_n_m");
    document.require("oscillator.two_well.cubic_n_m3");
    oscillator.two_well = physics::TwoWell{
        document.parameter("oscillator.two_well.linear_n_m").value_or(Parameter{1.0, 0.0}),
        document.parameter("oscillator.two_well.cubic_n_m3").value_or(Parameter{1.0, 0.0})};
  }
}

void read_normal_load(Document& document, Model& model) {
  if (!document.has("normal_load")) return;
  document.require("normal_load.law");
  const std::string law = document.text("normal_load.law").value_or("constant");
  physics::NormalLoad load;
  const auto refuse = [&](const char* path) {
    if (document.has(path)) {
      document.blame(path, "does not belong to the normal-load law \"" + law + "\"");
    }
  };
  if (law == "measured") {
    load.law = physics::NormalLoadLaw::measured;
    refuse("normal_load.load_n");
    refuse("normal_load.slope_per_m");
  } else {
    document.require("normal_load.load_n");
    load.load_n = document.parameter("normal_load.load_n").value_or(Parameter{});
    if (law == "wedge") {
      load.law = physics::NormalLoadLaw::wedge;
      document.require("normal_load.slope_per_m", "the law \"wedge\" needs it");
      load.slope_per_m = document.parameter("normal_load.slope_per_m").value_or(Parameter{});
    } else {
      refuse("normal_load.slope_per_m");
    }
  }
  model.normal_load = load;
}

void read_friction(Document& document, Model& model) {
  if (!document.has("friction")) return;
  document.require("friction.law");
  const std::string law = document.text("friction.law").value_or("none");
  const auto refuse = [&](const char* path) {
    if (document.has(path)) {
      document.blame(path, "does not belong to the friction law \"" + law + "\"");
    }
  };
  if (law == "none") {
    refuse("friction.mu");
    refuse("friction.transition_speed_m_s");
    refuse("friction.rate_per_s");
    return;
  }
  document.require("friction.mu");
  document.require("friction.transition_speed_m_s", "0 is the set-valued Coulomb law");
  model.friction.mu = document.parameter("friction.mu").value_or(Parameter{});
  model.friction.transition_speed_m_s =
      document.parameter("friction.transition_speed_m_s").value_or(Parameter{});
  if (law == "state_variable") {
    model.friction.law = physics::FrictionLaw::state_variable;
    document.require("friction.rate_per_s", "the law \"state_variable\" needs it");
    model.friction.rate_per_s =
        document.parameter("friction.rate_per_s").value_or(Parameter{1.0, 0.0});
  } else {
    model.friction.law = physics::FrictionLaw::coulomb;
    refuse("friction.rate_per_s");
  }
}

void read_load_cell(Document& document, Model& model) {
  if (!document.has("load_cell")) return;
  physics::LoadCell cell;
  for (const char* path : {"load_cell.mass_kg", "load_cell.natural_frequency_hz",
                           "load_cell.damping_ratio", "load_cell.dynamics"}) {
    document.require(path);
  }
  cell.mass_kg = document.parameter("load_cell.mass_kg").value_or(Parameter{1.0, 0.0});
  cell.natural_frequency_hz =
      document.parameter("load_cell.natural_frequency_hz").value_or(Parameter{1.0, 0.0});
  cell.damping_ratio = document.parameter("load_cell.damping_ratio").value_or(Parameter{});
  cell.dynamics = document.text("load_cell.dynamics") == "quasi_static"
                      ? physics::LoadCellDynamics::quasi_static
                      : physics::LoadCellDynamics::resonant;
  model.load_cell = cell;
}

// Writes numbers so that they read back to the bit, as TOML floats.
std::string number(double value) {
  std::array<char, 40> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  std::string out(text.data(), error == std::errc() ? end : text.data());
  if (out.find_first_of(".e") == std::string::npos) out += ".0";
  return out;
}

std::string number(const Parameter& parameter) {
  if (parameter.sigma == 0.0) return number(parameter.value);
  return "{ value = " + number(parameter.value) + ", sigma = " + number(parameter.sigma) + " }";
}

class Writer {
 public:
  void line(const std::string& text) { text_ += text + "\n"; }
  void key(const char* name, const Parameter& parameter) {
    line(std::string(name) + " = " + number(parameter));
  }
  void key(const char* name, const std::optional<Parameter>& parameter) {
    if (parameter) key(name, *parameter);
  }
  void key(const char* name, const char* choice) {
    line(std::string(name) + " = \"" + choice + "\"");
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

void write_oscillator(const physics::Oscillator& oscillator, Writer& out) {
  out.line("\n[oscillator]");
  switch (oscillator.excitation) {
    case physics::Excitation::base:
      out.key("excitation", "base");
      break;
    case physics::Excitation::force:
      out.key("excitation", "force");
      break;
    case physics::Excitation::imposed:
      out.key("excitation", "imposed");
      return;
  }
  out.key("mass_kg", oscillator.mass_kg);
  out.key("natural_frequency_hz", oscillator.natural_frequency_hz);
  out.key("stiffness_n_m", oscillator.stiffness_n_m);
  out.key("damping_ratio", oscillator.damping_ratio);
  out.key("damping_n_s_m", oscillator.damping_n_s_m);
  if (oscillator.two_well) {
    out.line("\n[oscillator.two_well]");
    out.key("linear_n_m", oscillator.two_well->linear_n_m);
    out.key("cubic_n_m3", oscillator.two_well->cubic_n_m3);
  }
}

void write_sensors(const Model& model, Writer& out) {
  for (const Channel channel : all_channels) {
    const physics::Sensor& sensor = model.sensors[index_of(channel)];
    if (!sensor.noise_std && sensor.filters.empty()) continue;
    out.line("\n[sensors." + std::string(info(channel).stem) + "]");
    if (sensor.noise_std) out.line("noise_std = " + number(*sensor.noise_std));
    if (sensor.filters.empty()) continue;
    std::string list = "filters = [ ";
    for (std::size_t i = 0; i < sensor.filters.size(); ++i) {
      const physics::Filter& filter = sensor.filters[i];
      list += i == 0 ? "" : ", ";
      if (filter.kind == physics::FilterKind::first_order_lowpass) {
        list += "{ kind = \"first_order_lowpass\", cutoff_hz = " + number(filter.cutoff_hz) + " }";
      } else {
        list += "{ kind = \"butterworth_lowpass\", order = " + std::to_string(filter.order) +
                ", cutoff_hz = " + number(filter.cutoff_hz) + " }";
      }
    }
    out.line(list + " ]");
  }
}

}  // namespace

Model parse_model(std::string_view text, const std::string& name) {
  Document document(text, name, model_keys());
  Model model;
  // What follows from a broken document is no news.
  if (document.sound()) {
    document.require("schema", "write schema = 1");
    read_oscillator(document, model);
    read_normal_load(document, model);
    read_friction(document, model);
    read_load_cell(document, model);
    for (const Channel channel : all_channels) {
      const std::string path = "sensors." + std::string(info(channel).stem);
      model.sensors[index_of(channel)] = {document.number(path + ".noise_std"),
                                          document.filters(path + ".filters")};
    }
    model.terms = document.terms("physics");
  }
  if (document.sound()) {
    for (const auto& each : physics::inconsistencies_of(model))
      document.blame(each.path, each.message);
  }
  if (!document.sound()) throw InputError(document.problems());
  return model;
}

Model load_model(const std::filesystem::path& file) {
  return parse_model(file_text(file), file.string());
}

std::string model_text(const Model& model) {
  Writer out;
  out.line("schema = 1");
  write_oscillator(model.oscillator, out);
  if (model.normal_load) {
    const physics::NormalLoad& load = *model.normal_load;
    out.line("\n[normal_load]");
    switch (load.law) {
      case physics::NormalLoadLaw::constant:
        out.key("law", "constant");
        out.key("load_n", load.load_n);
        break;
      case physics::NormalLoadLaw::wedge:
        out.key("law", "wedge");
        out.key("load_n", load.load_n);
        out.key("slope_per_m", load.slope_per_m);
        break;
      case physics::NormalLoadLaw::measured:
        out.key("law", "measured");
        break;
    }
  }
  out.line("\n[friction]");
  switch (model.friction.law) {
    case physics::FrictionLaw::none:
      out.key("law", "none");
      break;
    case physics::FrictionLaw::coulomb:
    case physics::FrictionLaw::state_variable: {
      const bool memory = model.friction.law == physics::FrictionLaw::state_variable;
      out.key("law", memory ? "state_variable" : "coulomb");
      out.key("mu", model.friction.mu);
      out.key("transition_speed_m_s", model.friction.transition_speed_m_s);
      if (memory) out.key("rate_per_s", model.friction.rate_per_s);
      break;
    }
  }
  if (model.load_cell) {
    out.line("\n[load_cell]");
    out.key("mass_kg", model.load_cell->mass_kg);
    out.key("natural_frequency_hz", model.load_cell->natural_frequency_hz);
    out.key("damping_ratio", model.load_cell->damping_ratio);
    out.key("dynamics", model.load_cell->dynamics == physics::LoadCellDynamics::resonant
                            ? "resonant"
                            : "quasi_static");
  }
  write_sensors(model, out);
  for (const physics::Term& term : model.terms) {
    out.line("\n[[physics]]");
    out.key("id", term.id.c_str());
    if (term.channel) out.key("channel", std::string(info(*term.channel).stem).c_str());
    for (const auto& [name, parameter] : term.parameters) out.key(name.c_str(), parameter);
  }
  return out.take();
}

}  // namespace stickslip::config
