#include "drivers/bench/try_bench.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace stickslip::drivers {

namespace {

/// Mean and spread of numbers as they come.
struct Spread {
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
  Deadline(HostClock& clock, double patience_s)
      : clock_(clock), end_ns_(clock.now_ns() + static_cast<std::int64_t>(patience_s * 1e9)) {}
  bool over() const { return clock_.now_ns() >= end_ns_; }

 private:
  HostClock& clock_;
  std::int64_t end_ns_;
};

bool fails(const Result& result) {
  return result.outcome != Outcome::ok && result.outcome != Outcome::no_data &&
         result.outcome != Outcome::temporary;
}

/// `spreads`: one for each of its readings.
void judge(TriedDevice& tried, const std::vector<Spread>& spreads) {
  for (std::size_t i = 0; i < spreads.size(); ++i) {
    tried.readings[i].mean = spreads[i].mean;
    tried.readings[i].spread = spreads[i].deviation();
    tried.readings[i].readings = spreads[i].count;
  }
  tried.well = tried.words.empty();
  std::string silent;
  for (const FirstReading& reading : tried.readings) {
    if (reading.readings == 0) silent += (silent.empty() ? "" : ", ") + reading.input;
  }
  if (!silent.empty() && tried.well) {
    tried.well = false;
    tried.words = "nothing that could be believed came from " + silent;
  }
}

void say_signals(TriedDevice& tried, const Signals& signals) {
  if (signals.emergency_stop) {
    tried.words += tried.words.empty() ? "" : "; ";
    tried.words += "the emergency stop is pressed, or its wire is cut";
  }
  if (signals.amplifier_fault) {
    tried.words += tried.words.empty() ? "" : "; ";
    tried.words += "the amplifier reports a fault";
  }
}

TriedDevice try_board(Driver& board, const config::Bench& bench, HostClock& clock,
                      double patience_s) {
  const config::BenchInputs& inputs = bench.inputs;
  TriedDevice tried;
  std::vector<Spread> spreads;
  std::array<std::size_t, channel_count> place{};
  Result result = board.open();
  const Description& described = board.description();
  tried.name = described.name;
  for (const Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if ((described.channels >> i & 1U) == 0) continue;
    place[i] = tried.readings.size();
    tried.readings.push_back({inputs[i] ? inputs[i]->input : "", channel, 0.0, 0.0,
                              described.unit[i] != nullptr ? described.unit[i] : "", 0});
    spreads.emplace_back();
  }
  if (result) result = board.start();
  const Deadline deadline(clock, patience_s);
  while (!fails(result) && !deadline.over()) {
    Frame frame;
    result = board.read(frame);
    if (!result) continue;
    for (const Channel channel : all_channels) {
      if (frame.has(channel)) spreads[place[index_of(channel)]].add(frame[channel]);
    }
    // The lines come with the commands, also with those that say "off".
    static_cast<void>(board.write({bench.shaker.rest_v, false}));
  }
  if (fails(result)) tried.words = result.message;
  judge(tried, spreads);
  if (tried.well) say_signals(tried, board.signals());
  board.stop();
  board.close();
  return tried;
}

TriedDevice try_gauge(Gauge& gauge, const config::BenchInputs& inputs, HostClock& clock,
                      double patience_s) {
  TriedDevice tried;
  tried.name = gauge.name();
  std::vector<Reading> readings(gauge.inputs().size());
  std::vector<std::int64_t> before(readings.size(), 0);
  std::vector<Spread> spreads(readings.size());
  for (const GaugeInput& input : gauge.inputs()) {
    Channel channel = Channel::displacement;
    for (const Channel each : all_channels) {
      const auto& wanted = inputs[index_of(each)];
      if (wanted && wanted->device == input.device && wanted->input == input.name) channel = each;
    }
    tried.readings.push_back({input.name, channel, 0.0, 0.0, input.unit, 0});
  }
  Result result = gauge.open();
  const Deadline deadline(clock, patience_s);
  std::string trouble;
  while (!fails(result) && !deadline.over()) {
    result = gauge.read(readings);
    if (result.outcome == Outcome::temporary) trouble = result.message;
    for (std::size_t i = 0; i < readings.size(); ++i) {
      if (!readings[i].valid || readings[i].time_ns == before[i]) continue;
      before[i] = readings[i].time_ns;
      spreads[i].add(readings[i].value);
    }
  }
  if (fails(result)) tried.words = result.message;
  judge(tried, spreads);
  if (!tried.well && !trouble.empty() && !fails(result)) tried.words += ": " + trouble;
  if (tried.well) say_signals(tried, gauge.signals());
  gauge.close();
  return tried;
}

TriedDevice try_amplifier(Contacts& amplifier, HostClock& clock) {
  TriedDevice tried;
  tried.name = "amplifier";
  const Result result = amplifier.open();
  if (!result) {
    tried.words = result.message;
    return tried;
  }
  // Long enough for the lines to be looked at once.
  constexpr std::int64_t look_ns = 200'000'000;
  clock.sleep_until(clock.now_ns() + look_ns);
  tried.well = true;
  say_signals(tried, amplifier.signals());
  amplifier.close();
  return tried;
}

}  // namespace

std::vector<TriedDevice> try_bench(BenchParts parts, const config::Bench& bench,
                                   double patience_s) {
  HostClock& clock = *parts.clock;
  std::vector<TriedDevice> out;
  // The contact first: whatever a dead daemon left of it goes off before an output moves.
  if (parts.amplifier) out.push_back(try_amplifier(*parts.amplifier, clock));
  out.push_back(try_board(*parts.board, bench, clock, patience_s));
  for (const auto& gauge : parts.gauges) {
    out.push_back(try_gauge(*gauge, bench.inputs, clock, patience_s));
  }
  return out;
}

}  // namespace stickslip::drivers
