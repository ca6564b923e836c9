// SPDX-License-Identifier: Apache-2.0
// Any bytes as a message of each type: refused, or decoded into a message whose encoding has as
// many bytes, or slightly more for earlier versions of a type.
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "protocol/decode.h"

namespace {

template <class Message>
void try_as(std::span<const std::uint8_t> bytes) {
  Message message{};
  if (!stickslip::protocol::decode(bytes, message)) return;
  constexpr int longest_growth = 10;
  const int growth = message.getEncodedSize() - static_cast<int>(bytes.size());
  if (growth < 0 || growth > longest_growth) {
    throw std::logic_error("a message decoded is of another size than its bytes");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stickslip;
  const std::span bytes(data, size);
  try_as<frame_block_t>(bytes);
  try_as<friction_estimate_t>(bytes);
  try_as<excitation_t>(bytes);
  try_as<status_t>(bytes);
  try_as<timing_t>(bytes);
  try_as<event_t>(bytes);
  try_as<recording_info_t>(bytes);
  try_as<recorder_t>(bytes);
  return 0;
}
