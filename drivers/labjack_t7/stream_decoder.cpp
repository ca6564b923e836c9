// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/stream_decoder.h"

#include <algorithm>

namespace stickslip::drivers::labjack_t7 {

namespace {

constexpr std::uint16_t marker_count = 0xFFFF;
// A larger gap is no loss: the board was restarted, or the number is wrong.
constexpr std::uint16_t most_packets_lost = 1000;

}  // namespace

StreamDecoder::StreamDecoder(int channels, int samples_per_packet)
    : channels_(static_cast<std::size_t>(std::clamp(channels, 1, max_channels))),
      samples_per_packet_(
          static_cast<std::size_t>(std::clamp(samples_per_packet, 1, largest_samples_per_packet))),
      scans_(largest_samples_per_packet + 1) {}

StreamDecoder::Outcome StreamDecoder::take(const StreamPacket& packet) {
  scan_count_ = 0;
  if (uncountable_) return Outcome::uncountable;
  const auto lost = static_cast<std::uint16_t>(packet.transaction - next_packet_);
  // A lost packet may have held the report of the skipped scans.
  if (lost > most_packets_lost || (lost > 0 && (overflowing_ || skipped_ > 0))) return give_up();
  next_packet_ = static_cast<std::uint16_t>(packet.transaction + 1U);
  status_ = packet.status;
  ++counts_.packets;
  lose(lost);
  if (status_ == auto_recovery_overflow) return give_up();
  if (status_ != 0 && status_ != auto_recovery_active && status_ != auto_recovery_end) {
    return Outcome::error;
  }
  if (!note_recovery(packet)) return give_up();
  const std::size_t samples =
      std::min<std::size_t>(packet.samples.size() / 2, largest_samples_per_packet);
  const Counts before = counts_;
  for (std::size_t at = 0; at < samples; ++at) {
    if (put(word_at(packet.samples, 2 * at))) continue;
    counts_ = before;  // no scan of this packet is used
    return give_up();
  }
  return Outcome::ok;
}

/// False: two recoveries without a marker between them.
bool StreamDecoder::note_recovery(const StreamPacket& packet) {
  if (packet.status == 0) return true;
  if (!overflowing_) ++counts_.overflows;
  overflowing_ = packet.status == auto_recovery_active;
  if (overflowing_) return true;
  if (skipped_ > 0) return false;
  skipped_ = packet.information;
  counts_.overflow_losses += skipped_;
  return skipped_ > 0;
}

void StreamDecoder::lose(std::uint64_t packets) {
  if (packets == 0) return;
  counts_.packets_lost += packets;
  const std::uint64_t at = channel_ + packets * samples_per_packet_;
  index_ += at / channels_;
  channel_ = at % channels_;
  partial_whole_ = false;  // put() restarts with the first channel
}

/// False for a marker without a report.
bool StreamDecoder::put(std::uint16_t count) {
  if (channel_ == 0) {
    partial_whole_ = true;
    marker_ = count == marker_count;
  }
  partial_.counts[channel_] = count;
  if (++channel_ < channels_) return true;
  channel_ = 0;
  if (marker_ && partial_whole_) {
    if (skipped_ == 0) return false;
    index_ += skipped_;
    skipped_ = 0;
    return true;
  }
  if (partial_whole_) complete();
  ++index_;
  return true;
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

}  // namespace stickslip::drivers::labjack_t7
