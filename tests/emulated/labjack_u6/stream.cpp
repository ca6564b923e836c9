// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/labjack_u6/stream.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "tests/emulated/labjack_u6/wire.h"

namespace stickslip::emulated {

namespace {

constexpr std::uint8_t overlap_error = 55;
constexpr std::uint8_t recovering_error = 59;
constexpr std::uint8_t recovered_error = 60;
constexpr std::uint8_t recovery_overflow_error = 63;

/// 20 us at the lowest resolution (50 kS/s), twice as long with each index more.
double sample_time_ns(const U6StreamConfig& config) {
  constexpr double settling_us[] = {0.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0};
  const int steps = std::max(0, config.resolution_index - 1);
  const auto settling = static_cast<std::size_t>(std::clamp(config.settling, 0, 8));
  return 1e3 * (20.0 * std::exp2(steps) + settling_us[settling]);
}

}  // namespace

U6Stream::U6Stream(Sampler sampler, std::uint64_t seed)
    : sampler_(std::move(sampler)), random_(seed ^ 0x57EA3ULL) {}

void U6Stream::start(std::int64_t now_ns, double crystal_error) {
  running_ = true;
  start_ns_ = now_ns;
  interval_ns_ = 1e9 * config_->interval / config_->clock_hz / (1.0 + crystal_error);
  sample_ns_ = sample_time_ns(*config_);
  next_scan_ = 0;
  fifo_.clear();
  waiting_.clear();
  recovering_ = false;
  lost_now_ = lost_reported_ = 0;
  packets_ = 0;
  scans_.clear();
  faulty_.clear();
  scans_lost_ = recoveries_ = 0;
  const bool overlaps = sample_ns_ * static_cast<double>(config_->channels.size()) > interval_ns_;
  fatal_error_ = overlaps ? overlap_error : 0;
}

void U6Stream::stop() {
  running_ = false;
  fifo_.clear();
  waiting_.clear();
}

void U6Stream::power_up() {
  stop();
  stalled_ = false;
  config_.reset();
}

std::size_t U6Stream::packet_bytes() const {
  return config_ ? 14 + 2 * static_cast<std::size_t>(config_->samples_per_packet) : 64;
}

std::int64_t U6Stream::scan_time(std::uint64_t scan) const {
  return start_ns_ + std::llround(static_cast<double>(scan + 1) * interval_ns_);
}

void U6Stream::sample_until(std::int64_t now_ns) {
  while (running_ && fatal_error_ == 0 && scan_time(next_scan_) <= now_ns) take_scan();
}

void U6Stream::take_scan() {
  U6Scan scan;
  scan.time_ns = scan_time(next_scan_);
  const auto& channels = config_->channels;
  std::vector<std::uint16_t> counts(channels.size());
  scan.volts.resize(channels.size());
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const auto later = std::llround(sample_ns_ * static_cast<double>(i));
    counts[i] = sampler_(channels[i], scan.time_ns + later, scan.volts[i]);
  }
  if (recovering_ || fifo_.size() + channels.size() > fifo_samples) {
    recovering_ = true;
    scan.lost = true;
    ++scans_lost_;
    if (++lost_now_ > 0xFFFF) fatal_error_ = recovery_overflow_error;
  } else {
    for (const std::uint16_t count : counts) fifo_.push_back({count, next_scan_, false});
  }
  scans_.push_back(std::move(scan));
  ++next_scan_;
}

void U6Stream::end_recovery() {
  recovering_ = false;
  ++recoveries_;
  lost_reported_ = lost_now_;
  lost_now_ = 0;
  for (std::size_t i = 0; i < config_->channels.size(); ++i) {
    fifo_.push_back({0xFFFF, next_scan_, i == 0});
  }
}

std::optional<Bytes> U6Stream::next_packet() {
  while (true) {
    if (stalled_) return std::nullopt;
    if (!waiting_.empty()) {
      Bytes packet = std::move(waiting_.front());
      waiting_.pop_front();
      return packet;
    }
    if (!running_) return std::nullopt;
    const auto wanted = static_cast<std::size_t>(config_->samples_per_packet);
    if (recovering_ && fifo_.size() < wanted && fatal_error_ == 0) end_recovery();
    if (fifo_.size() < wanted && fatal_error_ == 0) return std::nullopt;
    const std::uint64_t number = packets_;
    Bytes packet = make_packet();
    const auto fault = fault_of(number);
    const bool sent = !fault || apply(*fault, packet);
    if (fault) faulty_.push_back({number, *fault, first_of_packet_, last_of_packet_});
    if (sent) waiting_.push_back(std::move(packet));
  }
}

Bytes U6Stream::make_packet() {
  Bytes packet(packet_bytes());
  std::uint8_t error = recovering_ ? recovering_error : 0;
  std::uint16_t discarded = 0;
  first_of_packet_ = last_of_packet_ = fifo_.empty() ? next_scan_ : fifo_.front().scan;
  for (std::size_t at = 12; at + 2 < packet.size(); at += 2) {
    Sample sample{0xFFFF, next_scan_, false};
    if (!fifo_.empty()) {
      sample = fifo_.front();
      fifo_.pop_front();
    }
    if (sample.begins_dummy) {
      error = recovered_error;
      discarded = static_cast<std::uint16_t>(lost_reported_);
    }
    last_of_packet_ = sample.scan;
    u6::put16(packet, at, sample.counts);
  }
  if (fatal_error_ != 0 && fifo_.empty()) {
    error = fatal_error_;
    running_ = false;
  }
  packet[1] = 0xF9;
  packet[3] = 0xC0;
  u6::put16(packet, 6, discarded);
  packet[10] = static_cast<std::uint8_t>(packets_++);
  packet[11] = error;
  packet[packet.size() - 2] =
      static_cast<std::uint8_t>(std::min<std::size_t>(255, fifo_.size() * 256 / fifo_samples));
  u6::seal_extended(packet);
  return packet;
}

std::optional<U6StreamFault> U6Stream::fault_of(std::uint64_t packet) {
  if (const auto found = scheduled_.find(packet); found != scheduled_.end()) {
    const U6StreamFault fault = found->second;
    scheduled_.erase(found);
    return fault;
  }
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (std::size_t kind = 0; kind < u6_stream_fault_kinds; ++kind) {
    if (chance_[kind] > 0.0 && uniform(random_) < chance_[kind]) {
      return static_cast<U6StreamFault>(kind);
    }
  }
  return std::nullopt;
}

bool U6Stream::apply(U6StreamFault fault, Bytes& packet) {
  switch (fault) {
    case U6StreamFault::bad_checksum8:
      packet[0] = static_cast<std::uint8_t>(packet[0] ^ 0x5AU);
      return true;
    case U6StreamFault::bad_checksum16:
      packet[12] = static_cast<std::uint8_t>(packet[12] ^ 0x10U);
      return true;
    case U6StreamFault::short_packet:
      packet.resize(std::min<std::size_t>(40, packet.size() - 2));
      return true;
    case U6StreamFault::lost:
      return false;
    case U6StreamFault::repeated:
      waiting_.push_back(packet);
      return true;
    case U6StreamFault::stall:
      stalled_ = true;
      return true;
  }
  return true;
}

}  // namespace stickslip::emulated
