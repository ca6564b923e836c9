// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/imperfect_instruments.h"

#include <algorithm>
#include <cmath>

#include "tools/concealment/rounding.h"

namespace stickslip::concealment {

namespace {

using Json = nlohmann::ordered_json;

// Standard deviations.
constexpr double gain_sigma = 0.005;
constexpr double offset_sigma = 0.01;      // of the channel
constexpr double delay_sigma_rows = 0.3;   // of a sample
constexpr double cutoff_sigma = 0.024;     // of the cut-off
constexpr double jitter_of_period = 0.15;  // of the period
constexpr std::size_t slow_every = 8;      // rows

// Beyond 2.5 standard deviations an instrument would be a finding.
double truncated_normal(RandomSource& random) {
  double value = random.normal();
  while (std::abs(value) > 2.5) value = random.normal();
  return value;
}

double size_of(Channel channel, const Sizes& sizes) {
  const std::size_t c = index_of(channel);
  return std::max(sizes.spread[c], 0.2 * sizes.largest[c]);
}

std::vector<Channel> recorded_channels(const ReferenceRig& rig) {
  std::vector<Channel> channels;
  for (const Channel channel : all_channels) {
    if (rig.instrument[index_of(channel)].recorded) channels.push_back(channel);
  }
  return channels;
}

std::optional<Channel> drive_channel(const ReferenceRig& rig) {
  if (rig.excitation == physics::Excitation::base) return Channel::base_displacement;
  if (rig.excitation == physics::Excitation::force) return Channel::drive_force;
  return std::nullopt;
}

std::vector<Channel> slow_choices(const ReferenceRig& rig, const std::set<Channel>& taken) {
  std::vector<Channel> choices;
  for (const Channel channel : {Channel::velocity, Channel::friction_force, Channel::normal_load}) {
    const bool recorded = rig.instrument[index_of(channel)].recorded;
    if (recorded && !taken.contains(channel)) choices.push_back(channel);
  }
  return choices;
}

struct InstrumentDraw {
  Bench& bench;
  const Sizes& sizes;
  const std::set<Channel>& taken;
  RandomSource& random;
  Imperfections& out;
  Json drawn = Json::object();  ///< of the present nuisance

  /// Calls `change(instrument, channel)` for every recorded channel and notes what it returns.
  template <typename Change>
  void for_each_channel(const Change& change) {
    for (const Channel channel : recorded_channels(bench.rig)) {
      drawn[std::string(info(channel).stem)] =
          change(bench.rig.instrument[index_of(channel)], channel);
    }
  }
  double nominal_period_s() const { return 1.0 / bench.sample_rate_hz; }
  std::size_t rows() const {
    return static_cast<std::size_t>(std::llround(sizes.duration_s * out.clock.rate_hz));
  }
};

void gain(InstrumentDraw& d) {
  d.for_each_channel([&](Instrument& instrument, Channel) {
    return instrument.gain = rounded(1.0 + gain_sigma * truncated_normal(d.random), 6);
  });
}

void offset(InstrumentDraw& d) {
  d.for_each_channel([&](Instrument& instrument, Channel channel) {
    const double sigma = offset_sigma * size_of(channel, d.sizes);
    return instrument.offset = rounded(sigma * truncated_normal(d.random), 6);
  });
}

void cutoff(InstrumentDraw& d) {
  for (const Channel channel : recorded_channels(d.bench.rig)) {
    for (physics::Filter& filter : d.bench.rig.instrument[index_of(channel)].filters) {
      const double ratio = rounded(1.0 + cutoff_sigma * truncated_normal(d.random), 6);
      filter.cutoff_hz.value *= ratio;
      d.drawn[std::string(info(channel).stem)] = ratio;
    }
  }
}

void skew(InstrumentDraw& d) {
  d.for_each_channel([&](Instrument& instrument, Channel) {
    return instrument.delay_s = rounded(
               2.0 * delay_sigma_rows * d.nominal_period_s() * d.random.uniform(0.0, 1.0), 6);
  });
}

void colour(InstrumentDraw& d) {
  for (const Channel channel : recorded_channels(d.bench.rig)) {
    Instrument& instrument = d.bench.rig.instrument[index_of(channel)];
    instrument.correlated_share = rounded(d.random.uniform(0.3, 0.7), 6);
    instrument.noise_correlation_s = rounded(d.random.log_uniform(0.004, 0.03), 6);
    const std::string stem(info(channel).stem);
    d.drawn["tau_s"][stem] = instrument.noise_correlation_s;
    d.drawn["share_of_variance"][stem] = instrument.correlated_share;
  }
}

void half_noise(InstrumentDraw& d) {
  for (const Channel channel : recorded_channels(d.bench.rig)) {
    const double declared = 0.5 * d.bench.rig.instrument[index_of(channel)].noise_std;
    d.bench.declared.sensors[index_of(channel)].noise_std = declared;
    d.drawn["declared_noise_std"][std::string(info(channel).stem)] = declared;
  }
}

// The noise of the drive is well declared, whatever is said of the other channels.
void noisy_drive(InstrumentDraw& d) {
  const Channel channel = *drive_channel(d.bench.rig);
  Instrument& instrument = d.bench.rig.instrument[index_of(channel)];
  instrument.noise_std = rounded(d.random.uniform(0.01, 0.03) * size_of(channel, d.sizes), 2);
  d.bench.declared.sensors[index_of(channel)].noise_std = instrument.noise_std;
  d.drawn[std::string(info(channel).stem)] = instrument.noise_std;
}

void jitter(InstrumentDraw& d) {
  d.out.clock.jitter = jitter_of_period;
  d.drawn["share_of_period"] = jitter_of_period;
}

// Steps of at most a twentieth of a period, in which it shows only on average.
void clock(InstrumentDraw& d) {
  constexpr std::array steps_s = {1.0e-5, 2.0e-5, 5.0e-5, 1.0e-4};
  std::vector<double> fine;
  for (const double step : steps_s) {
    if (step <= 0.0501 * d.nominal_period_s()) fine.push_back(step);
  }
  d.out.clock.rate_hz = rounded(d.bench.sample_rate_hz * d.random.uniform(0.97, 1.03), 9);
  d.out.clock.written_to_s = fine[d.random.index(fine.size())];
  d.drawn["sample_rate_hz"] = d.out.clock.rate_hz;
  d.drawn["written_to_s"] = d.out.clock.written_to_s;
}

void gaps(InstrumentDraw& d) {
  const std::size_t rows = d.rows();
  const std::size_t runs = 5 + d.random.index(2);
  d.drawn["rows_missing"] = Json::array();
  for (std::size_t run = 0; run < runs; ++run) {
    // One gap per equal part of the recording, so that none meets another.
    const std::size_t part = rows / runs;
    const auto missing = static_cast<std::size_t>(d.random.log_uniform(10.0, 150.0));
    const std::size_t first = run * part + 10 + d.random.index(part - missing - 20);
    d.out.gaps.emplace_back(first, missing);
    d.drawn["rows_missing"].push_back(Json::array({first, missing}));
  }
  const std::vector<Channel> channels = recorded_channels(d.bench.rig);
  for (std::size_t cell = 20 + d.random.index(40); cell > 0; --cell) {
    const std::size_t row = d.random.index(rows);
    d.out.empty_cells.emplace(row, channels[d.random.index(channels.size())]);
  }
  d.drawn["cells_empty"] = d.out.empty_cells.size();
}

void rates(InstrumentDraw& d) {
  const std::vector<Channel> choices = slow_choices(d.bench.rig, d.taken);
  d.out.slow_channel = choices[d.random.index(choices.size())];
  d.out.slow_phase = d.random.index(slow_every);
  d.drawn["channel"] = info(*d.out.slow_channel).stem;
  d.drawn["every"] = slow_every;
}

struct Entry {
  Nuisance nuisance;
  std::string_view name;
  void (*draw)(InstrumentDraw&);
};
// The order matters: a noisy drive after the halved noise of all channels, since its declaration
// stands, and gaps after the clock, which has the number of rows.
constexpr std::array entries = {
    Entry{Nuisance::gain, "gain", gain},
    Entry{Nuisance::offset, "offset", offset},
    Entry{Nuisance::cutoff, "cutoff", cutoff},
    Entry{Nuisance::skew, "skew", skew},
    Entry{Nuisance::colour, "colour", colour},
    Entry{Nuisance::half_noise, "noise2", half_noise},
    Entry{Nuisance::jitter, "jitter", jitter},
    Entry{Nuisance::clock, "clock", clock},
    Entry{Nuisance::gaps, "gaps", gaps},
    Entry{Nuisance::rates, "rates", rates},
    Entry{Nuisance::noisy_drive, "driveN", noisy_drive},
};

}  // namespace

std::string_view name_of(Nuisance nuisance) {
  return std::find_if(entries.begin(), entries.end(),
                      [&](const Entry& entry) { return entry.nuisance == nuisance; })
      ->name;
}

std::optional<Nuisance> nuisance_named(std::string_view name) {
  for (const Entry& entry : entries) {
    if (entry.name == name) return entry.nuisance;
  }
  return std::nullopt;
}

bool go_together(Nuisance a, Nuisance b) {
  const auto are = [&](Nuisance one, Nuisance other) {
    return (a == one && b == other) || (a == other && b == one);
  };
  return !are(Nuisance::jitter, Nuisance::clock);
}

bool is_applicable(Nuisance nuisance, const Bench& bench) {
  switch (nuisance) {
    case Nuisance::rates:
      return bench.declared.normal_load.has_value();
    case Nuisance::noisy_drive:
      return drive_channel(bench.rig).has_value();
    default:
      return true;
  }
}

std::vector<Nuisance> draw_nuisances(const Bench& bench, RandomSource& random) {
  std::vector<Nuisance> left;
  for (const Nuisance each : all_nuisances) {
    if (is_applicable(each, bench)) left.push_back(each);
  }
  const std::size_t wanted = 1 + random.index(4);
  std::vector<Nuisance> chosen;
  while (chosen.size() < wanted) {
    const auto next = left.begin() + static_cast<std::ptrdiff_t>(random.index(left.size()));
    const Nuisance drawn = *next;
    left.erase(next);
    const bool fits = std::all_of(chosen.begin(), chosen.end(),
                                  [&](Nuisance other) { return go_together(drawn, other); });
    if (fits) chosen.push_back(drawn);
  }
  return chosen;
}

Imperfections make_imperfect(Bench& bench, const std::vector<Nuisance>& nuisances,
                             const Sizes& sizes, const std::set<Channel>& taken,
                             RandomSource& random) {
  Imperfections out;
  out.clock.rate_hz = bench.sample_rate_hz;
  out.drawn = Json::object();
  for (const Entry& entry : entries) {
    if (std::find(nuisances.begin(), nuisances.end(), entry.nuisance) == nuisances.end()) continue;
    InstrumentDraw draw{bench, sizes, taken, random, out};
    entry.draw(draw);
    out.drawn[std::string(entry.name)] = draw.drawn;
  }
  return out;
}

void leave_out(const Imperfections& imperfections, bool gaps, protocol::Recording& recording,
               std::vector<physics::RigTruth>* states) {
  std::size_t kept = 0;
  for (std::size_t row = 0; row < recording.frames.size(); ++row) {
    const bool missing =
        gaps &&
        std::any_of(imperfections.gaps.begin(), imperfections.gaps.end(), [&](const auto& gap) {
          return row >= gap.first && row < gap.first + gap.second;
        });
    if (missing) continue;
    Frame frame = recording.frames[row];
    if (imperfections.slow_channel && row % slow_every != imperfections.slow_phase) {
      frame.invalidate(*imperfections.slow_channel);
    }
    for (const Channel channel : all_channels) {
      if (gaps && imperfections.empty_cells.contains({row, channel})) frame.invalidate(channel);
    }
    recording.frames[kept] = frame;
    if (states != nullptr) (*states)[kept] = (*states)[row];
    ++kept;
  }
  recording.frames.resize(kept);
  if (states != nullptr) states->resize(kept);
}

physics::Model with_declared_instruments(const Bench& bench, const Sizes& sizes) {
  physics::Model model = bench.declared;
  for (const Channel channel : recorded_channels(bench.rig)) {
    physics::Sensor& sensor = model.sensors[index_of(channel)];
    sensor.gain = physics::Parameter{1.0, gain_sigma};
    sensor.offset = physics::Parameter{0.0, rounded(offset_sigma * size_of(channel, sizes), 2)};
    sensor.delay_s = physics::Parameter{0.0, delay_sigma_rows / bench.sample_rate_hz};
    for (physics::Filter& filter : sensor.filters) {
      filter.cutoff_hz.sigma = rounded(cutoff_sigma * filter.cutoff_hz.value, 2);
    }
  }
  return model;
}

bool is_beyond_tolerance(const TrueEffect& effect, const Sizes& sizes, double sample_rate_hz) {
  constexpr double most = 4.0;
  const auto beyond = [&](const char* parameter, double sigma) {
    const TrueParameter& truth = effect.parameters.at(parameter);
    return std::abs(truth.value - truth.reference) > most * sigma;
  };
  if (effect.id == "gain_error") return beyond("gain", gain_sigma);
  if (effect.id == "channel_delay") return beyond("delay_s", delay_sigma_rows / sample_rate_hz);
  if (effect.id == "sensor_offset") {
    return beyond("offset", offset_sigma * size_of(*effect.channel, sizes));
  }
  return true;
}

}  // namespace stickslip::concealment
