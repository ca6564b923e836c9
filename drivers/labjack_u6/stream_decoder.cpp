// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/stream_decoder.h"

#include <algorithm>

#include "drivers/labjack_u6/protocol.h"

namespace stickslip::drivers::labjack_u6 {

namespace {

constexpr std::size_t samples_at = 12;
constexpr std::uint8_t overflow_drains = 59;
constexpr std::uint8_t overflow_is_over = 60;
constexpr std::uint8_t overflow_not_counted = 63;
constexpr std::uint16_t dummy_count = 0xFFFF;

}  // namespace

StreamDecoder::StreamDecoder(int channels, int samples_per_packet)
    : channels_(static_cast<std::size_t>(std::clamp(channels, 1, max_channels))),
      samples_per_packet_(
          static_cast<std::size_t>(std::clamp(samples_per_packet, 1, max_samples_per_packet))) {}

StreamDecoder::Outcome StreamDecoder::take(std::span<const std::uint8_t> packet) {
  scan_count_ = 0;
  if (uncountable_) return Outcome::uncountable;
  if (!is_valid(packet)) {
    // Its counter is unreliable too: the next valid packet shows what is missing.
    ++counts_.damaged;
    return Outcome::damaged;
  }
  const std::uint8_t counter = packet[10];
  if (started_ && counter == static_cast<std::uint8_t>(next_counter_ - 1U)) {
    ++counts_.repeated;
    return Outcome::repeated;
  }
  const auto lost = static_cast<std::uint8_t>(counter - next_counter_);
  started_ = true;
  next_counter_ = static_cast<std::uint8_t>(counter + 1U);
  ++counts_.packets;
  counts_.packets_lost += lost;
  error_ = packet[11];
  backlog_ = packet[samples_at + 2 * samples_per_packet_];
  skip(lost * samples_per_packet_);
  return take_samples(packet.subspan(samples_at, 2 * samples_per_packet_),
                      static_cast<std::uint16_t>(packet[6] | packet[7] << 8));
}

bool StreamDecoder::is_valid(std::span<const std::uint8_t> packet) const {
  if (packet.size() != packet_bytes()) return false;
  const std::uint16_t sum = checksum16(packet.subspan(6));
  return packet[0] == checksum8(packet.subspan(1, 5)) && packet[1] == 0xF9 &&
         packet[2] == 4 + samples_per_packet_ && packet[3] == 0xC0 && packet[4] == (sum & 0xFFU) &&
         packet[5] == sum >> 8U;
}

StreamDecoder::Outcome StreamDecoder::take_samples(Samples samples,
                                                   std::uint16_t scans_thrown_away) {
  switch (error_) {
    case 0:
      // The board's report of the discarded scans was in a lost packet.
      if (overflowing_) return give_up();
      break;
    case overflow_drains:
      if (!overflowing_) ++counts_.overflows;
      overflowing_ = true;
      break;
    case overflow_is_over:
      return take_recovery(samples, scans_thrown_away);
    case overflow_not_counted:
      return give_up();
    default:
      skip(samples_per_packet_);
      return Outcome::error;
  }
  std::size_t at = 0;
  for (; dummy_rest_ > 0 && at < samples_per_packet_; ++at, --dummy_rest_) {
    if (sample(samples, at) != dummy_count && !dummy_seen_) return give_up();
  }
  for (; at < samples_per_packet_; ++at) put(sample(samples, at));
  return Outcome::ok;
}

StreamDecoder::Outcome StreamDecoder::take_recovery(Samples samples,
                                                    std::uint16_t scans_thrown_away) {
  if (!overflowing_) ++counts_.overflows;
  overflowing_ = false;
  // Two recoveries without a scan between them cannot be resolved.
  const Dummies dummies = find_dummies(samples);
  if (dummy_rest_ > 0 || scans_thrown_away == 0 || dummies.first == dummies.end) return give_up();
  counts_.overflow_losses += scans_thrown_away;
  for (std::size_t at = 0; at < dummies.first; ++at) put(sample(samples, at));
  // One of the candidates marks the discarded scans. Scans of saturated inputs look the same, so
  // none of the candidates is used.
  index_ += (dummies.end - dummies.first) / channels_ - 1U + scans_thrown_away;
  dummy_seen_ = dummies.whole;
  dummy_rest_ = dummies.end > samples_per_packet_ ? dummies.end - samples_per_packet_ : 0;
  for (std::size_t at = dummies.end; at < samples_per_packet_; ++at) put(sample(samples, at));
  return Outcome::ok;
}

StreamDecoder::Dummies StreamDecoder::find_dummies(Samples samples) const {
  Dummies dummies;
  for (std::size_t first = (channels_ - channel_) % channels_; first < samples_per_packet_;
       first += channels_) {
    const std::size_t end = first + channels_;
    if (!all_ones(samples, first, std::min(end, samples_per_packet_))) continue;
    if (dummies.first == dummies.end) dummies.first = first;
    dummies.end = end;
    dummies.whole = dummies.whole || end <= samples_per_packet_;
  }
  return dummies;
}

bool StreamDecoder::all_ones(Samples samples, std::size_t first, std::size_t end) const {
  for (std::size_t at = first; at < end; ++at) {
    if (sample(samples, at) != dummy_count) return false;
  }
  return true;
}

std::uint16_t StreamDecoder::sample(Samples samples, std::size_t at) const {
  return static_cast<std::uint16_t>(samples[2 * at] | samples[2 * at + 1] << 8);
}

void StreamDecoder::skip(std::uint64_t samples) {
  const std::uint64_t dummy = std::min<std::uint64_t>(samples, dummy_rest_);
  dummy_rest_ -= dummy;
  samples -= dummy;
  if (samples == 0) return;
  const std::uint64_t at = channel_ + samples;
  index_ += at / channels_;
  channel_ = at % channels_;
  partial_whole_ = false;  // put() restarts with the first channel
}

void StreamDecoder::put(std::uint16_t count) {
  if (channel_ == 0) partial_whole_ = true;
  partial_.counts[channel_] = count;
  if (++channel_ < channels_) return;
  channel_ = 0;
  if (partial_whole_) complete();
  ++index_;
}

void StreamDecoder::complete() {
  partial_.index = index_;
  scans_[scan_count_++] = partial_;
  ++counts_.scans;
  counts_.scans_lost += index_ - next_index_;
  next_index_ = index_ + 1;
}

StreamDecoder::Outcome StreamDecoder::give_up() {
  uncountable_ = true;
  scan_count_ = 0;
  return Outcome::uncountable;
}

}  // namespace stickslip::drivers::labjack_u6
