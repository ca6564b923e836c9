// SPDX-License-Identifier: Apache-2.0
#include "tools/recording_export/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/recording_events.h"
#include "protocol/recording_log.h"
#include "protocol/time_steps.h"

namespace stickslip::recording_export {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t most_text = 10'000;  // bytes of sentences about steps of the time

const char* meaning_of(Channel channel) {
  switch (channel) {
    case Channel::displacement:
      return "deflection of the mass relative to the moving frame";
    case Channel::velocity:
      return "its velocity, from the analogue differentiator";
    case Channel::friction_force:
      return "load-cell force; the friction force itself without a load cell";
    case Channel::normal_load:
      return "normal load over both pads";
    case Channel::base_displacement:
      return "displacement of the moving frame";
    case Channel::drive_force:
      return "force on the mass";
  }
  return "";
}

double seconds(std::int64_t time_ns) { return static_cast<double>(time_ns) * 1e-9; }

/// 1 for each frame that does not continue the one before: frames are missing between them, or the
/// time steps.
std::vector<std::uint8_t> gaps_in(std::span<const Frame> frames,
                                  std::span<const protocol::TimeStep> steps) {
  std::vector<std::uint8_t> out(frames.size(), 0);
  auto step = steps.begin();
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const std::uint64_t before = frames[i - 1].sequence;
    while (step != steps.end() && step->after_sequence < before) ++step;
    const bool steps_here = step != steps.end() && step->after_sequence == before;
    out[i] = static_cast<std::uint8_t>(steps_here || frames[i].sequence != before + 1);
  }
  return out;
}

Table frames_table(const protocol::Recording& recording,
                   std::span<const protocol::TimeStep> steps) {
  Table table{"frames", "one sample", {}};
  std::vector<double> time_s;
  std::vector<std::int64_t> time_ns;
  std::vector<std::int64_t> sequence;
  std::vector<std::uint8_t> valid;
  std::array<std::vector<double>, channel_count> value;
  std::array<std::vector<double>, channel_count> age_s;
  std::uint8_t aged = 0;
  for (const Frame& frame : recording.frames) {
    time_s.push_back(frame.time_s());
    time_ns.push_back(frame.time_ns);
    sequence.push_back(static_cast<std::int64_t>(frame.sequence));
    valid.push_back(frame.valid);
    for (const Channel channel : all_channels) {
      const std::size_t c = index_of(channel);
      if ((recording.channels >> c & 1U) == 0) continue;
      value[c].push_back(frame.has(channel) ? frame[channel] : missing);
      age_s[c].push_back(frame.has(channel) ? 1e-6 * frame.age_us[c] : missing);
      if (frame.age_us[c] != 0) aged = static_cast<std::uint8_t>(aged | 1U << c);
    }
  }
  table.columns.push_back({"time_s", "s", "time of measurement", std::move(time_s)});
  table.columns.push_back({"time_ns", "ns", "time of measurement, exact", std::move(time_ns)});
  table.columns.push_back(
      {"sequence", "1", "number at the source; a gap is a loss", std::move(sequence)});
  table.columns.push_back({"valid", "1", "bit i: channel i holds a measurement", std::move(valid)});
  table.columns.push_back({"gap", "1",
                           "1: frames were lost before this one, or the time steps to it; no line "
                           "joins it with the one before",
                           gaps_in(recording.frames, steps)});
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    const ChannelInfo& known = info(channel);
    if ((recording.channels >> c & 1U) == 0) continue;
    table.columns.push_back({std::string(known.column), std::string(known.unit),
                             meaning_of(channel), std::move(value[c])});
    if ((aged >> c & 1U) == 0) continue;
    table.columns.push_back({std::string(known.stem) + "_age_s", "s",
                             "age of the measurement at the time of the frame",
                             std::move(age_s[c])});
  }
  return table;
}

/// Numerical field of a message, exported as a column.
template <class Message>
struct Field {
  const char* name;
  const char* unit;
  const char* meaning;
  double (*value)(const Message&);
};

/// Unit of a state of the observer, whose name ends in it: "velocity_m_s"; "1" without one.
std::string unit_of_state(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, const char*>, 5> units = {
      {{"_m_s", "m/s"}, {"_per_s", "1/s"}, {"_m", "m"}, {"_n", "N"}, {"_s", "s"}}};
  const auto ends_in = [name](const auto& unit) { return name.ends_with(unit.first); };
  const auto found = std::find_if(units.begin(), units.end(), ends_in);
  return found == units.end() ? "1" : found->second;
}

/// Splits a message into the commanded excitation of each frame that it covers, oldest first.
/// `time_of`: time of the frame with a sequence number, if known.
template <class TimeOf>
std::vector<excitation_t> by_frame(const excitation_t& message, const TimeOf& time_of) {
  std::vector<excitation_t> out;
  for (std::size_t i = 0; i < message.earlier_by.size(); ++i) {
    excitation_t one{};
    one.sequence = message.sequence - message.earlier_by[i];
    const std::optional<std::int64_t> time_ns = time_of(one.sequence);
    if (!time_ns) continue;  // the frame was lost
    one.time_ns = *time_ns;
    one.drive = message.earlier_drive[i];
    one.amplitude = static_cast<double>(message.earlier_amplitude[i]);
    one.carrier_hz = message.carrier_hz;
    one.phase_rad = static_cast<double>(message.earlier_phase_rad[i]);
    one.gain = message.gain;
    one.limited = static_cast<std::int8_t>(message.earlier_state[i] & 0x7FU);
    one.amplifier_on = static_cast<std::int8_t>(message.earlier_state[i] >> 7U);
    out.push_back(std::move(one));
  }
  out.push_back(message);
  return out;
}

constexpr Field<excitation_t> excitation_fields[] = {
    {"drive", "m or N", "commanded base displacement, or force on force-excited rigs",
     [](const excitation_t& m) { return m.drive; }},
    {"amplitude", "m or N", "present amplitude", [](const excitation_t& m) { return m.amplitude; }},
    {"carrier_hz", "Hz", "carrier frequency", [](const excitation_t& m) { return m.carrier_hz; }},
    {"phase_rad", "rad", "carrier phase", [](const excitation_t& m) { return m.phase_rad; }},
    {"amplifier_on", "1", "1: the amplifier is enabled",
     [](const excitation_t& m) { return m.amplifier_on != 0 ? 1.0 : 0.0; }},
};

constexpr Field<friction_estimate_t> estimate_fields[] = {
    {"theta", "1", "friction state, friction force over mu N",
     [](const friction_estimate_t& m) { return m.theta; }},
    {"mu", "1", "coefficient of friction; in N on rigs without a declared normal load",
     [](const friction_estimate_t& m) { return m.mu; }},
    {"gamma_per_s", "1/s", "rate of the state-variable law",
     [](const friction_estimate_t& m) { return m.gamma_per_s; }},
    {"friction_force_n", "N", "friction force on the mass",
     [](const friction_estimate_t& m) { return m.friction_force_n; }},
    {"slip_velocity_m_s", "m/s", "velocity across the contact",
     [](const friction_estimate_t& m) { return m.slip_velocity_m_s; }},
    {"sticking", "1", "probability that the contact sticks",
     [](const friction_estimate_t& m) { return m.sticking; }},
    {"raw_friction_force_n", "N", "Eq. (1): k_l y + m_l b''",
     [](const friction_estimate_t& m) { return m.raw_friction_force_n; }},
    {"raw_coefficient", "1", "the same divided by the normal load",
     [](const friction_estimate_t& m) { return m.raw_coefficient; }},
    {"nis", "1", "normalised innovation squared",
     [](const friction_estimate_t& m) { return m.nis; }},
    {"nis_freedom", "1", "channels in it",
     [](const friction_estimate_t& m) { return static_cast<double>(m.nis_freedom); }},
    {"nis_mean", "1", "normalised innovation squared per channel, mean over two seconds",
     [](const friction_estimate_t& m) { return m.nis_mean; }},
    {"nis_mean_low", "1", "lower 95 % bound of this mean for a consistent observer",
     [](const friction_estimate_t& m) { return m.nis_mean_low; }},
    {"nis_mean_high", "1", "upper 95 % bound of this mean for a consistent observer",
     [](const friction_estimate_t& m) { return m.nis_mean_high; }},
};

/// Table of the messages on one channel of a log: times, then fields.
template <class Message>
class MessageTable {
 public:
  MessageTable(std::string name, std::string meaning, std::span<const Field<Message>> fields)
      : name_(std::move(name)),
        meaning_(std::move(meaning)),
        fields_(fields),
        values_(fields.size()) {}

  void add_row(const Message& message, bool valid) {
    time_s_.push_back(seconds(message.time_ns));
    time_ns_.push_back(message.time_ns);
    sequence_.push_back(message.sequence);
    valid_.push_back(static_cast<std::uint8_t>(valid));
    for (std::size_t i = 0; i < fields_.size(); ++i) {
      values_[i].push_back(valid ? fields_[i].value(message) : missing);
    }
    for (auto& [ignored, column] : optional_) column.push_back(missing);
  }

  /// Sets a value of the last row in a column that not every row has.
  void set_optional(const std::string& column, double value) {
    const auto [known, is_new] = optional_.try_emplace(column);
    if (is_new) known->second.assign(time_s_.size(), missing);
    known->second.back() = value;
  }

  bool empty() const { return time_s_.empty(); }

  /// `valid`: meaning of the column `valid`; null: omits it.
  Table table(const char* valid) && {
    Table out{name_, meaning_, {}};
    out.columns.push_back({"time_s", "s", "time of the frame", std::move(time_s_)});
    out.columns.push_back({"time_ns", "ns", "time of the frame, exact", std::move(time_ns_)});
    out.columns.push_back({"sequence", "1", "sequence number of the frame", std::move(sequence_)});
    if (valid != nullptr) out.columns.push_back({"valid", "1", valid, std::move(valid_)});
    for (std::size_t i = 0; i < fields_.size(); ++i) {
      out.columns.push_back(
          {fields_[i].name, fields_[i].unit, fields_[i].meaning, std::move(values_[i])});
    }
    for (auto& [name, column] : optional_) {
      constexpr std::string_view ending = "_std";
      const bool deviation = name.ends_with(ending);
      const std::string_view state =
          std::string_view(name).substr(0, name.size() - (deviation ? ending.size() : 0));
      out.columns.push_back(
          {name, unit_of_state(state),
           deviation ? "standard deviation of the state" : "state of the observer",
           std::move(column)});
    }
    return out;
  }

 private:
  std::string name_;
  std::string meaning_;
  std::span<const Field<Message>> fields_;
  std::vector<double> time_s_;
  std::vector<std::int64_t> time_ns_;
  std::vector<std::int64_t> sequence_;
  std::vector<std::uint8_t> valid_;
  std::vector<std::vector<double>> values_;
  std::map<std::string, std::vector<double>> optional_;
};

void add_states(const friction_estimate_t& message, MessageTable<friction_estimate_t>& table) {
  for (std::size_t i = 0; i < message.state.size(); ++i) {
    const std::string name = "state_" + message.state_name[i];
    table.set_optional(name, message.state[i]);
    table.set_optional(name + "_std", std::sqrt(message.covariance[i][i]));
  }
}

void add_messages(const std::filesystem::path& log, std::span<const Frame> frames,
                  const protocol::ProgressCallback& done, std::vector<Table>& tables) {
  std::unordered_map<std::int64_t, std::int64_t> time_by_sequence;
  time_by_sequence.reserve(frames.size());
  for (const Frame& frame : frames) {
    time_by_sequence.emplace(static_cast<std::int64_t>(frame.sequence), frame.time_ns);
  }
  const auto time_of = [&time_by_sequence](std::int64_t sequence) -> std::optional<std::int64_t> {
    const auto known = time_by_sequence.find(sequence);
    if (known == time_by_sequence.end()) return std::nullopt;
    return known->second;
  };
  std::ifstream in(log, std::ios::binary);
  protocol::EventReader reader(in, log.string(), done);
  MessageTable<excitation_t> drive("excitation", "the commanded excitation", excitation_fields);
  MessageTable<friction_estimate_t> estimate("estimate", "an estimate of the observer",
                                             estimate_fields);
  excitation_t excitation{};
  friction_estimate_t friction{};
  for (protocol::LogEvent event; reader.next(event) == protocol::EventReader::Found::event;) {
    if (event.channel == protocol::excitation_channel && protocol::decode(event.data, excitation)) {
      for (const excitation_t& command : by_frame(excitation, time_of))
        drive.add_row(command, true);
    } else if (event.channel == protocol::estimate_channel &&
               protocol::decode(event.data, friction)) {
      estimate.add_row(friction, friction.valid != 0);
      if (friction.valid != 0) add_states(friction, estimate);
    }
  }
  if (!drive.empty()) tables.push_back(std::move(drive).table(nullptr));
  if (!estimate.empty()) {
    tables.push_back(std::move(estimate).table("0: the estimate is invalid"));
  }
}

}  // namespace

std::size_t Column::rows() const {
  return std::visit([](const auto& v) { return v.size(); }, values);
}

const Column* Table::find(const std::string& wanted) const {
  const auto found = std::find_if(columns.begin(), columns.end(),
                                  [&](const Column& column) { return column.name == wanted; });
  return found == columns.end() ? nullptr : &*found;
}

const Table* Tables::find(const std::string& wanted) const {
  const auto found = std::find_if(tables.begin(), tables.end(),
                                  [&](const Table& table) { return table.name == wanted; });
  return found == tables.end() ? nullptr : &*found;
}

Tables tables_of(const std::filesystem::path& recording, const protocol::ProgressCallback& done) {
  const protocol::Recording read =
      protocol::read_recording(recording, protocol::progress_of_part(done, 0, 2));
  Tables out;
  out.source = recording.filename().string();
  out.description = read.description;
  if (read.cut_off_bytes > 0) out.cut_off_warning = protocol::cut_off_warning(read);
  const std::vector<protocol::TimeStep> steps = protocol::time_steps_of(read.frames);
  for (const protocol::TimeStep& step : steps) {
    if (out.time_steps.size() > most_text) break;
    out.time_steps += protocol::sentence_of(step) + '\n';
  }
  out.tables.push_back(frames_table(read, steps));
  std::array<char, 4> head{};
  std::ifstream(recording, std::ios::binary).read(head.data(), head.size());
  if (protocol::is_log({head.data(), head.size()})) {
    add_messages(recording, read.frames, protocol::progress_of_part(done, 1, 2), out.tables);
  }
  return out;
}

std::vector<std::pair<std::string, std::string>> description_texts(const Tables& tables) {
  const protocol::Description& d = tables.description;
  std::vector<std::pair<std::string, std::string>> out = {
      {"written_by", tables.written_by},
      {"source", tables.source},
      {"rig", d.rig},
      {"program", d.program},
      {"version", d.version},
      {"started_utc", protocol::utc_text(d.started_utc_us)},
      {"part", std::to_string(d.part)},
      {"configuration", d.configuration},
      {"model", d.model},
      {"calibration", d.calibration},
      {"fault_script", d.fault_script},
      {"time_steps", tables.time_steps}};
  return out;
}

}  // namespace stickslip::recording_export
