// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/wire.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string_view>

#include "physics/catalogue.h"

namespace stickslip::scope {

namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little, "the wire format is little-endian");

class Writer {
 public:
  explicit Writer(std::span<std::uint8_t> buffer) : rest_(buffer) {}

  template <class Number>
  void put(Number value) {
    std::memcpy(rest_.data(), &value, sizeof value);
    rest_ = rest_.subspan(sizeof value);
  }

 private:
  std::span<std::uint8_t> rest_;
};

// Non-finite numbers become null; invalid UTF-8 is replaced, not rejected.
Message text_message(const json& message, Keep keep) {
  return {message.dump(-1, ' ', false, json::error_handler_t::replace), keep};
}

json losses(const std::vector<std::string>& names, const std::vector<std::int64_t>& counts) {
  json out = json::object();
  for (std::size_t i = 0; i < names.size() && i < counts.size(); ++i) out[names[i]] = counts[i];
  return out;
}

std::optional<std::size_t> index_of_state(const friction_estimate_t& estimate,
                                          std::string_view state) {
  for (std::size_t i = 0; i < estimate.state_name.size(); ++i) {
    if (estimate.state_name[i] == state) return i;
  }
  return std::nullopt;
}

json root_of(double variance) {
  return variance >= 0.0 ? json(std::sqrt(variance)) : json(nullptr);
}

/// Standard deviation of a state, or null.
json deviation(const friction_estimate_t& estimate, std::string_view state) {
  const auto i = index_of_state(estimate, state);
  return i ? root_of(estimate.covariance[*i][*i]) : json(nullptr);
}

/// Slip is the velocity of the mass minus that of the load cell, if it moves.
json slip_deviation(const friction_estimate_t& estimate) {
  const auto v = index_of_state(estimate, "velocity_m_s");
  const auto l = index_of_state(estimate, "load_cell_velocity_m_s");
  if (!v) return nullptr;
  const auto& covariance = estimate.covariance;
  if (!l) return root_of(covariance[*v][*v]);
  return root_of(covariance[*v][*v] + covariance[*l][*l] - 2.0 * covariance[*v][*l]);
}

}  // namespace

Message encode_frames(std::span<const Frame> frames, const BlockNotes& notes) {
  Message message(block_header_bytes + frames.size() * frame_bytes);
  Writer out(message.payload());
  out.put(std::uint8_t{1});
  out.put(static_cast<std::uint8_t>((notes.degraded ? 1U : 0U) | (notes.history ? 2U : 0U)));
  out.put(static_cast<std::uint16_t>(channel_count));
  out.put(static_cast<std::uint32_t>(frames.size()));
  out.put(notes.received_unix_ms);
  for (const Frame& frame : frames) out.put(frame.time_ns);
  for (const Frame& frame : frames) out.put(static_cast<std::int64_t>(frame.sequence));
  for (const Channel channel : all_channels) {
    for (const Frame& frame : frames) {
      out.put(frame.has(channel) ? frame[channel] : std::numeric_limits<double>::quiet_NaN());
    }
  }
  return message;
}

Message encode_hello(const Greeting& greeting) {
  return text_message({{"type", "hello"},
                       {"version", greeting.version},
                       {"program", "stickslip scope"},
                       {"history_s", greeting.history_s},
                       {"url", greeting.url},
                       {"notes", greeting.notes},
                       {"recording", greeting.recording}},
                      Keep::always);
}

std::optional<std::string> decode_note(std::string_view text) {
  const json message = json::parse(text, nullptr, false);
  const auto note = message.find("note");
  if (!message.is_object() || note == message.end() || !note->is_string()) return std::nullopt;
  return note->get<std::string>();
}

Message encode_note_answer(const std::string& refusal) {
  return text_message({{"type", "note"}, {"taken", refusal.empty()}, {"refusal", refusal}},
                      Keep::always);
}

std::vector<Mark> marks_of(const physics::Model& model) {
  std::vector<Mark> marks;
  const physics::Oscillator& oscillator = model.oscillator;
  if (oscillator.natural_frequency_hz) {
    marks.push_back({"natural frequency", oscillator.natural_frequency_hz->value});
  } else if (oscillator.stiffness_n_m && oscillator.mass_kg.value > 0.0) {
    marks.push_back({"natural frequency",
                     std::sqrt(oscillator.stiffness_n_m->value / oscillator.mass_kg.value) /
                         (2.0 * std::numbers::pi)});
  }
  if (model.load_cell) {
    marks.push_back({"load cell", model.load_cell->natural_frequency_hz.value});
  }
  for (const physics::Term& term : model.terms) {
    const physics::Effect* effect = physics::effect_of(term);
    if (effect == nullptr || !effect->card().frequency) continue;
    const physics::Frequency& frequency = *effect->card().frequency;
    const auto found =
        term.parameters.find(std::string(effect->card().parameters[frequency.parameter].name));
    if (frequency.spectral_mark.empty() || found == term.parameters.end()) continue;
    marks.push_back({std::string(frequency.spectral_mark), found->second.value});
  }
  return marks;
}

Message encode_model(const std::string& rig, const std::vector<Mark>& marks) {
  json listed = json::array();
  for (const Mark& mark : marks) listed.push_back({{"name", mark.name}, {"hz", mark.hz}});
  return text_message({{"type", "model"}, {"rig", rig}, {"marks", listed}}, Keep::always);
}

Message encode_estimate(const friction_estimate_t& e) {
  json deviations = json::object();
  for (const char* state : {"theta", "mu", "gamma_per_s", "friction_force_n"}) {
    deviations[state] = deviation(e, state);
  }
  deviations["slip_velocity_m_s"] = slip_deviation(e);
  return text_message({{"type", "estimate"},
                       {"time_ns", e.time_ns},
                       {"sequence", e.sequence},
                       {"valid", e.valid != 0},
                       {"theta", e.theta},
                       {"mu", e.mu},
                       {"gamma_per_s", e.gamma_per_s},
                       {"friction_force_n", e.friction_force_n},
                       {"slip_velocity_m_s", e.slip_velocity_m_s},
                       {"sticking", e.sticking},
                       {"raw_friction_force_n", e.raw_friction_force_n},
                       {"raw_coefficient", e.raw_coefficient},
                       {"deviation", deviations},
                       {"innovation", e.innovation},
                       {"innovation_variance", e.innovation_variance},
                       {"nis", e.nis},
                       {"nis_freedom", e.nis_freedom},
                       {"restarts", e.restarts}},
                      Keep::may_be_lost);
}

Message encode_excitation(const excitation_t& e,
                          std::span<const std::optional<std::int64_t>> time_ns) {
  json times = json::array();
  json drive = json::array();
  json phase = json::array();
  json amplitude = json::array();
  const std::size_t earlier = e.earlier_by.size();
  for (std::size_t i = 0; i < earlier && i < time_ns.size(); ++i) {
    if (!time_ns[i]) continue;
    times.push_back(*time_ns[i]);
    drive.push_back(e.earlier_drive[i]);
    phase.push_back(e.earlier_phase_rad[i]);
    amplitude.push_back(e.earlier_amplitude[i]);
  }
  times.push_back(e.time_ns);
  drive.push_back(e.drive);
  phase.push_back(e.phase_rad);
  amplitude.push_back(e.amplitude);
  return text_message({{"type", "excitation"},
                       {"time_ns", times},
                       {"drive", drive},
                       {"phase_rad", phase},
                       {"amplitude", amplitude},
                       {"carrier_hz", e.carrier_hz},
                       {"gain", e.gain},
                       {"limited", e.limited},
                       {"amplifier_on", e.amplifier_on != 0}},
                      Keep::may_be_lost);
}

Message encode_status(const status_t& s) {
  return text_message({{"type", "status"},
                       {"utc_us", s.utc_us},
                       {"uptime_ns", s.uptime_ns},
                       {"state", s.state},
                       {"interlock", s.interlock},
                       {"cause", s.cause},
                       {"amplifier_on", s.amplifier_on != 0},
                       {"produced", s.produced},
                       {"publishing", s.publishing != 0},
                       {"published", s.published},
                       {"publish_loss", losses(s.publish_loss_name, s.publish_loss)},
                       {"recording", s.recording != 0},
                       {"recorded", s.recorded},
                       {"record_loss", losses(s.record_loss_name, s.record_loss)},
                       {"lost_messages", s.lost_messages},
                       {"cycles", s.cycles},
                       {"overruns", s.overruns},
                       {"skipped_periods", s.skipped_periods},
                       {"longest_overrun_ns", s.longest_overrun_ns},
                       {"late_cycles", s.late_cycles},
                       {"lateness_mean_ns", s.lateness_mean_ns},
                       {"lateness_p99_ns", s.lateness_p99_ns},
                       {"lateness_max_ns", s.lateness_max_ns},
                       {"cycle_mean_ns", s.cycle_mean_ns},
                       {"cycle_p99_ns", s.cycle_p99_ns},
                       {"cycle_max_ns", s.cycle_max_ns},
                       {"read_p99_ns", s.read_p99_ns},
                       {"read_max_ns", s.read_max_ns},
                       {"degraded", s.degraded != 0},
                       {"missing_at_source", s.missing_at_source},
                       {"repeated", s.repeated},
                       {"not_finite", s.not_finite},
                       {"failed_reads", s.failed_reads},
                       {"failed_writes", s.failed_writes},
                       {"record_confirmed", s.record_confirmed}},
                      Keep::may_be_lost);
}

Message encode_timing(const timing_t& t) {
  return text_message({{"type", "timing"},
                       {"utc_us", t.utc_us},
                       {"cycles", t.cycles},
                       {"upper_edge_ns", t.upper_edge_ns},
                       {"lateness", t.lateness},
                       {"cycle", t.cycle},
                       {"read", t.read}},
                      Keep::may_be_lost);
}

Message encode_recorder(const recorder_t& r) {
  return text_message({{"type", "recorder"},
                       {"utc_us", r.utc_us},
                       {"file", r.file},
                       {"part", r.part},
                       {"file_bytes", r.file_bytes},
                       {"bytes", r.bytes},
                       {"length_us", r.length_us},
                       {"free_bytes", r.free_bytes},
                       {"failing", r.failing != 0}},
                      Keep::may_be_lost);
}

Message encode_event(const event_t& e) {
  return text_message({{"type", "event"},
                       {"utc_us", e.utc_us},
                       {"time_ns", e.time_ns},
                       {"sequence", e.sequence},
                       {"severity", static_cast<int>(e.severity)},
                       {"code", e.code},
                       {"message", e.message}},
                      Keep::always);
}

Message encode_source(bool connected, double silent_s) {
  return text_message({{"type", "source"}, {"connected", connected}, {"silent_s", silent_s}},
                      Keep::always);
}

Message encode_alive(bool connected, double silent_s, std::optional<double> status_s) {
  return text_message({{"type", "alive"},
                       {"connected", connected},
                       {"silent_s", silent_s},
                       {"status_s", status_s ? json(*status_s) : json(nullptr)}},
                      Keep::may_be_lost);
}

Message encode_sources(const std::string& current, const std::vector<ListedSource>& sources) {
  json listed = json::array();
  for (const ListedSource& source : sources) {
    listed.push_back(
        {{"id", source.ids.back()},
         {"former_ids", std::vector<std::string>(source.ids.begin(), source.ids.end() - 1)},
         {"rig", source.rig},
         {"connected", source.connected}});
  }
  return text_message({{"type", "sources"}, {"current", current}, {"sources", listed}},
                      Keep::always);
}

Message encode_dropped(std::uint64_t messages) {
  return text_message({{"type", "dropped"}, {"messages", messages}}, Keep::always);
}

Message encode_restart() { return text_message({{"type", "restart"}}, Keep::always); }

}  // namespace stickslip::scope
