// SPDX-License-Identifier: Apache-2.0
// Fake devices, clocks and sinks, controlled by the test.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

#include "daemon/clock.h"
#include "daemon/stream.h"
#include "drivers/driver.h"

namespace stickslip::daemon::test {

/// Time advances only by the test, and by `cost_per_reading_ns` at each reading.
class FakeClock final : public Clock {
 public:
  std::int64_t now_ns() override {
    if (on_reading) on_reading();
    return now += cost_per_reading_ns;
  }
  void sleep_until(std::int64_t due_ns) override {
    if (due_ns > now) now = due_ns;
    now += oversleep_ns;
  }
  std::int64_t now = 1'000'000'000;
  std::int64_t cost_per_reading_ns = 0;
  std::int64_t oversleep_ns = 0;
  std::function<void()> on_reading;
};

/// A device with all channels and frames `period_ns` apart. `on_read` and `on_write` give the
/// outcome by the number of the call, from 0; default: ok.
class FakeDriver final : public drivers::Driver {
 public:
  explicit FakeDriver(bool stepped_time = false) {
    description_.stepped_time = stepped_time;
    description_.name = "fake";
    description_.channels = 0x3f;
    description_.can_drive = true;
  }
  drivers::Result open() override { return {}; }
  drivers::Result start() override {
    started = true;
    return start_result;
  }
  drivers::Result read(Frame& frame) override {
    const std::uint64_t call = reads++;
    const drivers::Result result = on_read ? on_read(call) : drivers::Result{};
    if (!result) return result;
    frame = Frame{};
    frame.time_ns = static_cast<std::int64_t>(sequence) * period_ns;
    frame.sequence = sequence++;
    for (Channel channel : all_channels) {
      frame.set(channel, static_cast<double>(frame.sequence) + 0.1 * static_cast<double>(channel));
    }
    if (on_frame) on_frame(frame);
    return result;
  }
  drivers::Result write(const drivers::Actuation& actuation) override {
    const std::uint64_t call = writes++;
    if (keep_actuations) actuations.push_back(actuation);
    last = actuation;
    return on_write ? on_write(call) : drivers::Result{};
  }
  void stop() noexcept override { stopped = true; }
  void close() noexcept override {}
  const drivers::Description& description() const override { return description_; }
  drivers::Signals signals() const noexcept override { return lines; }
  const char* left_on() const noexcept override { return left; }
  drivers::Counts counts() const noexcept override {
    drivers::Counts out;
    out.add({"fake", "losses", losses});
    return out;
  }

  drivers::Signals lines;
  std::function<drivers::Result(std::uint64_t)> on_read;
  std::function<drivers::Result(std::uint64_t)> on_write;
  std::function<void(Frame&)> on_frame;
  drivers::Result start_result;
  std::int64_t period_ns = 1'000'000;
  std::uint64_t sequence = 0;
  std::uint64_t reads = 0;
  std::uint64_t writes = 0;
  bool keep_actuations = true;
  std::vector<drivers::Actuation> actuations;
  drivers::Actuation last;
  std::uint64_t losses = 0;
  const char* left = nullptr;
  bool started = false;
  bool stopped = false;
  drivers::Description description_;
};

/// Stores everything written; `on_block` and `on_flush` give the result.
class FakeSink final : public Sink {
 public:
  WriteResult write_block(std::span<const Sample> block) override {
    const WriteResult result = on_block ? on_block(block) : WriteResult::ok;
    if (result == WriteResult::ok && keep)
      samples.insert(samples.end(), block.begin(), block.end());
    sizes.push_back(block.size());
    return result;
  }
  WriteResult write_estimate(const Estimate& estimate) override {
    estimates.push_back(estimate);
    return WriteResult::ok;
  }
  WriteResult write_message(const Message& message) override {
    messages.push_back(message);
    return WriteResult::ok;
  }
  bool flush() override { return !on_flush || on_flush(); }
  std::function<bool()> on_flush;
  std::function<WriteResult(std::span<const Sample>)> on_block;
  bool keep = true;
  std::vector<Sample> samples;
  std::vector<std::size_t> sizes;
  std::vector<Estimate> estimates;
  std::vector<Message> messages;
};

}  // namespace stickslip::daemon::test
