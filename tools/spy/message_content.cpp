// SPDX-License-Identifier: Apache-2.0
#include "tools/spy/message_content.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "physics/number_text.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"

namespace stickslip::spy {

namespace {

using terminal::Tone;

std::string text(const char* format, double value) {
  std::array<char, 48> out{};
  const int size = std::snprintf(out.data(), out.size(), format, value);
  return physics::with_unsigned_zero({out.data(), static_cast<std::size_t>(std::max(size, 0))});
}

std::string values_of(const Frame& frame) {
  std::string out;
  for (const Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    if (!out.empty()) out += ", ";
    out += std::string(info(channel).stem) + " " + text("%.4g", frame[channel]) + " " +
           std::string(info(channel).unit);
  }
  return "t " + text("%.3f", frame.time_s()) + " s: " + (out.empty() ? "nothing measured" : out);
}

void summarise(const friction_estimate_t& estimate, Content& out) {
  if (!estimate.valid) {
    out.summary = "not valid";
    out.tone = Tone::warning;
    return;
  }
  out.readings = {{"mu", "1", estimate.mu},
                  {"theta", "1", estimate.theta},
                  {"gamma", "1/s", estimate.gamma_per_s},
                  {"friction_force", "N", estimate.friction_force_n},
                  {"slip_velocity", "m/s", estimate.slip_velocity_m_s},
                  {"sticking", "1", estimate.sticking},
                  {"nis", "1", estimate.nis}};
  out.summary = "mu " + text("%.4g", estimate.mu) + ", theta " + text("%.3f", estimate.theta) +
                ", friction " + text("%.4g", estimate.friction_force_n) + " N, slip " +
                text("%.4g", estimate.slip_velocity_m_s) + " m/s, sticks " +
                text("%.2f", estimate.sticking) + ", NIS " + text("%.3g", estimate.nis) + " of " +
                std::to_string(estimate.nis_freedom);
}

void summarise(const excitation_t& excitation, Content& out) {
  out.readings = {{"drive", "m or N", excitation.drive},
                  {"amplitude", "m or N", excitation.amplitude},
                  {"carrier", "Hz", excitation.carrier_hz},
                  {"gain", "1", excitation.gain}};
  out.summary = "drive " + text("%.4g", excitation.drive) + ", amplitude " +
                text("%.4g", excitation.amplitude) + " at " + text("%.4g", excitation.carrier_hz) +
                " Hz, amplifier " + (excitation.amplifier_on ? "on" : "off");
}

std::string losses(const char* verb, const std::vector<std::string>& names,
                   const std::vector<std::int64_t>& counts) {
  std::string out;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] != 0) {
      out += std::string(", not ") + verb + " (" + names[i] + ") " + std::to_string(counts[i]);
    }
  }
  return out;
}

void summarise(const status_t& status, Content& out) {
  out.readings = {{"uptime", "s", static_cast<double>(status.uptime_ns) * 1e-9},
                  {"produced", "1", static_cast<double>(status.produced)},
                  {"overruns", "1", static_cast<double>(status.overruns)},
                  {"lateness_p99", "us", static_cast<double>(status.lateness_p99_ns) * 1e-3},
                  {"cycle_p99", "us", static_cast<double>(status.cycle_p99_ns) * 1e-3}};
  const std::string lost = losses("published", status.publish_loss_name, status.publish_loss) +
                           losses("recorded", status.record_loss_name, status.record_loss);
  out.summary = status.state + ", produced " + std::to_string(status.produced);
  if (status.publishing) out.summary += ", published " + std::to_string(status.published);
  if (status.recording) out.summary += ", recorded " + std::to_string(status.recorded);
  out.summary += lost;
  if (!status.cause.empty()) out.summary += ", " + status.interlock + ": " + status.cause;
  out.summary += ", overruns " + std::to_string(status.overruns);
  if (status.degraded) out.summary += ", timing degraded";
  if (status.state == "running") out.tone = Tone::good;
  if (status.degraded || !lost.empty()) out.tone = Tone::warning;
  if (status.state == "faulted") out.tone = Tone::bad;
}

void summarise(const timing_t& timing, Content& out) {
  std::int64_t counted = 0;
  for (const std::int64_t in_bin : timing.lateness) counted += in_bin;
  std::int64_t seen = 0;
  for (std::size_t i = 0; i < timing.lateness.size() && counted > 0; ++i) {
    seen += timing.lateness[i];
    if (seen < counted - counted / 100) continue;
    const double late_us = static_cast<double>(timing.upper_edge_ns[i]) * 1e-3;
    out.readings = {{"lateness_p99", "us", late_us}};
    out.summary = "99 % of wake-ups late by at most " + text("%.4g", late_us) + " us";
    return;
  }
  out.summary = physics::counted(timing.cycles, "cycle");
}

void summarise(const recorder_t& recorder, Content& out) {
  const double length_s = static_cast<double>(recorder.length_us) * 1e-6;
  const double megabytes = static_cast<double>(recorder.bytes) * 1e-6;
  out.readings = {{"length", "s", length_s}, {"size", "MB", megabytes}};
  out.summary =
      recorder.file + ", " + text("%.1f", length_s) + " s, " + text("%.4g", megabytes) + " MB";
  if (recorder.free_bytes >= 0) {
    const double free_gb = static_cast<double>(recorder.free_bytes) * 1e-9;
    out.readings.push_back({"free", "GB", free_gb});
    out.summary += ", " + text("%.4g", free_gb) + " GB free";
  }
  if (recorder.failing) out.tone = Tone::bad;
}

void summarise(const event_t& event, Content& out) {
  out.summary = event.code + ": " + event.message;
  constexpr std::array tones = {Tone::plain, Tone::warning, Tone::bad};
  const auto severity = static_cast<std::size_t>(std::max<int>(event.severity, 0));
  out.tone = tones[std::min(severity, tones.size() - 1)];
}

void summarise(const recording_info_t& info, Content& out) {
  out.summary = info.rig.empty() ? "unnamed rig" : "rig \"" + info.rig + "\"";
  if (!info.program.empty()) out.summary += ", " + info.program + " " + info.version;
}

template <class Message>
bool read_as(std::span<const std::uint8_t> bytes, Content& out) {
  Message message{};
  if (!protocol::decode(bytes, message)) return false;
  summarise(message, out);
  return true;
}

bool read_block(std::span<const std::uint8_t> bytes, Content& out) {
  frame_block_t block{};
  if (!protocol::decode(bytes, block) || !protocol::from_block(block, out.frames)) {
    out.frames.clear();
    return false;
  }
  out.degraded = (block.flags & 1) != 0;
  if (out.degraded) out.tone = Tone::warning;
  if (!out.frames.empty()) out.summary = values_of(out.frames.back());
  return true;
}

struct Type {
  std::string_view name;
  std::int64_t hash;
  bool (*read)(std::span<const std::uint8_t>, Content&);
};

std::span<const Type> types() {
  static const std::array all = {
      Type{"frame_block_t", frame_block_t::getHash(), read_block},
      Type{"friction_estimate_t", friction_estimate_t::getHash(), read_as<friction_estimate_t>},
      Type{"excitation_t", excitation_t::getHash(), read_as<excitation_t>},
      Type{"status_t", status_t::getHash(), read_as<status_t>},
      Type{"timing_t", timing_t::getHash(), read_as<timing_t>},
      Type{"event_t", event_t::getHash(), read_as<event_t>},
      Type{"recorder_t", recorder_t::getHash(), read_as<recorder_t>},
      Type{"recording_info_t", recording_info_t::getHash(), read_as<recording_info_t>}};
  return all;
}

const Type* type_of(std::string_view channel, std::uint64_t fingerprint) {
  const auto known =
      std::find_if(protocol::lcm_channels.begin(), protocol::lcm_channels.end(),
                   [&](const protocol::LcmChannel& each) { return each.name == channel; });
  const bool known_channel = known != protocol::lcm_channels.end();
  const auto found = std::find_if(types().begin(), types().end(), [&](const Type& type) {
    return known_channel ? type.name == known->type
                         : static_cast<std::uint64_t>(type.hash) == fingerprint;
  });
  return found == types().end() ? nullptr : &*found;
}

}  // namespace

std::uint64_t fingerprint_of(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t size = 8;
  if (bytes.size() < size) return 0;
  std::uint64_t out = 0;
  for (const std::uint8_t byte : bytes.first(size)) out = out << 8U | byte;
  return out;
}

void read_message(std::string_view channel, std::span<const std::uint8_t> bytes, Content& content) {
  content.type = {};
  content.decoded = content.degraded = false;
  content.frames.clear();
  content.readings.clear();
  content.summary.clear();
  content.tone = Tone::plain;
  const Type* type = type_of(channel, fingerprint_of(bytes));
  if (type == nullptr) return;
  content.type = type->name;
  content.decoded = type->read(bytes, content);
}

}  // namespace stickslip::spy
