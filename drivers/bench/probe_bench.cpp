// SPDX-License-Identifier: Apache-2.0
#include "drivers/bench/probe_bench.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace stickslip::drivers {

namespace {

/// Running mean and standard deviation.
struct Moments {
  std::size_t count = 0;
  double mean = 0.0;
  double squares = 0.0;

  void add(double value) {
    ++count;
    const double step = value - mean;
    mean += step / static_cast<double>(count);
    squares += step * (value - mean);
  }
  double deviation() const {
    return count < 2 ? 0.0 : std::sqrt(squares / static_cast<double>(count - 1));
  }
};

class Deadline {
 public:
  Deadline(HostClock& clock, double duration_s)
      : clock_(clock), end_ns_(clock.now_ns() + static_cast<std::int64_t>(duration_s * 1e9)) {}
  bool over() const { return clock_.now_ns() >= end_ns_; }

 private:
  HostClock& clock_;
  std::int64_t end_ns_;
};

/// True if no later read can succeed.
bool fails(const Result& result) {
  return result.outcome != Outcome::ok && result.outcome != Outcome::no_data &&
         result.outcome != Outcome::temporary;
}

/// `moments`: one for each reading; `problem`: why a read failed, if it did.
void evaluate(ProbedDevice& probed, const std::vector<Moments>& moments,
              const std::string& problem) {
  for (std::size_t i = 0; i < moments.size(); ++i) {
    probed.readings[i].mean = moments[i].mean;
    probed.readings[i].standard_deviation = moments[i].deviation();
    probed.readings[i].readings = moments[i].count;
  }
  probed.ok = probed.message.empty();
  std::string silent;
  for (const ProbedInput& reading : probed.readings) {
    if (reading.readings == 0) silent += (silent.empty() ? "" : ", ") + reading.input;
  }
  if (!silent.empty() && probed.ok) {
    probed.ok = false;
    probed.message = "no valid reading from " + silent + (problem.empty() ? "" : ": ") + problem;
  }
}

void add_remark(ProbedDevice& probed, const std::string& remark) {
  if (!remark.empty()) probed.message += (probed.message.empty() ? "" : "; ") + remark;
}

void add_signals(ProbedDevice& probed, const Signals& signals) {
  if (signals.emergency_stop) {
    add_remark(probed, "the emergency stop is pressed, or its wire is cut");
  }
  if (signals.amplifier_fault) add_remark(probed, "the amplifier reports a fault");
}

ProbedDevice probe_board(Driver& board, const config::Bench& bench, HostClock& clock,
                         double duration_s) {
  const config::BenchInputs& inputs = bench.inputs;
  ProbedDevice probed;
  std::vector<Moments> moments;
  std::array<std::size_t, channel_count> place{};
  Result result = board.open();
  if (!result) probed.message = result.message;
  const Description& described = board.description();
  probed.name = described.name;
  for (const Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if ((described.channels >> i & 1U) == 0) continue;
    place[i] = probed.readings.size();
    probed.readings.push_back({inputs[i] ? inputs[i]->input : "", channel, 0.0, 0.0,
                               described.unit[i] != nullptr ? described.unit[i] : "", 0});
    moments.emplace_back();
  }
  if (result) {
    result = board.start();
    if (!result) probed.message = result.message;
  }
  const Deadline deadline(clock, duration_s);
  std::string problem;
  // A device that did not open is not read, even if opening it may succeed next time.
  while (probed.message.empty() && !deadline.over()) {
    Frame frame;
    result = board.read(frame);
    if (result.outcome == Outcome::temporary) problem = result.message;
    if (fails(result)) probed.message = result.message;
    if (!result) continue;
    for (const Channel channel : all_channels) {
      if (frame.has(channel)) moments[place[index_of(channel)]].add(frame[channel]);
    }
    // Replies to commands carry the lines, also replies to "off".
    static_cast<void>(board.write({bench.shaker.rest_v, false}));
  }
  evaluate(probed, moments, problem);
  if (probed.ok) add_signals(probed, board.signals());
  board.stop();
  board.close();
  return probed;
}

ProbedDevice probe_gauge(Gauge& gauge, const config::BenchInputs& inputs, HostClock& clock,
                         double duration_s) {
  ProbedDevice probed;
  probed.name = gauge.name();
  std::vector<Reading> readings(gauge.inputs().size());
  std::vector<std::int64_t> before(readings.size(), 0);
  std::vector<Moments> moments(readings.size());
  for (const GaugeInput& input : gauge.inputs()) {
    Channel channel = Channel::displacement;
    for (const Channel each : all_channels) {
      const auto& wanted = inputs[index_of(each)];
      if (wanted && wanted->device == input.device && wanted->input == input.name) channel = each;
    }
    probed.readings.push_back({input.name, channel, 0.0, 0.0, input.unit, 0});
  }
  Result result = gauge.open();
  if (!result) probed.message = result.message;
  const Deadline deadline(clock, duration_s);
  std::string problem;
  while (probed.message.empty() && !deadline.over()) {
    result = gauge.read(readings);
    if (result.outcome == Outcome::temporary) problem = result.message;
    if (fails(result)) probed.message = result.message;
    for (std::size_t i = 0; i < readings.size(); ++i) {
      if (!readings[i].valid || readings[i].time_ns == before[i]) continue;
      before[i] = readings[i].time_ns;
      moments[i].add(readings[i].value);
    }
  }
  evaluate(probed, moments, problem);
  if (probed.ok) {
    add_remark(probed, gauge.remark());
    add_signals(probed, gauge.signals());
  }
  gauge.close();
  return probed;
}

ProbedDevice probe_amplifier(Contacts& amplifier, HostClock& clock) {
  ProbedDevice probed;
  probed.name = "amplifier";
  const Result result = amplifier.open();
  if (!result) {
    probed.message = result.message;
    return probed;
  }
  // Long enough for one sample of the lines.
  constexpr std::int64_t sample_ns = 200'000'000;
  clock.sleep_until(clock.now_ns() + sample_ns);
  probed.ok = true;
  add_signals(probed, amplifier.signals());
  amplifier.close();
  return probed;
}

}  // namespace

std::vector<ProbedDevice> probe_bench(BenchParts parts, const config::Bench& bench,
                                      double duration_s) {
  HostClock& clock = *parts.clock;
  std::vector<ProbedDevice> out;
  // The contact first: one left closed by a crashed daemon opens before any output changes.
  if (parts.amplifier) out.push_back(probe_amplifier(*parts.amplifier, clock));
  out.push_back(probe_board(*parts.board, bench, clock, duration_s));
  for (const auto& gauge : parts.gauges) {
    out.push_back(probe_gauge(*gauge, bench.inputs, clock, duration_s));
  }
  return out;
}

}  // namespace stickslip::drivers
