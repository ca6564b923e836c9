// SPDX-License-Identifier: Apache-2.0
#include "tools/spy/traffic.h"

#include <algorithm>

namespace stickslip::spy {

namespace {

void add_value(std::vector<Quantity>& quantities, std::string_view name, std::string_view unit,
               double value) {
  const auto known = std::find_if(quantities.begin(), quantities.end(),
                                  [name](const Quantity& each) { return each.name == name; });
  if (known == quantities.end()) {
    quantities.push_back({std::string(name), std::string(unit), value, value, value});
    return;
  }
  known->last = value;
  known->least = std::min(known->least, value);
  known->greatest = std::max(known->greatest, value);
}

void add_content(const Content& content, ChannelTraffic& seen) {
  for (const Frame& frame : content.frames) {
    seen.sequence.add(frame.sequence);
    for (const Channel channel : all_channels) {
      if (!frame.has(channel)) continue;
      add_value(seen.quantities, info(channel).stem, info(channel).unit, frame[channel]);
    }
  }
  for (const Reading& reading : content.readings) {
    add_value(seen.quantities, reading.name, reading.unit, reading.value);
  }
  if (content.degraded) ++seen.degraded_blocks;
  if (!content.summary.empty()) seen.summary = content.summary;
  seen.tone = content.tone;
}

}  // namespace

void Traffic::add(const std::string& channel, std::span<const std::uint8_t> bytes,
                  std::int64_t arrival_us) {
  Counted& counted = channels_[channel];
  ChannelTraffic& seen = counted.seen;
  if (seen.messages == 0) {
    seen.channel = channel;
  } else {
    const std::int64_t gap_us = arrival_us - seen.last_us;
    counted.shortest_us = counted.gaps == 0 ? gap_us : std::min(counted.shortest_us, gap_us);
    counted.longest_us = counted.gaps == 0 ? gap_us : std::max(counted.longest_us, gap_us);
    ++counted.gaps;
  }
  ++seen.messages;
  seen.bytes += bytes.size();
  seen.last_bytes = static_cast<std::uint32_t>(bytes.size());
  seen.last_us = arrival_us;
  seen.fingerprint = fingerprint_of(bytes);
  read_message(channel, bytes, content_);
  seen.type = content_.type;
  seen.is_frames = content_.type == "frame_block_t";
  if (content_.decoded) {
    add_content(content_, seen);
  } else if (!content_.type.empty()) {
    ++seen.undecoded;
  }
}

void Traffic::close_interval(double seconds) {
  for (auto& [name, counted] : channels_) {
    ChannelTraffic& seen = counted.seen;
    seen.rate_per_s = static_cast<double>(seen.messages - counted.messages_before) / seconds;
    seen.bytes_per_s = static_cast<double>(seen.bytes - counted.bytes_before) / seconds;
    seen.jitter_s.reset();
    if (counted.gaps > 1) {
      seen.jitter_s = static_cast<double>(counted.longest_us - counted.shortest_us) * 1e-6;
    }
    counted.messages_before = seen.messages;
    counted.bytes_before = seen.bytes;
    counted.gaps = 0;
  }
}

std::vector<const ChannelTraffic*> Traffic::channels() const {
  std::vector<const ChannelTraffic*> out;
  for (const auto& [name, counted] : channels_) out.push_back(&counted.seen);
  return out;
}

bool Traffic::has_frames() const {
  return std::any_of(channels_.begin(), channels_.end(),
                     [](const auto& each) { return each.second.seen.sequence.frames > 0; });
}

}  // namespace stickslip::spy
