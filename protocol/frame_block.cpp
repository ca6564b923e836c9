#include "protocol/frame_block.h"

#include <cmath>

#include "protocol/checksum.h"

namespace stickslip::protocol {

namespace {

// The channel arrays of a block in the order of Channel.
template <class Block>
auto columns_of(Block& block) {
  return std::array{&block.displacement_m, &block.velocity_m_s,        &block.friction_force_n,
                    &block.normal_load_n,  &block.base_displacement_m, &block.drive_force_n};
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
  // In the order of the wire.
  Checksum sum;
  for (const std::int64_t time : block.time_ns) sum.add_encoded(time);
  for (const std::int64_t number : block.sequence) sum.add_encoded(number);
  sum.add(std::span(block.valid));
  for (const auto* column : columns) {
    for (const double value : *column) sum.add_encoded(value);
  }
  block.checksum = static_cast<std::int32_t>(sum.value());
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
  for (std::size_t i = 0; i < n; ++i) {
    Frame frame;
    frame.time_ns = block.time_ns[i];
    frame.sequence = static_cast<std::uint64_t>(block.sequence[i]);
    for (const Channel channel : all_channels) {
      const double value = (*columns[index_of(channel)])[i];
      const bool measured = (block.valid[i] >> index_of(channel) & 1U) != 0;
      if (measured && std::isfinite(value)) frame.set(channel, value);
    }
    frames.push_back(frame);
  }
  return true;
}

}  // namespace stickslip::protocol
