// SPDX-License-Identifier: Apache-2.0
#include "protocol/frame_block.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "protocol/checksum.h"

namespace stickslip::protocol {

namespace {

// The channel arrays of a block in the order of Channel.
template <class Block>
auto columns_of(Block& block) {
  return std::array{&block.displacement_m, &block.velocity_m_s,        &block.friction_force_n,
                    &block.normal_load_n,  &block.base_displacement_m, &block.drive_force_n};
}

void add_big_endian(Checksum& sum, std::uint32_t word) {
  for (unsigned shift = 32; shift > 0; shift -= 8) {
    sum.add(static_cast<std::uint8_t>(word >> (shift - 8U)));
  }
}

/// Writes numbers as LCM does, most significant byte first.
class Writer {
 public:
  explicit Writer(std::uint8_t* at) : at_(at) {}
  void put8(std::uint8_t value) { *at_++ = value; }
  void put32(std::uint32_t value) { put(__builtin_bswap32(value)); }
  void put64(std::uint64_t value) { put(__builtin_bswap64(value)); }

 private:
  static_assert(std::endian::native == std::endian::little);
  template <class Word>
  void put(Word word) {
    std::memcpy(at_, &word, sizeof word);
    at_ += sizeof word;
  }
  std::uint8_t* at_;
};

/// Ages are rare: only channels with ages are encoded.
void ages_to_block(std::span<const Frame> frames, frame_block_t& block) {
  block.aged_channel.clear();
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    const bool any = std::any_of(frames.begin(), frames.end(),
                                 [c](const Frame& frame) { return frame.age_us[c] != 0; });
    if (any) block.aged_channel.push_back(static_cast<std::uint8_t>(c));
  }
  block.aged = static_cast<std::int32_t>(block.aged_channel.size());
  block.age_us.resize(block.aged_channel.size());
  for (std::size_t row = 0; row < block.aged_channel.size(); ++row) {
    block.age_us[row].resize(frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      block.age_us[row][i] = frames[i].age_us[block.aged_channel[row]];
    }
  }
}

/// True if the ages of a block agree with its counts, each channel once.
bool ages_are_sound(const frame_block_t& block) {
  const auto rows = static_cast<std::size_t>(std::max(0, block.aged));
  if (block.aged < 0 || block.aged_channel.size() != rows || block.age_us.size() != rows) {
    return false;
  }
  unsigned seen = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    const unsigned channel = block.aged_channel[row];
    if (channel >= channel_count || (seen >> channel & 1U) != 0) return false;
    seen |= 1U << channel;
    if (block.age_us[row].size() != static_cast<std::size_t>(block.count)) return false;
  }
  return true;
}

}  // namespace

void to_block(std::span<const Frame> frames, frame_block_t& block) {
  const std::size_t n = frames.size();
  block.count = static_cast<std::int32_t>(n);
  block.flags = 0;
  block.time_ns.resize(n);
  block.sequence.resize(n);
  block.valid.resize(n);
  const auto columns = columns_of(block);
  for (auto* column : columns) column->resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Frame& frame = frames[i];
    block.time_ns[i] = frame.time_ns;
    block.sequence[i] = static_cast<std::int64_t>(frame.sequence);
    block.valid[i] = frame.valid;
    for (std::size_t c = 0; c < channel_count; ++c) (*columns[c])[i] = frame.value[c];
  }
  ages_to_block(frames, block);
  // In the order of the wire.
  Checksum sum;
  for (const std::int64_t time : block.time_ns) sum.add_encoded(time);
  for (const std::int64_t number : block.sequence) sum.add_encoded(number);
  sum.add(std::span(block.valid));
  for (const auto* column : columns) {
    for (const double value : *column) sum.add_encoded(value);
  }
  add_big_endian(sum, static_cast<std::uint32_t>(block.aged));
  sum.add(std::span(block.aged_channel));
  for (const auto& ages : block.age_us) {
    for (const std::int32_t age : ages) add_big_endian(sum, static_cast<std::uint32_t>(age));
  }
  block.checksum = static_cast<std::int32_t>(sum.value());
}

void encode_block(std::span<const Frame> frames, std::int32_t flags,
                  std::vector<std::uint8_t>& bytes) {
  std::array<std::uint8_t, channel_count> aged{};
  std::size_t rows = 0;
  for (std::size_t c = 0; c < channel_count; ++c) {
    const bool any = std::any_of(frames.begin(), frames.end(),
                                 [c](const Frame& frame) { return frame.age_us[c] != 0; });
    if (any) aged[rows++] = static_cast<std::uint8_t>(c);
  }
  const std::size_t n = frames.size();
  constexpr std::size_t before_the_sum = 8 + 3 * 4;
  bytes.resize(before_the_sum + n * (2 * 8 + 1 + channel_count * 8) + 4 + rows * (1 + 4 * n));

  Writer out(bytes.data());
  out.put64(static_cast<std::uint64_t>(frame_block_t::getHash()));
  out.put32(static_cast<std::uint32_t>(n));
  out.put32(static_cast<std::uint32_t>(flags));
  out.put32(0);  // checksum, filled in below
  for (const Frame& frame : frames) out.put64(static_cast<std::uint64_t>(frame.time_ns));
  for (const Frame& frame : frames) out.put64(frame.sequence);
  for (const Frame& frame : frames) out.put8(frame.valid);
  for (std::size_t c = 0; c < channel_count; ++c) {
    for (const Frame& frame : frames) out.put64(std::bit_cast<std::uint64_t>(frame.value[c]));
  }
  out.put32(static_cast<std::uint32_t>(rows));
  for (std::size_t row = 0; row < rows; ++row) out.put8(aged[row]);
  for (std::size_t row = 0; row < rows; ++row) {
    for (const Frame& frame : frames) {
      out.put32(static_cast<std::uint32_t>(frame.age_us[aged[row]]));
    }
  }
  Checksum sum;
  sum.add(std::span<const std::uint8_t>(bytes).subspan(before_the_sum));
  Writer(bytes.data() + before_the_sum - 4).put32(sum.value());
}

bool from_block(const frame_block_t& block, std::vector<Frame>& frames) {
  if (block.count < 0) return false;
  const auto n = static_cast<std::size_t>(block.count);
  const auto columns = columns_of(block);
  if (block.time_ns.size() != n || block.sequence.size() != n || block.valid.size() != n)
    return false;
  for (const auto* column : columns) {
    if (column->size() != n) return false;
  }
  if (!ages_are_sound(block)) return false;
  for (std::size_t i = 0; i < n; ++i) {
    Frame frame;
    frame.time_ns = block.time_ns[i];
    frame.sequence = static_cast<std::uint64_t>(block.sequence[i]);
    for (const Channel channel : all_channels) {
      const double value = (*columns[index_of(channel)])[i];
      const bool measured = (block.valid[i] >> index_of(channel) & 1U) != 0;
      if (measured && std::isfinite(value)) frame.set(channel, value);
    }
    for (std::size_t row = 0; row < block.aged_channel.size(); ++row) {
      const Channel channel = all_channels[block.aged_channel[row]];
      if (frame.has(channel)) frame.age_us[index_of(channel)] = block.age_us[row][i];
    }
    frames.push_back(frame);
  }
  return true;
}

}  // namespace stickslip::protocol
