#include "config/model_file.h"

#include <utility>

#include "config/document.h"

namespace stickslip::config {

namespace {

template <class Enumeration>
Enumeration chosen(const Document& document, std::string_view path) {
  return static_cast<Enumeration>(document.choice(path).value_or(0));
}

physics::Oscillator oscillator_in(const Document& document) {
  physics::Oscillator out;
  out.excitation = chosen<physics::Excitation>(document, "oscillator.excitation");
  out.mass_kg = document.parameter("oscillator.mass_kg").value_or(physics::Parameter{});
  out.natural_frequency_hz = document.parameter("oscillator.natural_frequency_hz");
  out.stiffness_n_m = document.parameter("oscillator.stiffness_n_m");
  out.damping_ratio = document.parameter("oscillator.damping_ratio");
  out.damping_n_s_m = document.parameter("oscillator.damping_n_s_m");
  const auto linear = document.parameter("oscillator.two_well.linear_n_m");
  const auto cubic = document.parameter("oscillator.two_well.cubic_n_m3");
  if (linear && cubic) out.two_well = physics::TwoWell{*linear, *cubic};
  return out;
}

physics::NormalLoad normal_load_in(const Document& document) {
  return {chosen<physics::NormalLoadLaw>(document, "normal_load.law"),
          document.parameter("normal_load.load_n").value_or(physics::Parameter{}),
          document.parameter("normal_load.slope_per_m").value_or(physics::Parameter{})};
}

physics::Friction friction_in(const Document& document) {
  return {chosen<physics::FrictionLaw>(document, "friction.law"),
          document.parameter("friction.mu").value_or(physics::Parameter{}),
          document.parameter("friction.transition_speed_m_s").value_or(physics::Parameter{}),
          document.parameter("friction.rate_per_s").value_or(physics::Parameter{})};
}

physics::LoadCell load_cell_in(const Document& document) {
  return {document.parameter("load_cell.mass_kg").value_or(physics::Parameter{}),
          document.parameter("load_cell.natural_frequency_hz").value_or(physics::Parameter{}),
          document.parameter("load_cell.damping_ratio").value_or(physics::Parameter{}),
          chosen<physics::LoadCellDynamics>(document, "load_cell.dynamics")};
}

physics::NormalLoadBridge bridge_in(const Document& document) {
  const physics::NormalLoadBridge absent;
  return {
      document.number("normal_load_bridge.mismatch").value_or(absent.mismatch),
      document.number("normal_load_bridge.share").value_or(absent.share),
      document.number("normal_load_bridge.share_slope_per_m").value_or(absent.share_slope_per_m)};
}

physics::Model model_in(const Document& document) {
  physics::Model model;
  model.oscillator = oscillator_in(document);
  if (document.has("normal_load.law")) model.normal_load = normal_load_in(document);
  model.friction = friction_in(document);
  if (document.has("load_cell.dynamics")) model.load_cell = load_cell_in(document);
  if (document.has("normal_load_bridge.mismatch")) model.normal_load_bridge = bridge_in(document);
  for (Channel channel : all_channels) {
    const std::string path = "sensors." + std::string(info(channel).stem);
    physics::Sensor& sensor = model.sensors[index_of(channel)];
    sensor.noise_std = document.number(path + ".noise_std");
    sensor.filters = document.filters(path + ".filters");
  }
  model.terms = document.terms();
  return model;
}

std::string text_of(const physics::Parameter& parameter) {
  if (parameter.sigma == 0.0) return number_text(parameter.value);
  return "{ value = " + number_text(parameter.value) + ", sigma = " + number_text(parameter.sigma) +
         " }";
}

class Writer {
 public:
  void table(std::string_view name) { text_ += "\n[" + std::string(name) + "]\n"; }
  void tables(std::string_view name) { text_ += "\n[[" + std::string(name) + "]]\n"; }
  void line(std::string_view key, const std::string& value) {
    text_ += std::string(key) + " = " + value + "\n";
  }
  void line(std::string_view key, const physics::Parameter& value) { line(key, text_of(value)); }
  void line(std::string_view key, const std::optional<physics::Parameter>& value) {
    if (value) line(key, *value);
  }
  template <class Enumeration>
  void choice(std::string_view path, Enumeration value) {
    line(path.substr(path.find('.') + 1),
         '"' + std::string(choice_at(model_keys(), path, static_cast<std::size_t>(value))) + '"');
  }

  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

void write(Writer& out, const physics::Oscillator& oscillator) {
  out.table("oscillator");
  out.choice("oscillator.excitation", oscillator.excitation);
  if (oscillator.excitation == physics::Excitation::imposed) return;
  out.line("mass_kg", oscillator.mass_kg);
  out.line("natural_frequency_hz", oscillator.natural_frequency_hz);
  out.line("stiffness_n_m", oscillator.stiffness_n_m);
  out.line("damping_ratio", oscillator.damping_ratio);
  out.line("damping_n_s_m", oscillator.damping_n_s_m);
  if (!oscillator.two_well) return;
  out.table("oscillator.two_well");
  out.line("linear_n_m", oscillator.two_well->linear_n_m);
  out.line("cubic_n_m3", oscillator.two_well->cubic_n_m3);
}

void write(Writer& out, const physics::NormalLoad& load) {
  out.table("normal_load");
  out.choice("normal_load.law", load.law);
  if (load.law == physics::NormalLoadLaw::measured) return;
  out.line("load_n", load.load_n);
  if (load.law == physics::NormalLoadLaw::wedge) out.line("slope_per_m", load.slope_per_m);
}

void write(Writer& out, const physics::Friction& friction) {
  out.table("friction");
  out.choice("friction.law", friction.law);
  if (friction.law == physics::FrictionLaw::none) return;
  out.line("mu", friction.mu);
  out.line("transition_speed_m_s", friction.transition_speed_m_s);
  if (friction.law == physics::FrictionLaw::state_variable) {
    out.line("rate_per_s", friction.rate_per_s);
  }
}

void write(Writer& out, const physics::LoadCell& cell) {
  out.table("load_cell");
  out.line("mass_kg", cell.mass_kg);
  out.line("natural_frequency_hz", cell.natural_frequency_hz);
  out.line("damping_ratio", cell.damping_ratio);
  out.choice("load_cell.dynamics", cell.dynamics);
}

void write(Writer& out, const physics::NormalLoadBridge& bridge) {
  out.table("normal_load_bridge");
  out.line("mismatch", number_text(bridge.mismatch));
  out.line("share", number_text(bridge.share));
  out.line("share_slope_per_m", number_text(bridge.share_slope_per_m));
}

std::string text_of(const physics::Filter& filter) {
  std::string text =
      "{ kind = \"" +
      std::string(choice_at(filter_keys(), "kind", static_cast<std::size_t>(filter.kind))) + "\", ";
  if (filter.kind == physics::FilterKind::butterworth_lowpass) {
    text += "order = " + std::to_string(filter.order) + ", ";
  }
  return text + "cutoff_hz = " + number_text(filter.cutoff_hz) + " }";
}

void write(Writer& out, Channel channel, const physics::Sensor& sensor) {
  if (!sensor.noise_std && sensor.filters.empty()) return;
  out.table("sensors." + std::string(info(channel).stem));
  if (sensor.noise_std) out.line("noise_std", number_text(*sensor.noise_std));
  if (sensor.filters.empty()) return;
  std::string list;
  for (const physics::Filter& filter : sensor.filters) {
    list += (list.empty() ? " " : ", ") + text_of(filter);
  }
  out.line("filters", "[" + list + " ]");
}

void write(Writer& out, const physics::Term& term) {
  out.tables("physics");
  out.line("id", '"' + term.id + '"');
  if (term.channel) out.line("channel", '"' + std::string(info(*term.channel).stem) + '"');
  if (term.from) out.line("from", '"' + std::string(info(*term.from).stem) + '"');
  for (const auto& [name, parameter] : term.parameters) out.line(name, parameter);
}

}  // namespace

physics::Model load_model(const std::filesystem::path& file) {
  return parse_model(read_text(file), file.string());
}

physics::Model parse_model(std::string_view text, const std::string& name) {
  Document document(text, name, model_keys());
  physics::Model model;
  if (document.sound()) {
    model = model_in(document);
    for (const physics::Inconsistency& each : physics::inconsistencies_of(model)) {
      document.report(each.path, each.message);
    }
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return model;
}

std::string model_text(const physics::Model& model) {
  Writer out;
  out.line("schema", "1");
  write(out, model.oscillator);
  if (model.normal_load) write(out, *model.normal_load);
  write(out, model.friction);
  if (model.load_cell) write(out, *model.load_cell);
  if (model.normal_load_bridge) write(out, *model.normal_load_bridge);
  for (Channel channel : all_channels) write(out, channel, model.sensors[index_of(channel)]);
  for (const physics::Term& term : model.terms) write(out, term);
  return out.take();
}

}  // namespace stickslip::config
