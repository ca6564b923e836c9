// SPDX-License-Identifier: Apache-2.0
// Small logs like those of a daemon, in memory.
#pragma once

#include <cstdint>
#include <sstream>
#include <stickslip/status_t.hpp>
#include <string>
#include <vector>

#include "protocol/channels.h"
#include "protocol/frame_block.h"
#include "protocol/recording_log.h"
#include "tests/unit/protocol/files.h"

namespace stickslip::protocol {

template <class Message>
std::vector<std::uint8_t> bytes_of(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

inline std::vector<Frame> frames_from(std::uint64_t first, std::size_t count) {
  std::vector<Frame> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    out[i].sequence = first + i;
    out[i].time_ns = static_cast<std::int64_t>(out[i].sequence) * 1'000'000;
    out[i].set(Channel::displacement, 0.001 * static_cast<double>(out[i].sequence % 100));
    if (out[i].sequence % 2 == 0) out[i].set(Channel::friction_force, -1.0);
  }
  return out;
}

/// A recording of a daemon, or one part of it.
struct LogOfADaemon {
  std::int32_t part = 0;
  std::uint64_t first = 0;  ///< sequence number of the first frame
  std::size_t frames = 50;
  bool closed = true;
  std::int64_t lost = 0;  ///< to a full ring
  std::int64_t started_utc_us = 1'720'000'000'000'000;

  void write(const std::filesystem::path& file) const {
    Description description{started_utc_us, "bench",   "stickslipd",
                            "0.1.0",        "[rig]\n", "schema = 1\n"};
    description.part = part;
    description.frames_before = static_cast<std::int64_t>(first);
    if (part > 0) description.previous_part = "previous.log";
    LogWriter writer(file);
    bool good =
        writer.append(recording_channel, bytes_of(info_of(description, -1)), started_utc_us);
    const std::vector<Frame> all = frames_from(first, frames);
    frame_block_t block;
    status_t status{};
    status.state = "running";
    status.recording = 1;
    status.record_loss_count = 2;
    status.record_loss_name = {"ring full", "write error"};
    status.record_loss = {lost, 0};
    for (std::size_t i = 0; i < frames; i += 10) {
      const auto some = std::span(all).subspan(i, std::min<std::size_t>(10, frames - i));
      to_block(some, block);
      good = good && writer.append(frames_channel, bytes_of(block), some.back().time_ns / 1000);
    }
    status.recorded = static_cast<std::int64_t>(first + frames);
    status.produced = status.recorded + lost + (closed ? 0 : 7);
    good = good && writer.append(status_channel, bytes_of(status), 0) && writer.close();
    ASSERT_TRUE(good);
  }

  std::string text() const {
    const Folder folder;
    write(folder / "r.log");
    return content(folder / "r.log");
  }
};

}  // namespace stickslip::protocol
