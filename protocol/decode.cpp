// SPDX-License-Identifier: Apache-2.0
#include "protocol/decode.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "protocol/checksum.h"
#include "protocol/frame_block.h"

namespace stickslip::protocol {

namespace {

// Walks over an encoded message to check counts and lengths: the generated decoders check neither
// sign nor size of a count or of a text's length. Once outside the message it remains outside.
class Walk {
 public:
  explicit Walk(std::span<const std::uint8_t> bytes) : left_(bytes) { skip(8); }  // fingerprint

  bool inside() const { return inside_; }

  void skip(std::size_t bytes) {
    inside_ = inside_ && bytes <= left_.size();
    if (inside_) left_ = left_.subspan(bytes);
  }

  std::int64_t int32() {
    if (left_.size() < 4) inside_ = false;
    if (!inside_) return 0;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8U | left_[i];
    skip(4);
    return static_cast<std::int32_t>(value);
  }

  /// Length and characters, the last of which is zero.
  void text() {
    const std::int64_t size = int32();
    inside_ = inside_ && size >= 1;
    if (inside_) skip(static_cast<std::size_t>(size));
  }

  /// Number of elements of arrays that together take at least `bytes` per element.
  std::size_t count(std::size_t bytes) {
    const std::int64_t claimed = int32();
    inside_ =
        inside_ && claimed >= 0 && static_cast<std::uint64_t>(claimed) <= left_.size() / bytes;
    return inside_ ? static_cast<std::size_t>(claimed) : 0;
  }

 private:
  std::span<const std::uint8_t> left_;
  bool inside_ = true;
};

// The generated decoders do not clear empty arrays, which would keep elements of an earlier
// message.
template <class Message>
void clear(Message& message) {
  message = Message{};
}

// Keeps the capacity of the arrays that every block has.
void clear(frame_block_t& message) { message.aged_channel.clear(); }

template <class Message>
bool decode_whole(std::span<const std::uint8_t> bytes, Message& message) {
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) return false;
  const int size = static_cast<int>(bytes.size());
  clear(message);
  return message.decode(bytes.data(), 0, size) == size;
}

constexpr std::size_t number = 8;
constexpr std::size_t shortest_text = 5;

using Fingerprint = std::array<std::uint8_t, 8>;

Fingerprint fingerprint_of(std::uint64_t hash) {
  Fingerprint out{};
  for (std::size_t i = 8; i > 0; --i, hash >>= 8U) out[i - 1] = static_cast<std::uint8_t>(hash);
  return out;
}

/// An earlier version of a type, without fields at the end.
struct Former {
  std::uint64_t hash;                   ///< its fingerprint
  std::span<const std::uint8_t> lacks;  ///< encoding of neutral values of those fields
};

constexpr std::array<std::uint8_t, 4> no_elements = {};
constexpr std::array<std::uint8_t, 10> two_empty_texts = {0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
constexpr std::array<std::uint8_t, 8> minus_one = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
constexpr std::array<std::uint8_t, 15 * 8> fifteen_zeros = {};
constexpr Former former_estimate = {0xEF306B050D44EA73U, fifteen_zeros};
constexpr Former former_excitation = {0xEF474DC1C55BAEC7U, no_elements};
constexpr Former former_status = {0xD60837B0454EEC63U, minus_one};
constexpr Former former_recording_info = {0x019FE800B2CECE78U, two_empty_texts};

/// A message of the former type converted to the current type; empty if it is neither.
template <class Message>
std::vector<std::uint8_t> brought_up(std::span<const std::uint8_t> bytes, const Former& former) {
  const Fingerprint before = fingerprint_of(former.hash);
  if (bytes.size() < before.size() || !std::equal(before.begin(), before.end(), bytes.begin())) {
    return {};
  }
  const Fingerprint now = fingerprint_of(static_cast<std::uint64_t>(Message::getHash()));
  std::vector<std::uint8_t> out(now.begin(), now.end());
  out.insert(out.end(), bytes.begin() + before.size(), bytes.end());
  out.insert(out.end(), former.lacks.begin(), former.lacks.end());
  return out;
}

}  // namespace

bool decode(std::span<const std::uint8_t> bytes, frame_block_t& message) {
  Walk walk(bytes);
  // time, sequence, validity, channels
  constexpr std::size_t frame_bytes = 2 * number + 1 + channel_count * number;
  const std::size_t n = walk.count(frame_bytes);
  if (!walk.inside() || n == 0 || n > longest_block) return false;
  walk.skip(4);  // flags
  const auto checksum = static_cast<std::uint32_t>(walk.int32());
  constexpr std::size_t before_the_sum = 8 + 3 * 4;
  walk.skip(n * frame_bytes);
  walk.count(1 + 4 * n);  // ages
  if (!walk.inside()) return false;
  Checksum sum;
  sum.add(bytes.subspan(before_the_sum));
  return sum.value() == checksum && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, friction_estimate_t& message) {
  const std::vector<std::uint8_t> present = brought_up<friction_estimate_t>(bytes, former_estimate);
  if (!present.empty()) bytes = present;
  Walk walk(bytes);
  // time, sequence, valid, and the eight numbers of the estimate
  walk.skip(2 * number + 1 + 8 * number);
  const std::size_t n = walk.count(shortest_text + 2 * number);
  for (std::size_t i = 0; i < n && walk.inside(); ++i) walk.text();
  // The covariance has n rows of n.
  return walk.inside() && n * n <= bytes.size() / number && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, excitation_t& message) {
  const std::vector<std::uint8_t> present = brought_up<excitation_t>(bytes, former_excitation);
  if (!present.empty()) bytes = present;
  Walk walk(bytes);
  walk.skip(2 * number + 5 * number + 2);
  walk.count(4 + number + 4 + 4 + 1);
  return walk.inside() && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, status_t& message) {
  const std::vector<std::uint8_t> present = brought_up<status_t>(bytes, former_status);
  if (!present.empty()) bytes = present;
  Walk walk(bytes);
  walk.skip(2 * number);
  for (int i = 0; i < 3; ++i) walk.text();
  walk.skip(1 + number);
  for (int ledger = 0; ledger < 2; ++ledger) {  // publishing, then recording
    walk.skip(1 + number);
    const std::size_t losses = walk.count(shortest_text + number);
    for (std::size_t i = 0; i < losses && walk.inside(); ++i) walk.text();
    walk.skip(losses * number);
  }
  return walk.inside() && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, timing_t& message) {
  Walk walk(bytes);
  walk.skip(2 * number);
  walk.count(4 * number);
  return walk.inside() && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, event_t& message) {
  Walk walk(bytes);
  walk.skip(3 * number + 1);
  for (int i = 0; i < 2; ++i) walk.text();
  return walk.inside() && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, recording_info_t& message) {
  const std::vector<std::uint8_t> present =
      brought_up<recording_info_t>(bytes, former_recording_info);
  if (!present.empty()) bytes = present;
  Walk walk(bytes);
  walk.skip(4 + number);
  for (int i = 0; i < 9; ++i) walk.text();
  walk.skip(4);  // part
  walk.text();
  walk.skip(2 * number);
  for (int i = 0; i < 2; ++i) walk.text();
  return walk.inside() && decode_whole(bytes, message);
}

bool decode(std::span<const std::uint8_t> bytes, recorder_t& message) {
  Walk walk(bytes);
  walk.skip(number);
  walk.text();
  return walk.inside() && decode_whole(bytes, message);
}

}  // namespace stickslip::protocol
