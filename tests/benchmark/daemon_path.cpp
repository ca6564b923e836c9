// SPDX-License-Identifier: Apache-2.0
// Cost of a frame on its whole path through the daemon - read, calibrate, observe, hand over,
// encode, publish on LCM, record - compared with a loop that only publishes the same blocks. Both
// in one run, as processor time of all threads, so that the ratio is valid on any machine.
//
// `ratio` is the whole path over the bare loop, `consumers_ratio` the cost added by publishing and
// recording, over the bare loop. Publishing should add at most 1.3.
//
// Publishes to LCM's multicast group: run it through tools/own-network.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <optional>
#include <stickslip/frame_block_t.hpp>
#include <vector>

#include "config/model_file.h"
#include "daemon/loop.h"
#include "daemon/message_writer.h"
#include "daemon/messages.h"
#include "drivers/factory/make_driver.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"

namespace stickslip::daemon {
namespace {

constexpr std::size_t frame_count = 100'000;
constexpr std::size_t frames_per_block = 10;

double seconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::vector<Frame> sines() {
  std::vector<Frame> frames(frame_count);
  for (std::size_t i = 0; i < frame_count; ++i) {
    frames[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
    frames[i].sequence = i;
    for (std::size_t c = 0; c + 1 < channel_count; ++c) {
      frames[i].set(all_channels[c],
                    std::sin(0.018 * static_cast<double>(i) + static_cast<double>(c)));
    }
  }
  return frames;
}

/// Processor seconds of publishing `frames` in blocks that are filled in advance.
double publish_only(const std::vector<Frame>& frames) {
  lcm::LCM lcm(protocol::default_url);
  frame_block_t block{};
  protocol::to_block(std::span(frames).first(frames_per_block), block);
  const double before = seconds(CLOCK_PROCESS_CPUTIME_ID);
  for (std::size_t i = 0; i < frames.size(); i += frames_per_block) {
    lcm.publish(protocol::frames_channel, &block);
  }
  return seconds(CLOCK_PROCESS_CPUTIME_ID) - before;
}

struct Cost {
  double processor_s = 0.0;
  double wall_s = 0.0;
  bool complete = false;
};

/// The whole path of `frames`, replayed as fast as possible without loss.
Cost whole_path(const std::vector<Frame>& frames, bool observe, bool publish, bool record) {
  config::Rig rig;
  rig.driver = config::DriverKind::replay;
  rig.replay.speed = 0.0;
  const auto driver = drivers::make_driver(rig, frames);
  driver->open();
  MonotonicClock clock;
  Ledger ledger;
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / "stickslip-benchmark.log";
  std::vector<std::unique_ptr<MessageWriter>> writers;
  std::vector<std::unique_ptr<MessageSink>> sinks;
  std::vector<std::unique_ptr<Stream>> streams;
  const auto add = [&](std::unique_ptr<MessageWriter> writer, Account& account) {
    writers.push_back(std::move(writer));
    sinks.push_back(std::make_unique<MessageSink>(*writers.back()));
    streams.push_back(std::make_unique<Stream>(*sinks.back(), account, StreamSettings{}));
  };
  if (publish) add(open_lcm(protocol::default_url), ledger.published());
  if (record) add(open_log(file), ledger.recorded());
  std::vector<Stream*> all;
  all.reserve(streams.size());
  for (const auto& stream : streams) all.push_back(stream.get());
  std::optional<Observer> observer;
  if (observe) {
    observer.emplace(config::load_model(STICKSLIP_SOURCE_DIR "/config/models/simulated.toml"),
                     1e-3);
  }
  LoopSettings settings;
  settings.pacing = Pacing::free_running;
  settings.live.interlocks.longest_silence_ns = 0;
  Loop loop(*driver, clock, settings, Excitation({}), observe ? &*observer : nullptr, ledger, all);

  const double cpu = seconds(CLOCK_PROCESS_CPUTIME_ID);
  const double wall = seconds(CLOCK_MONOTONIC);
  for (Stream* stream : all) stream->start();
  loop.run();
  for (Stream* stream : all) stream->finish(std::chrono::minutes(1));
  for (const auto& writer : writers) writer->close();
  const Cost out{seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu, seconds(CLOCK_MONOTONIC) - wall,
                 ledger.balance().is_closed() && ledger.balance().produced == frames.size() &&
                     ledger.balance().published.lost_in_total() == 0 &&
                     ledger.balance().recorded.lost_in_total() == 0};
  std::filesystem::remove(file);
  return out;
}

void path(benchmark::State& state, bool observe, bool publish, bool record) {
  const std::vector<Frame> frames = sines();
  double bare_s = 0.0;
  double without_s = 0.0;
  double path_s = 0.0;
  double wall_s = 0.0;
  for ([[maybe_unused]] auto _ : state) {
    bare_s += publish_only(frames);
    if (publish || record) without_s += whole_path(frames, observe, false, false).processor_s;
    const Cost cost = whole_path(frames, observe, publish, record);
    if (!cost.complete) state.SkipWithError("frames were lost");
    path_s += cost.processor_s;
    wall_s += cost.wall_s;
    state.SetIterationTime(cost.wall_s);
  }
  const double count = static_cast<double>(state.iterations()) * static_cast<double>(frame_count);
  state.counters["cpu_ns_per_frame"] = 1e9 * path_s / count;
  state.counters["bare_publish_ns_per_frame"] = 1e9 * bare_s / count;
  state.counters["ratio"] = path_s / bare_s;
  if (publish || record) state.counters["consumers_ratio"] = (path_s - without_s) / bare_s;
  state.counters["frames_per_s"] = count / wall_s;
}

BENCHMARK_CAPTURE(path, read_calibrate, false, false, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(path, read_calibrate_observe, true, false, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(path, read_calibrate_publish, false, true, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(path, read_calibrate_record, false, false, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(path, read_calibrate_publish_record, false, true, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(path, read_calibrate_observe_publish_record, true, true, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stickslip::daemon

BENCHMARK_MAIN();
