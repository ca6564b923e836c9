// SPDX-License-Identifier: Apache-2.0
// Round trips of random frames through both forms, to the bit.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <stdlib.h>

#include <bit>
#include <cmath>
#include <sstream>

#include "physics/unsigned_zero.h"
#include "protocol/recording.h"
#include "tests/unit/protocol/files.h"

namespace stickslip::protocol {
namespace {

// The same cases in every run, unless RC_PARAMS is set.
const bool seeded = setenv("RC_PARAMS", "seed=7667", 0) == 0;

double any_finite() {
  const double value = std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>());
  return std::isfinite(value) ? value : -0.0;
}

Recording any_recording() {
  Recording out;
  std::int64_t time =
      *rc::gen::inRange<std::int64_t>(-4'000'000'000'000'000'000, 4'000'000'000'000'000'000);
  std::uint64_t sequence = *rc::gen::inRange<std::uint64_t>(0, 1ULL << 62U);
  const auto channels = *rc::gen::inRange<unsigned>(1, 1U << channel_count);
  const int count = *rc::gen::inRange(1, 40);
  for (int i = 0; i < count; ++i) {
    Frame frame;
    frame.time_ns = time;
    frame.sequence = sequence;
    const auto held = channels & *rc::gen::inRange<unsigned>(0, 1U << channel_count);
    for (const Channel channel : all_channels) {
      if ((held >> index_of(channel) & 1U) != 0) frame.set(channel, any_finite());
    }
    out.channels = static_cast<std::uint8_t>(out.channels | frame.valid);
    out.frames.push_back(frame);
    time += *rc::gen::inRange<std::int64_t>(1, 3'000'000'000'000'000);
    sequence += *rc::gen::inRange<std::uint64_t>(1, 1000);
  }
  RC_PRE(out.channels != 0);  // a CSV file without channels is none
  return out;
}

// Comparison of doubles does not distinguish -0 from 0.
bool same_bits(const Frame& a, const Frame& b) {
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (std::bit_cast<std::uint64_t>(a.value[c]) != std::bit_cast<std::uint64_t>(b.value[c])) {
      return false;
    }
  }
  return a == b;
}

bool same_bits(const std::vector<Frame>& a, const std::vector<Frame>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Frame& x, const Frame& y) { return same_bits(x, y); });
}

/// Without what CSV does not keep: sequence numbers, and the sign of a zero.
std::vector<Frame> as_in_csv(std::vector<Frame> frames) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].sequence = i;
    for (double& value : frames[i].value) value = physics::unsigned_zero(value);
  }
  return frames;
}

std::string csv_of(const Recording& recording) {
  std::ostringstream out;
  write_csv(recording, out);
  return out.str();
}

RC_GTEST_PROP(RoundTrip, CsvPreservesFramesExactlyExceptSequenceNumbers, ()) {
  const Recording before = any_recording();
  const std::string text = csv_of(before);
  const Recording after = parse_csv(text, "t");
  RC_ASSERT(same_bits(after.frames, as_in_csv(before.frames)));
  RC_ASSERT(after.channels == before.channels);
  RC_ASSERT(csv_of(after) == text);
}

RC_GTEST_PROP(RoundTrip, LogPreservesFramesExactly, ()) {
  const Folder folder;
  const Recording before = any_recording();
  write_log(before, folder / "r.log", *rc::gen::inRange<std::size_t>(1, 50));
  const Recording after = read_recording(folder / "r.log");
  RC_ASSERT(same_bits(after.frames, before.frames));
  RC_ASSERT(after.channels == before.channels);
}

RC_GTEST_PROP(RoundTrip, CsvAndLogAreTheSameRecording, ()) {
  const Folder folder;
  const Recording before = any_recording();
  write_recording(before, folder / "a.csv");
  write_recording(read_recording(folder / "a.csv"), folder / "b.log");
  write_recording(read_recording(folder / "b.log"), folder / "c.csv");
  write_recording(read_recording(folder / "c.csv"), folder / "d.lcm");
  RC_ASSERT(content(folder / "a.csv") == content(folder / "c.csv"));
  RC_ASSERT(content(folder / "b.log") == content(folder / "d.lcm"));
  const Recording csv = read_recording(folder / "c.csv");
  const Recording log = read_recording(folder / "d.lcm");
  RC_ASSERT(same_bits(csv.frames, log.frames));
  RC_ASSERT(csv.channels == log.channels);
  RC_ASSERT(csv.description == log.description);
}

}  // namespace
}  // namespace stickslip::protocol
