// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <numbers>
#include <stickslip/event_t.hpp>
#include <stickslip/recorder_t.hpp>
#include <stickslip/recording_info_t.hpp>
#include <stickslip/timing_t.hpp>

#include "protocol/channels.h"
#include "protocol/frame_block.h"
#include "protocol/recording_log.h"

namespace stickslip::daemon {
namespace {

std::int64_t wall_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// Encodes into `bytes`, which only grows; returns the encoded size, or -1.
template <class Type>
int encode(const Type& message, std::vector<std::uint8_t>& bytes) {
  const int size = message.getEncodedSize();
  if (size < 0) return -1;
  if (bytes.size() < static_cast<std::size_t>(size)) bytes.resize(static_cast<std::size_t>(size));
  return message.encode(bytes.data(), 0, size);
}

template <class Type>
Message message_of(const std::string& channel, const Type& content, std::int64_t time_us) {
  Message out{channel, time_us, {}};
  const int size = encode(content, out.bytes);
  out.bytes.resize(static_cast<std::size_t>(std::max(0, size)));
  return out;
}

/// Of the excitation messages, in the time of the frames.
constexpr std::int64_t excitation_period_ns = 100'000'000;
/// Limits the size of excitation messages of fast rigs.
constexpr std::size_t max_drive_records = 2000;

std::int64_t signed_of(std::uint64_t count) { return static_cast<std::int64_t>(count); }

void fill_losses(const AccountBalance& account, std::int32_t& count,
                 std::vector<std::string>& names, std::vector<std::int64_t>& losses) {
  count = static_cast<std::int32_t>(loss_count);
  names.assign(loss_names.begin(), loss_names.end());
  losses.clear();
  for (const std::uint64_t lost : account.lost) losses.push_back(signed_of(lost));
}

/// Nothing for quantities of which an estimate has no value.
std::optional<double> value_of(const Estimate& estimate, observer::Quantity quantity) {
  using observer::Quantity;
  switch (quantity) {
    case Quantity::displacement:
      return estimate.displacement_m;
    case Quantity::velocity:
      return estimate.velocity_m_s;
    case Quantity::theta:
      return estimate.theta;
    case Quantity::mu:
      return estimate.mu;
    case Quantity::gamma:
      return estimate.gamma_per_s;
    case Quantity::normal_load:
      return estimate.normal_load_n;
    case Quantity::friction_force:
      return estimate.friction_force_n;
    case Quantity::load_cell_deflection:
    case Quantity::load_cell_velocity:
      break;
  }
  return std::nullopt;
}

}  // namespace

void set_ledger(const Balance& ledger, status_t& status) {
  status.produced = signed_of(ledger.produced);
  status.publishing = static_cast<std::int8_t>(ledger.published.enabled);
  status.published = signed_of(ledger.published.delivered);
  fill_losses(ledger.published, status.publish_loss_count, status.publish_loss_name,
              status.publish_loss);
  status.recording = static_cast<std::int8_t>(ledger.recorded.enabled);
  status.recorded = signed_of(ledger.recorded.delivered);
  fill_losses(ledger.recorded, status.record_loss_count, status.record_loss_name,
              status.record_loss);
  status.record_confirmed = ledger.recorded.confirmed ? signed_of(*ledger.recorded.confirmed) : -1;
}

Message status_message(const Status& status, std::int64_t utc_us) {
  status_t out{};
  out.utc_us = utc_us;
  out.uptime_ns = status.uptime_ns;
  out.state = name_of(status.state);
  if (status.state == RigState::faulted) out.interlock = name_of(status.interlock);
  out.cause = status.cause;
  out.amplifier_on = static_cast<std::int8_t>(status.amplifier_on);
  set_ledger(status.ledger, out);
  out.lost_messages = signed_of(status.lost_messages);
  out.cycles = signed_of(status.cycles);
  out.overruns = signed_of(status.overruns);
  out.skipped_periods = signed_of(status.skipped_periods);
  out.longest_overrun_ns = status.longest_overrun_ns;
  out.late_cycles = signed_of(status.late_cycles);
  out.lateness_p99_ns = status.lateness_p99_ns;
  out.cycle_p99_ns = status.work_p99_ns;
  out.read_p99_ns = status.read_p99_ns;
  out.read_max_ns = status.read_max_ns;
  out.missing_at_source = signed_of(status.missing_at_source);
  out.repeated = signed_of(status.repeated);
  out.not_finite = signed_of(status.not_finite);
  out.failed_reads = signed_of(status.failed_reads);
  out.failed_writes = signed_of(status.failed_writes);
  out.lateness_mean_ns = status.lateness_mean_ns;
  out.lateness_max_ns = status.lateness_max_ns;
  out.cycle_mean_ns = status.work_mean_ns;
  out.cycle_max_ns = status.work_max_ns;
  out.degraded = static_cast<std::int8_t>(status.degraded);
  return message_of(protocol::status_channel, out, utc_us);
}

Message timing_message(const Timing& timing, std::int64_t utc_us) {
  timing_t out{};
  out.utc_us = utc_us;
  out.cycles = signed_of(timing.cycles.load(std::memory_order_relaxed));
  std::size_t used = DurationHistogram::bin_count;
  const auto empty = [&timing](std::size_t bin) {
    return timing.lateness.count_in(bin) + timing.work.count_in(bin) + timing.read.count_in(bin) ==
           0;
  };
  while (used > 0 && empty(used - 1)) --used;
  out.bins = static_cast<std::int32_t>(used);
  for (std::size_t bin = 0; bin < used; ++bin) {
    out.upper_edge_ns.push_back(DurationHistogram::upper_edge_ns(bin));
    out.lateness.push_back(signed_of(timing.lateness.count_in(bin)));
    out.cycle.push_back(signed_of(timing.work.count_in(bin)));
    out.read.push_back(signed_of(timing.read.count_in(bin)));
  }
  return message_of(protocol::timing_channel, out, utc_us);
}

Message recorder_message(const Status& status, std::int64_t utc_us) {
  recorder_t out{};
  out.utc_us = utc_us;
  out.file = status.recording->file.string();
  out.part = status.recording->part;
  out.file_bytes = signed_of(status.recording->file_bytes);
  out.bytes = signed_of(status.recording->bytes);
  out.length_us = status.recording->length_us;
  out.free_bytes = status.free_bytes ? signed_of(*status.free_bytes) : -1;
  out.failing = static_cast<std::int8_t>(status.recording_failing);
  return message_of(protocol::recorder_channel, out, utc_us);
}

Message event_message(const Event& event, std::int64_t utc_us) {
  event_t out{};
  out.utc_us = utc_us;
  out.time_ns = event.time_ns;
  out.sequence = signed_of(event.sequence);
  out.severity = static_cast<std::int8_t>(event.severity);
  out.code = event.code;
  out.message = event.message;
  return message_of(protocol::event_channel, out, utc_us);
}

Message recording_info_message(const config::Rig& rig, std::int64_t started_utc_us) {
  protocol::Description description;
  description.started_utc_us = started_utc_us;
  description.rig = rig.name;
  description.program = "stickslipd";
  description.version = STICKSLIP_VERSION;
  description.configuration = rig.text;
  description.model = rig.model_text;
  description.calibration = rig.calibration_text;
  if (rig.faults) description.fault_script = rig.faults->text;
  return message_of(protocol::recording_channel, protocol::info_of(description, -1),
                    started_utc_us);
}

template <class Type>
WriteResult MessageSink::write(const std::string& channel, const Type& message,
                               std::int64_t time_us) {
  const int size = encode(message, bytes_);
  if (size < 0) return WriteResult::encode_error;
  const std::span<const std::uint8_t> bytes(bytes_.data(), static_cast<std::size_t>(size));
  return writer_.write(channel, bytes, time_us) ? WriteResult::ok : WriteResult::write_error;
}

std::int64_t MessageSink::time_us(std::int64_t time_ns) {
  if (!origin_us_) origin_us_ = wall_us() - time_ns / 1000;
  return *origin_us_ + time_ns / 1000;
}

WriteResult MessageSink::write_block(std::span<const Sample> block) {
  frames_.clear();
  for (const Sample& sample : block) frames_.push_back(sample.frame);
  const bool late = std::any_of(block.begin(), block.end(), [](const Sample& s) { return s.late; });
  protocol::encode_block(frames_, late ? 1 : 0, bytes_);
  if (!writer_.write(frames_channel_, bytes_, time_us(block.back().frame.time_ns))) {
    return WriteResult::write_error;
  }
  for (const Sample& sample : block) record_drive(sample);
  if (!excitation_published_ns_ ||
      drive_records_.back().time_ns - *excitation_published_ns_ >= excitation_period_ns ||
      drive_records_.size() >= max_drive_records) {
    write_excitation();
  }
  return WriteResult::ok;
}

void MessageSink::record_drive(const Sample& sample) {
  const Drive& drive = sample.drive;
  drive_records_.push_back({sample.frame.time_ns, sample.frame.sequence, drive.value,
                            drive.amplitude, 2.0 * std::numbers::pi * drive.phase_turns,
                            drive.limited, sample.amplifier_on});
  carrier_hz_ = drive.carrier_hz;
  gain_ = drive.gain;
}

void MessageSink::write_excitation() {
  if (drive_records_.empty()) return;
  const DriveRecord& last = drive_records_.back();
  excitation_t& out = excitation_;
  out.time_ns = last.time_ns;
  out.sequence = signed_of(last.sequence);
  out.drive = last.drive;
  out.amplitude = last.amplitude;
  out.carrier_hz = carrier_hz_;
  out.phase_rad = last.phase_rad;
  out.gain = gain_;
  out.limited = static_cast<std::int8_t>(last.limited);
  out.amplifier_on = static_cast<std::int8_t>(last.amplifier_on);
  const std::size_t earlier = drive_records_.size() - 1;
  out.earlier = static_cast<std::int32_t>(earlier);
  out.earlier_by.resize(earlier);
  out.earlier_drive.resize(earlier);
  out.earlier_amplitude.resize(earlier);
  out.earlier_phase_rad.resize(earlier);
  out.earlier_state.resize(earlier);
  for (std::size_t i = 0; i < earlier; ++i) {
    const DriveRecord& record = drive_records_[i];
    out.earlier_by[i] = static_cast<std::int32_t>(std::min<std::uint64_t>(
        last.sequence - record.sequence, std::numeric_limits<std::int32_t>::max()));
    out.earlier_drive[i] = record.drive;
    out.earlier_amplitude[i] = static_cast<float>(record.amplitude);
    out.earlier_phase_rad[i] = static_cast<float>(record.phase_rad);
    out.earlier_state[i] = static_cast<std::uint8_t>(static_cast<unsigned>(record.limited) |
                                                     (record.amplifier_on ? 0x80U : 0U));
  }
  drive_records_.clear();
  excitation_published_ns_ = out.time_ns;
  write(excitation_channel_, out, time_us(out.time_ns));
}

bool MessageSink::flush() {
  // Before a new part of the log: each part contains the excitation of its frames.
  if (writer_.wants_flush()) write_excitation();
  return writer_.flush();
}

WriteResult MessageSink::write_estimate(const Estimate& estimate) {
  const bool any = estimate.status != observer::EstimateStatus::waiting &&
                   estimate.status != observer::EstimateStatus::unsupported;
  friction_estimate_t& out = estimate_;
  out.time_ns = estimate.time_ns;
  out.sequence = signed_of(estimate.sequence);
  out.valid = static_cast<std::int8_t>(estimate.valid);
  out.theta = estimate.theta;
  out.mu = estimate.mu;
  out.gamma_per_s = estimate.gamma_per_s;
  out.friction_force_n = estimate.friction_force_n;
  out.slip_velocity_m_s = estimate.slip_velocity_m_s;
  out.sticking = estimate.sticking;
  out.raw_friction_force_n = estimate.raw_friction_force_n;
  out.raw_coefficient = estimate.raw_friction_over_load;

  std::array<std::size_t, observer::quantity_count> row{};
  std::size_t used = 0;
  out.state_name.clear();
  out.state.clear();
  for (std::size_t i = 0; any && i < estimate.used; ++i) {
    const std::optional<double> value = value_of(estimate, estimate.quantities[i]);
    if (!value) continue;
    row[used++] = i;
    out.state_name.emplace_back(observer::name_of(estimate.quantities[i]));
    out.state.push_back(*value);
  }
  out.state_count = static_cast<std::int32_t>(used);
  out.covariance.resize(used);
  for (std::size_t i = 0; i < used; ++i) {
    out.covariance[i].resize(used);
    for (std::size_t j = 0; j < used; ++j) {
      out.covariance[i][j] = estimate.covariance[row[i]][row[j]];
    }
  }
  for (std::size_t i = 0; i < channel_count; ++i) {
    const bool used_channel = ((estimate.innovation_valid >> i) & 1U) != 0;
    out.innovation[i] = used_channel ? estimate.innovation[i] : 0.0;
    out.innovation_variance[i] =
        used_channel ? estimate.innovation_std[i] * estimate.innovation_std[i] : 0.0;
  }
  out.nis = estimate.nis;
  out.nis_freedom = estimate.nis_freedom;
  out.restarts = signed_of(estimate.restarts);
  out.nis_mean = estimate.nis_mean;
  out.nis_mean_low = estimate.nis_mean_low;
  out.nis_mean_high = estimate.nis_mean_high;
  std::copy(estimate.whiteness.begin(), estimate.whiteness.end(), out.whiteness);
  std::copy(estimate.whiteness_bound.begin(), estimate.whiteness_bound.end(), out.whiteness_bound);
  return write(estimate_channel_, out, time_us(estimate.time_ns));
}

WriteResult MessageSink::write_message(const Message& message) {
  if (message.bytes.empty()) return WriteResult::encode_error;
  return writer_.write(message.channel, message.bytes, message.time_us) ? WriteResult::ok
                                                                        : WriteResult::write_error;
}

}  // namespace stickslip::daemon
