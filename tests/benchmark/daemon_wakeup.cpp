// SPDX-License-Identifier: Apache-2.0
// Wake-up lateness of the loop at 1 kHz, compared with cyclictest (rt-tests) on the same machine,
// alternating within one run, so that the ratio is valid on any machine.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "daemon/loop.h"
#include "daemon/realtime.h"
#include "drivers/driver.h"

namespace stickslip::daemon {
namespace {

constexpr int priority = 50;
constexpr std::uint64_t cycles = 3000;

/// A device that answers immediately.
class Instant final : public drivers::Driver {
 public:
  Instant() {
    description_.name = "instant";
    description_.channels = 0b11111;
    description_.can_drive = true;
  }
  drivers::Result open() override { return {}; }
  drivers::Result start() override { return {}; }
  drivers::Result read(Frame& frame) override {
    frame = Frame();
    frame.sequence = next_++;
    frame.time_ns = static_cast<std::int64_t>(frame.sequence) * 1'000'000;
    for (std::size_t i = 0; i + 1 < channel_count; ++i) frame.set(all_channels.at(i), 0.001);
    return {};
  }
  drivers::Result write(const drivers::Actuation& /*actuation*/) override { return {}; }
  void stop() noexcept override {}
  void close() noexcept override {}
  const drivers::Description& description() const override { return description_; }

 private:
  std::uint64_t next_ = 0;
  drivers::Description description_;
};

struct Lateness {
  double p50_us = 0.0;
  double p99_us = 0.0;
  double longest_us = 0.0;
};

Lateness of_the_loop() {
  Instant device;
  MonotonicClock clock;
  Ledger ledger;
  config::Excitation drive;
  drive.enabled = true;
  drive.amplitude = 0.001;
  LoopSettings settings;
  settings.frames = cycles;
  settings.start_at_once = true;
  Loop loop(device, clock, settings, Excitation(drive), nullptr, ledger, {});
  lock_memory();
  ProcessorLatencyRequest awake;
  awake.request();
  std::thread thread([&loop] {
    prefault(256UL << 10U);
    make_thread_real_time(priority);
    loop.run();
  });
  thread.join();
  const DurationHistogram& lateness = loop.timing().lateness;
  return {static_cast<double>(lateness.quantile_ns(0.5)) * 1e-3,
          static_cast<double>(lateness.quantile_ns(0.99)) * 1e-3,
          static_cast<double>(lateness.longest_ns()) * 1e-3};
}

/// Counts of cyclictest's histogram by microsecond; empty without cyclictest.
std::vector<std::uint64_t> cyclictest() {
  const std::string command = "cyclictest -q -m -t1 -p" + std::to_string(priority) + " -i1000 -l" +
                              std::to_string(cycles) + " -h20000 2>/dev/null";
  std::FILE* const out = popen(command.c_str(), "r");
  std::vector<std::uint64_t> counts;
  if (out == nullptr) return counts;
  std::array<char, 256> line{};
  while (std::fgets(line.data(), static_cast<int>(line.size()), out) != nullptr) {
    unsigned us = 0;
    unsigned long long count = 0;
    if (line[0] == '#' || std::sscanf(line.data(), "%u %llu", &us, &count) != 2) continue;
    counts.resize(std::max<std::size_t>(counts.size(), us + std::size_t{1}));
    counts[us] = count;
  }
  pclose(out);
  return counts;
}

Lateness of_cyclictest(const std::vector<std::uint64_t>& counts) {
  std::uint64_t total = 0;
  for (const std::uint64_t count : counts) total += count;
  Lateness out;
  std::uint64_t seen = 0;
  for (std::size_t us = 0; us < counts.size(); ++us) {
    if (counts[us] == 0) continue;
    const auto edge = static_cast<double>(us + 1);
    if (seen * 2 < total) out.p50_us = edge;
    if (seen * 100 < total * 99) out.p99_us = edge;
    out.longest_us = edge;
    seen += counts[us];
  }
  return out;
}

void wakeup(benchmark::State& state) {
  Lateness ours;
  Lateness theirs;
  double rounds = 0.0;
  for ([[maybe_unused]] auto _ : state) {
    const std::vector<std::uint64_t> counts = cyclictest();
    if (counts.empty()) {
      state.SetLabel("no cyclictest: install rt-tests, and allow SCHED_FIFO");
    }
    const Lateness their = of_cyclictest(counts);
    const Lateness our = of_the_loop();
    ours.p50_us += our.p50_us;
    ours.p99_us += our.p99_us;
    ours.longest_us = std::max(ours.longest_us, our.longest_us);
    theirs.p50_us += their.p50_us;
    theirs.p99_us += their.p99_us;
    theirs.longest_us = std::max(theirs.longest_us, their.longest_us);
    rounds += 1.0;
  }
  state.counters["p50_us"] = ours.p50_us / rounds;
  state.counters["p99_us"] = ours.p99_us / rounds;
  state.counters["longest_us"] = ours.longest_us;
  state.counters["cyclictest_p50_us"] = theirs.p50_us / rounds;
  state.counters["cyclictest_p99_us"] = theirs.p99_us / rounds;
  state.counters["cyclictest_longest_us"] = theirs.longest_us;
  if (theirs.p99_us > 0.0) state.counters["p99_ratio"] = ours.p99_us / theirs.p99_us;
}

BENCHMARK(wakeup)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stickslip::daemon

BENCHMARK_MAIN();
