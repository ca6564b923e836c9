// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/experiment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/channel_readings.h"
#include "diagnosis/outliers.h"
#include "diagnosis/spectrum.h"
#include "diagnosis/time_grid.h"
#include "diagnosis/wide_band.h"
#include "physics/integration_cost.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/reading.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

namespace {

using physics::Excitation;
using physics::FilterChain;
using physics::Model;

[[noreturn]] void refuse(const std::string& source, const std::string& message) {
  throw InputError(Problem{source, 0, 0, message});
}

// Magnitude that no SI reading of a rig reaches: the units of the file are wrong.
constexpr double implausible_reading = 1.0e12;
// Lower bound of an estimated noise over the channel's standard deviation. No model is more
// accurate: a smoother recording (an encoder, a file filtered afterwards) does not say how well it
// can be predicted.
constexpr double min_relative_noise = 1.0e-3;
// Within it of a gap or an end, signals reconstructed through filters or derivatives are
// inaccurate.
constexpr double reconstruction_margin_s = 0.35;
// Relative accuracy that a guess of the motion needs.
constexpr double guess_accuracy = 0.02;
// Departure from the instants of the grid that no reading shows [periods].
constexpr double negligible_periods = 1.0e-4;
// Longest integration step under an imposed motion [s]: no inertia smooths the friction whose steps
// the filters of its channel see.
constexpr double imposed_step_s = 3.0e-4;
constexpr double min_window_samples = 8.0;
// Longest coarse integration step [s].
constexpr double longest_coarse_step_s = 1.0e-3;
// Integration steps between two samples, beyond which a comparison takes hours and says nothing.
constexpr double most_substeps = 2000.0;

// A recording on its uniform time grid, with the model that it is compared with.
struct Source {
  const protocol::Recording& recording;
  const Model& model;
  TimeGrid grid;
  std::array<ChannelReadings, channel_count> readings;

  Excitation excitation() const { return model.oscillator.excitation; }
  bool recorded(Channel channel) const {
    return ((recording.channels >> index_of(channel)) & 1U) != 0;
  }
  const ChannelReadings& of(Channel channel) const { return readings[index_of(channel)]; }
  const std::vector<physics::Filter>& filters(Channel channel) const {
    return model.sensors[index_of(channel)].filters;
  }
  bool load_is_measured() const {
    return model.normal_load && model.normal_load->law == physics::NormalLoadLaw::measured;
  }
};

void check_channels(const Source& source) {
  const auto require = [&](Channel channel, const char* why) {
    if (source.recorded(channel)) return;
    refuse(source.recording.source,
           "lacks the column " + std::string(info(channel).column) + ", which " + why);
  };
  const Excitation excitation = source.excitation();
  if (excitation == Excitation::base) {
    require(Channel::base_displacement, "drives a base-excited rig (excitation = \"base\")");
  }
  if (excitation == Excitation::force) {
    require(Channel::drive_force, "drives a force-excited rig (excitation = \"force\")");
  }
  if (excitation == Excitation::imposed) {
    require(Channel::displacement, "is the imposed motion itself");
    require(Channel::friction_force, "is the only prediction of a rig with imposed motion");
  } else {
    require(Channel::displacement, "the model is compared with");
  }
  if (source.load_is_measured()) {
    require(Channel::normal_load, "the normal-load law \"measured\" takes as N");
    const auto& frames = source.recording.frames;
    const bool pressed = std::any_of(frames.begin(), frames.end(), [](const Frame& frame) {
      return frame.has(Channel::normal_load) && frame[Channel::normal_load] > 0.0;
    });
    if (!pressed) {
      refuse(source.recording.source,
             "has no normal_load_n above 0 N, which the normal-load law \"measured\" takes as N: "
             "without it nothing rubs. Is the gauge connected, and has its calibration the right "
             "sign? A model with another law needs no measured load");
    }
  }
}

// Of small free motions of a declared spring or well [s]; 0 where nothing restores the mass.
double natural_period_s(const Model& model) {
  const auto& oscillator = model.oscillator;
  if (oscillator.excitation == Excitation::imposed) return 0.0;
  double stiffness = 0.0;
  if (oscillator.two_well) {
    stiffness = 2.0 * oscillator.two_well->linear_n_m.value;
  } else if (oscillator.natural_frequency_hz) {
    const double hz = oscillator.natural_frequency_hz->value;
    return hz > 0.0 ? 1.0 / hz : 0.0;
  } else if (oscillator.stiffness_n_m) {
    stiffness = oscillator.stiffness_n_m->value;
  }
  if (!(stiffness > 0.0)) return 0.0;
  return 2.0 * std::numbers::pi * std::sqrt(oscillator.mass_kg.value / stiffness);
}

// The unit in which times that are `factor` times too large would make sense.
std::string likely_unit(double samples_per_period, double step_s) {
  constexpr double fastest_s = 1.0e-7;  // of any converter for a rig
  for (const auto& [factor, name] :
       {std::pair{1.0e3, "milliseconds"}, std::pair{1.0e6, "microseconds"},
        std::pair{1.0e9, "nanoseconds"}}) {
    if (samples_per_period * factor < 8.0 || step_s / factor < fastest_s) continue;
    const bool counts = std::abs(step_s - 1.0) < 1.0e-9;
    return std::string("time_s looks like ") + name + (counts ? " or row numbers" : "") + "; as " +
           name + " there would be a sample every " + physics::number_text(step_s / factor) + " s";
  }
  return "is time_s in seconds, and the model's frequency right?";
}

// A recording whose times cannot be seconds. Before anything else, which would take hours and fail.
void check_times(const std::string& source, const Model& model, double step_s, double span_s) {
  const double natural_s = natural_period_s(model);
  if (natural_s == 0.0) return;
  constexpr double least_samples = 3.0;
  constexpr double least_periods = 0.05;
  const std::string model_moves =
      ", but the model's natural period is " + physics::number_text(natural_s) + " s: ";
  if (natural_s < least_samples * step_s) {
    refuse(source, "has a sample every " + physics::number_text(step_s) + " s" + model_moves +
                       "nothing between two samples can be compared. Expected at least " +
                       physics::number_text(least_samples) + " samples in each; " +
                       likely_unit(natural_s / step_s, step_s));
  }
  if (span_s < least_periods * natural_s) {
    refuse(source, "lasts " + physics::number_text(span_s) + " s" + model_moves +
                       "expected several of them. time_s looks too small by a factor of " +
                       (1.0e3 * span_s < natural_s ? "1000000" : "1000") +
                       ", as if converted to seconds twice");
  }
}

// Sum of the lengths of the segments, gaps left out.
double measured_s(const TimeGrid& grid) {
  std::size_t samples = 0;
  for (const TimeGrid::Segment& segment : grid.segments) samples += segment.end - segment.begin;
  return grid.period_s * static_cast<double>(samples);
}

void set_time_base(Experiment& e, const Source& source) {
  e.source = source.recording.source;
  e.start_s = source.grid.start_s;
  e.period_s = source.grid.period_s;
  e.samples = source.grid.instants();
}

// Longest step that resolves the model's motion.
double resolving_step_s(const Model& model) {
  double step_s = physics::Rig(model).longest_step_s();
  // An effect on trial may make a declared load cell resonate.
  constexpr double steps_in_period = 125.0;
  if (model.load_cell) {
    step_s =
        std::min(step_s, 1.0 / (steps_in_period * model.load_cell->natural_frequency_hz.value));
  }
  const bool imposed = model.oscillator.excitation == Excitation::imposed;
  return imposed ? std::min(step_s, imposed_step_s) : step_s;
}

void set_substeps(Experiment& e, const Model& model) {
  const double resolving = resolving_step_s(model);
  const auto count = [&](double longest_s) {
    return std::max(1.0, std::ceil(e.period_s / longest_s - 0.01));
  };
  if (count(resolving) > most_substeps) {
    refuse(e.source, "has a sample every " + physics::number_text(e.period_s) +
                         " s, but the model moves within " +
                         physics::number_text(20.0 * resolving) +
                         " s: nothing between two samples can be compared. Is time_s in seconds?");
  }
  const std::string wrong =
      physics::wrong_with_simulation(model, e.period_s * static_cast<double>(e.samples));
  if (!wrong.empty()) refuse(e.source, "cannot be compared with this model: " + wrong);
  const double coarse = count(std::min(2.0 * resolving, longest_coarse_step_s));
  e.coarse_substeps = static_cast<int>(coarse);
  e.substeps = e.coarse_substeps * static_cast<int>(std::ceil(count(resolving) / coarse));
}

void check_magnitudes(const protocol::Recording& recording, Channel channel) {
  for (const Frame& frame : recording.frames) {
    if (!frame.has(channel) || std::abs(frame[channel]) < implausible_reading) continue;
    refuse(recording.source, std::string(info(channel).column) + " is " +
                                 physics::number_text(frame[channel]) + " at time " +
                                 std::to_string(frame.time_s()) +
                                 " s, beyond any rig; expected SI units");
  }
}

// Fills source.readings and sets the noise of every channel.
void set_channels(Experiment& e, Source& source) {
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!source.recorded(channel)) continue;
    check_magnitudes(source.recording, channel);
    source.readings[c] = readings_of(source.recording.frames, source.grid, channel);
    e.channel_std[c] = standard_deviation_of(source.readings[c]);
    const auto& declared = source.model.sensors[c].noise_std;
    const double least = std::max(min_relative_noise * e.channel_std[c], 1.0e-15);
    const double found = declared ? at_least_white_noise(source.readings[c], *declared)
                                  : noise_of(source.readings[c]);
    e.noise_declared[c] = declared && found == *declared;
    e.noise_above_declared[c] = declared && *declared > 0.0 ? found / *declared : 1.0;
    e.noise_assumed[c] = !declared && found < least;
    e.noise_std[c] = e.noise_assumed[c] ? least : found;
  }
}

void set_compared(Experiment& e, const Source& source) {
  const bool imposed = source.excitation() == Excitation::imposed;
  const auto compare = [&](Channel channel, bool predicted) {
    if (predicted && source.recorded(channel)) {
      e.compared = static_cast<std::uint8_t>(e.compared | (1U << index_of(channel)));
    }
  };
  compare(Channel::displacement, !imposed);
  compare(Channel::velocity, !imposed);
  compare(Channel::friction_force, true);
  compare(Channel::normal_load, source.model.normal_load && !source.load_is_measured());
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (e.is_compared(c) && e.channel_std[c] > 0.0) return;
  }
  refuse(e.source, "shows no motion: every channel that the model predicts is constant");
}

// Readings at the instants that are nearest, and what they missed these by. Where nothing was
// measured a line between the neighbours, for pictures only: it is not valid.
void set_readings_of(Experiment& e, const Source& source, std::size_t c) {
  const auto bit = static_cast<std::uint8_t>((1U << c) & e.compared);
  const auto& list = source.readings[c].list;
  std::size_t filled = 0;  // samples so far
  for (const auto& each : list) {
    const double nearest = std::round(each.at);
    if (nearest < static_cast<double>(filled) || nearest >= static_cast<double>(e.samples))
      continue;
    const auto k = static_cast<std::size_t>(nearest);
    const double before = filled > 0 ? e.reading[filled - 1][c] : each.value;
    const auto distance = static_cast<double>(k + 1 - filled);
    for (std::size_t j = filled; j < k; ++j) {
      const double share = static_cast<double>(j + 1 - filled) / distance;
      e.reading[j][c] = before + share * (each.value - before);
    }
    e.reading[k][c] = each.value;
    e.valid[k] = static_cast<std::uint8_t>(e.valid[k] | bit);
    if (!e.measured_after_s.empty()) {
      e.measured_after_s[k][c] = static_cast<float>((each.at - nearest) * e.period_s);
    }
    filled = k + 1;
  }
  for (std::size_t j = filled; j < e.samples && filled > 0; ++j) {
    e.reading[j][c] = e.reading[filled - 1][c];
  }
}

// True if readings of a predicted channel were taken beside the instants of the grid.
bool any_beside_grid(const Source& source) {
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    for (const Reading& each : source.readings[c].list) {
      if (std::abs(each.at - std::round(each.at)) > negligible_periods) return true;
    }
  }
  return false;
}

void set_readings(Experiment& e, const Source& source) {
  e.reading.resize(e.samples);
  e.valid.assign(e.samples, 0);
  if (any_beside_grid(source)) e.measured_after_s.resize(e.samples);
  for (std::size_t c = 0; c < predicted_channels; ++c) set_readings_of(e, source, c);
}

// Channels without which nothing can be predicted: what drives the model, and the motion, on which
// the guess of a state rests.
std::vector<Channel> needed_channels(const Source& source) {
  std::vector<Channel> out = {Channel::displacement};
  if (source.excitation() == Excitation::base) out.push_back(Channel::base_displacement);
  if (source.excitation() == Excitation::force) out.push_back(Channel::drive_force);
  if (source.load_is_measured()) out.push_back(Channel::normal_load);
  return out;
}

// Cuts the samples where interpolation would not restore what is missing.
std::vector<Range> measured_ranges(const Experiment& e, const Source& source) {
  std::vector<Range> out;
  for (const Channel channel : needed_channels(source)) {
    const std::size_t c = index_of(channel);
    const ChannelReadings& readings = source.of(channel);
    double noise = std::max(e.noise_std[c], noise_of(readings));
    // A guess need not be as accurate as an input.
    if (channel == Channel::displacement && source.excitation() != Excitation::imposed) {
      noise = std::max(noise, guess_accuracy * e.channel_std[c]);
    }
    const auto ranges = covered(readings, source.grid, most_restorable(readings, noise));
    out = channel == Channel::displacement ? ranges : common(out, ranges);
  }
  return out;
}

// Ends of segments in which signals reconstructed through filters or derivatives are inaccurate.
std::size_t reconstruction_margin(const Experiment& e, const Source& source) {
  const bool nothing_reconstructed = source.excitation() == Excitation::force &&
                                     source.filters(Channel::drive_force).empty() &&
                                     source.filters(Channel::displacement).empty();
  const double margin_s = nothing_reconstructed ? 0.0 : reconstruction_margin_s;
  return std::min(e.samples / 5, static_cast<std::size_t>(margin_s / e.period_s));
}

void set_segments(Experiment& e, const Source& source) {
  const std::size_t margin = reconstruction_margin(e, source);
  auto clock = source.grid.segments.begin();
  for (const Range& range : measured_ranges(e, source)) {
    while (clock->end <= range.begin) ++clock;
    Segment segment{range.begin, range.end, range.begin, range.begin, 0.0};
    segment.start_s = clock->start_s + e.period_s * static_cast<double>(range.begin - clock->begin);
    if (range.end - range.begin > 2 * margin) {
      segment.usable_begin = range.begin + margin;
      segment.usable_end = range.end - margin;
    }
    e.segments.push_back(segment);
  }
  if (e.segments.empty()) {
    refuse(e.source, "has no stretch in which all that drives the model was measured together");
  }
  e.usable_begin = e.segments.front().usable_begin;
  e.usable_end = e.segments.back().usable_end;
}

enum class Purpose : std::uint8_t { input, guess };

// A signal on all samples, 0 outside the segments.
class SegmentSignals {
 public:
  explicit SegmentSignals(const Experiment& e) {
    for (auto* each : {&out_.value, &out_.rate, &out_.acceleration}) each->resize(e.samples);
  }
  void add(const Segment& segment, const Series& series, const WideBand& part) {
    put(segment, series, part.value, out_.value);
    put(segment, series, part.rate, out_.rate);
    put(segment, series, part.acceleration, out_.acceleration);
    const auto samples = static_cast<double>(segment.end - segment.begin);
    samples_ += samples;
    rate_square_ += samples * part.rate_noise_std * part.rate_noise_std;
    acceleration_square_ += samples * part.acceleration_noise_std * part.acceleration_noise_std;
    out_.highest_hz = std::max(out_.highest_hz, part.highest_hz);
  }
  WideBand result() {
    if (samples_ > 0.0) {
      out_.rate_noise_std = std::sqrt(rate_square_ / samples_);
      out_.acceleration_noise_std = std::sqrt(acceleration_square_ / samples_);
    }
    return std::move(out_);
  }

 private:
  void put(const Segment& segment, const Series& series, const std::vector<double>& from,
           std::vector<double>& to) const {
    if (from.empty()) return;
    for (std::size_t k = segment.begin; k < segment.end; ++k) {
      to[k] = interpolated(from, series.position(k), 0, from.size());
    }
  }

  WideBand out_;
  double samples_ = 0.0;
  double rate_square_ = 0.0;
  double acceleration_square_ = 0.0;
};

// Departure of a channel's filters from those that are declared.
struct FilterChange {
  double cutoff_factor = 1.0;
  double lead_s = 0.0;  // keeps their lag
};

std::vector<physics::Filter> changed(std::vector<physics::Filter> filters,
                                     const FilterChange& change) {
  for (physics::Filter& filter : filters) filter.cutoff_hz.value *= change.cutoff_factor;
  return filters;
}

// Before the filters of the channel. Guesses are without mains lines, which would corrupt a
// velocity, and of motions without lines; the readings that models are compared with keep theirs.
WideBand reconstructed(const Experiment& e, const Source& source, Channel channel, Purpose purpose,
                       const FilterChange& change = {}) {
  constexpr std::size_t fewest = 16;
  SegmentSignals out(e);
  const double period_s = e.period_s * source.of(channel).spacing;
  const FilterChain chain(changed(source.filters(channel), change), period_s);
  for (const Segment& segment : e.segments) {
    Series series = series_over(source.of(channel), source.grid, {segment.begin, segment.end});
    if (series.value.size() < fewest) continue;
    const double white_std = e.noise_std[index_of(channel)];
    NoiseFloor noise(white_std);
    if (purpose == Purpose::guess) {
      series.value = without_mains(std::move(series.value), period_s);
    } else {
      noise = NoiseFloor(series.value, period_s, white_std);
    }
    out.add(segment, series, wide_band(series.value, period_s, chain, noise, change.lead_s));
  }
  return out.result();
}

// An input as it acted, before the filters of its channel.
std::vector<double> unfiltered(const Experiment& e, const Source& source, Channel channel) {
  if (!source.filters(channel).empty()) {
    return reconstructed(e, source, channel, Purpose::input).value;
  }
  SegmentSignals out(e);
  for (const Segment& segment : e.segments) {
    const Series series =
        series_over(source.of(channel), source.grid, {segment.begin, segment.end});
    WideBand as_read;
    as_read.value = series.value;
    out.add(segment, series, as_read);
  }
  return out.result().value;
}

// The signals from which inputs and guesses are made; empty where they do not apply.
struct WideBandSignals {
  WideBand displacement;
  WideBand base;
  WideBand friction;
  std::vector<double> drive_n;
  std::vector<double> load_n;
};

WideBandSignals wide_band_signals(const Experiment& e, const Source& source) {
  WideBandSignals out;
  const Excitation excitation = source.excitation();
  out.displacement = excitation == Excitation::imposed
                         ? reconstructed(e, source, Channel::displacement, Purpose::input)
                         : reconstructed(e, source, Channel::displacement, Purpose::guess);
  if (excitation == Excitation::base) {
    out.base = reconstructed(e, source, Channel::base_displacement, Purpose::input);
  }
  if (source.recorded(Channel::friction_force)) {
    out.friction = reconstructed(e, source, Channel::friction_force, Purpose::guess);
  }
  if (excitation == Excitation::force) out.drive_n = unfiltered(e, source, Channel::drive_force);
  if (source.recorded(Channel::normal_load)) {
    out.load_n = unfiltered(e, source, Channel::normal_load);
  }
  return out;
}

// The mean of the readings, as a magnitude: where they average 0 or less, as those of a gauge that
// is not connected, the load that the model declares.
double mean_load_n(const Source& source) {
  if (source.recorded(Channel::normal_load)) {
    const double mean = mean_of(source.of(Channel::normal_load));
    if (mean > 0.0) return mean;
  }
  const auto& declared = source.model.normal_load;
  return declared && declared->load_n.value > 0.0 ? declared->load_n.value : 1.0;
}

physics::Input input_at(const Source& source, const WideBandSignals& signals,
                        const Segment& segment, double position) {
  const auto at = [&](const std::vector<double>& values) {
    return interpolated(values, position, segment.begin, segment.end);
  };
  physics::Input input;
  if (source.excitation() == Excitation::base) {
    input.base_displacement_m = at(signals.base.value);
    input.base_acceleration_m_s2 = at(signals.base.acceleration);
  }
  if (source.excitation() == Excitation::force) input.drive_force_n = at(signals.drive_n);
  if (source.excitation() == Excitation::imposed) {
    input.displacement_m = at(signals.displacement.value);
    input.velocity_m_s = at(signals.displacement.rate);
  }
  if (source.load_is_measured()) input.normal_load_n = at(signals.load_n);
  return input;
}

// That of a force at knots depends on the windows. Only a declared one counts: no inertia bounds
// the frequencies of a force, and what looks like its noise may be that of a controller, which
// acts.
void set_drive_noise(Experiment& e, const Source& source, const WideBandSignals& signals) {
  switch (source.excitation()) {
    case Excitation::base:
      e.drive_noise = signals.base.acceleration_noise_std;
      break;
    case Excitation::imposed:
      e.drive_noise = signals.displacement.rate_noise_std;
      break;
    case Excitation::force: {
      if (!e.noise_declared[index_of(Channel::drive_force)]) break;
      const auto& force = source.of(Channel::drive_force);
      const Segment segment = e.longest_segment();
      const Series series = series_over(force, source.grid, {segment.begin, segment.end});
      e.drive_force_period_s = e.period_s * force.spacing;
      e.drive_force_noise = NoiseFloor(series.value, e.drive_force_period_s,
                                       e.noise_std[index_of(Channel::drive_force)]);
      break;
    }
  }
}

// The signals, were the cut-offs of the drive's channel higher and its lag the same.
WideBandSignals at_higher_cutoff(const Experiment& e, const Source& source,
                                 WideBandSignals signals) {
  const Channel channel = drive_channel(source.excitation());
  FilterChange change;
  change.cutoff_factor = 1.0 + Experiment::higher_cutoff;
  const double lag_s = FilterChain(source.filters(channel), e.period_s).lag_s();
  change.lead_s = lag_s * (1.0 - 1.0 / change.cutoff_factor);
  WideBand drive = reconstructed(e, source, channel, Purpose::input, change);
  switch (source.excitation()) {
    case Excitation::base:
      signals.base = std::move(drive);
      break;
    case Excitation::force:
      signals.drive_n = std::move(drive.value);
      break;
    case Excitation::imposed:
      signals.displacement = std::move(drive);
      break;
  }
  return signals;
}

// Between segments the inputs are those at the nearest end: a delay reaches a little beyond it.
std::vector<physics::Input> inputs_from(const Experiment& e, const Source& source,
                                        const WideBandSignals& signals) {
  const auto substeps = static_cast<std::size_t>(e.substeps);
  std::vector<physics::Input> input((e.samples - 1) * substeps + 1);
  std::size_t filled = 0;
  for (const Segment& segment : e.segments) {
    const std::size_t first = segment.begin * substeps;
    const std::size_t last = (segment.end - 1) * substeps;
    for (std::size_t i = first; i <= last; ++i) {
      const std::size_t sample = i / substeps;
      const double fraction = static_cast<double>(i % substeps) / e.substeps;
      const double position = static_cast<double>(sample) + fraction;
      input[i] = input_at(source, signals, segment, position);
    }
    const std::size_t middle = filled > 0 ? filled + (first - filled) / 2 : 0;
    for (std::size_t i = filled; i < first; ++i) {
      input[i] = i < middle ? input[filled - 1] : input[first];
    }
    filled = last + 1;
  }
  for (std::size_t i = filled; i < input.size(); ++i) input[i] = input[filled - 1];
  return input;
}

void set_guesses(Experiment& e, const Model& model, const WideBandSignals& signals) {
  const double cell_stiffness =
      model.load_cell
          ? model.load_cell->mass_kg.value *
                std::pow(2.0 * std::numbers::pi * model.load_cell->natural_frequency_hz.value, 2)
          : 0.0;
  e.guess.resize(e.samples);
  for (std::size_t k = 0; k < e.samples; ++k) {
    StateGuess& guess = e.guess[k];
    guess.displacement_m = signals.displacement.value[k];
    guess.velocity_m_s = signals.displacement.rate[k];
    if (signals.friction.value.empty()) continue;
    guess.friction_n = signals.friction.value[k];
    if (!model.load_cell) continue;
    guess.load_cell_deflection_m = signals.friction.value[k] / cell_stiffness;
    guess.load_cell_velocity_m_s = signals.friction.rate[k] / cell_stiffness;
    if (!signals.base.acceleration.empty()) {
      guess.friction_n += model.load_cell->mass_kg.value * signals.base.acceleration[k];  // Eq. (1)
    }
  }
}

StateGuess largest_of(const std::vector<StateGuess>& guesses) {
  StateGuess out;
  const auto widen = [](double& most, double value) { most = std::max(most, std::abs(value)); };
  for (const StateGuess& guess : guesses) {
    widen(out.displacement_m, guess.displacement_m);
    widen(out.velocity_m_s, guess.velocity_m_s);
    widen(out.load_cell_deflection_m, guess.load_cell_deflection_m);
    widen(out.load_cell_velocity_m_s, guess.load_cell_velocity_m_s);
    widen(out.friction_n, guess.friction_n);
  }
  return out;
}

// Samples before a window from which a model starts: its filters settle, and a reading that is late
// shows what preceded the window. Only exact instruments and times need none of the latter.
std::size_t warm_samples(const Model& model, const Experiment& e) {
  const auto samples = [&](double time_s) {
    return static_cast<std::size_t>(std::ceil(time_s / e.period_s));
  };
  const std::size_t settling =
      samples(physics::SensorBank(model, e.period_s / e.substeps).settling_time_s());
  bool exact = e.measured_after_s.empty();
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (e.is_compared(c)) exact = exact && model.sensors[c].delay_s == physics::Parameter{};
  }
  return exact ? settling : std::max(settling + 2, samples(physics::longest_delay_s));
}

// Inertia smooths the error of a base's acceleration. That of an imposed velocity reaches the
// friction law as it is, and decides whether a slow reversal passes through zero: lines between
// knots have to follow its highest frequency.
int drive_knots_for(const Model& model, const Experiment& e, double span_s) {
  constexpr int smoothed = 16;
  constexpr double per_period = 6.0;
  if (model.oscillator.excitation != Excitation::imposed) return smoothed;
  const double periods = std::min(e.drive_band_hz * span_s, 1.0e3);
  return std::clamp(static_cast<int>(per_period * periods), smoothed, max_drive_knots);
}

// Noise between two knots averages out: that of the knots has the power of the noise of the samples
// at the frequencies which lines between knots can follow.
double force_noise_at_knots(const Experiment& e, double span_s) {
  constexpr int frequencies = 8;
  const double knot_distance_s = span_s / (e.drive_knots - 1);
  double variance = 0.0;
  for (int i = 0; i < frequencies; ++i) {
    variance += e.drive_force_noise.at((i + 0.5) / frequencies * 0.5 / knot_distance_s);
  }
  return std::sqrt(variance / frequencies * e.drive_force_period_s / knot_distance_s);
}

// Eight, three and one of twelve windows, in blocks of up to four: neighbours share a boundary and
// belong on the same side. Blocks are spread by the golden ratio: a regular pattern could coincide
// with a periodic drive and always choose the same part of the motion.
void assign_uses(std::vector<Window>& windows) {
  const std::size_t block = std::clamp<std::size_t>(windows.size() / 12, 1, 4);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const std::size_t blocks = i / block;  // before this one
    const double turn = static_cast<double>(blocks) / std::numbers::phi;
    const double place = turn - std::floor(turn);
    const bool is_fitted = place < fit_share;
    const bool is_for_selection = place < fit_share + select_share;
    windows[i].use = is_fitted ? Use::fit : is_for_selection ? Use::select : Use::report;
  }
}

// All samples, where a gap was never looked for.
Segment whole(const Experiment& e) { return {0, e.samples, e.usable_begin, e.usable_end, 0.0}; }

}  // namespace

Segment Experiment::segment_of(std::size_t sample) const {
  if (segments.empty()) return whole(*this);
  auto next =
      std::upper_bound(segments.begin(), segments.end(), sample,
                       [](std::size_t at, const Segment& segment) { return at < segment.begin; });
  return next == segments.begin() ? *next : *--next;
}

Segment Experiment::longest_segment() const {
  if (segments.empty()) return whole(*this);
  return *std::max_element(segments.begin(), segments.end(), [](const auto& a, const auto& b) {
    return a.end - a.begin < b.end - b.begin;
  });
}

double Experiment::elapsed_s(std::size_t sample) const {
  const Segment segment = segment_of(sample);
  const double samples_after = static_cast<double>(sample) - static_cast<double>(segment.begin);
  return segment.start_s + period_s * samples_after;
}

double Experiment::duration_s() const {
  return samples > 0 ? elapsed_s(samples - 1) + period_s : 0.0;
}

Experiment make_experiment(const protocol::Recording& as_recorded, const Model& model) {
  const Cleaned cleaned(as_recorded);
  const protocol::Recording& recording = cleaned.recording();
  const auto& frames = recording.frames;
  if (frames.size() < 32) {
    refuse(recording.source,
           "holds " + physics::counted(frames.size(), "sample") + "; at least 32 are needed");
  }
  Source source{recording, model, {}, {}};
  check_channels(source);
  source.grid = time_grid_of(frames);
  check_times(recording.source, model, source.grid.period_s, measured_s(source.grid));
  Experiment e;
  set_time_base(e, source);
  set_substeps(e, model);
  set_channels(e, source);
  set_compared(e, source);
  set_readings(e, source);
  set_segments(e, source);
  const WideBandSignals signals = wide_band_signals(e, source);
  set_drive_noise(e, source, signals);
  e.drive_band_hz = signals.displacement.highest_hz;
  e.mean_load_n = mean_load_n(source);
  e.input = inputs_from(e, source, signals);
  if (!source.filters(drive_channel(source.excitation())).empty()) {
    e.input_at_higher_cutoff = inputs_from(e, source, at_higher_cutoff(e, source, signals));
  }
  set_guesses(e, model, signals);
  e.largest = largest_of(e.guess);
  return e;
}

Channel drive_channel(physics::Excitation excitation) {
  switch (excitation) {
    case Excitation::force:
      return Channel::drive_force;
    case Excitation::imposed:
      return Channel::displacement;
    case Excitation::base:
      break;
  }
  return Channel::base_displacement;
}

double default_horizon_s(const Model& model, const Experiment& experiment) {
  double period_s = 0.0;
  const auto& oscillator = model.oscillator;
  if (oscillator.excitation != Excitation::imposed && !oscillator.two_well) {
    if (oscillator.natural_frequency_hz) {
      period_s = 1.0 / oscillator.natural_frequency_hz->value;
    } else if (oscillator.stiffness_n_m && oscillator.stiffness_n_m->value > 0.0) {
      period_s = 2.0 * std::numbers::pi *
                 std::sqrt(oscillator.mass_kg.value / oscillator.stiffness_n_m->value);
    } else {
      period_s = 0.5;  // without a spring nothing restores the velocity: errors grow fast
    }
  }
  const double longest = experiment.period_s * static_cast<double>(experiment.samples) / 24.0;
  return std::max(std::min(std::clamp(period_s, 0.4, 1.5), longest),
                  min_window_samples * experiment.period_s);
}

void cut_windows(Experiment& e, const Model& model, double horizon_s) {
  e.windows.clear();
  const std::size_t warm = warm_samples(model, e);
  if (horizon_s < (min_window_samples - 0.5) * e.period_s) {
    throw InputError(Problem{"--horizon", 0, 0,
                             physics::number_text(horizon_s) + " s is less than " +
                                 physics::number_text(min_window_samples) + " samples of " +
                                 e.source + "; expected at least " +
                                 physics::number_text(min_window_samples * e.period_s) + " s"});
  }
  const auto length = static_cast<std::size_t>(std::llround(horizon_s / e.period_s));
  for (const Segment& segment : e.segments.empty() ? std::vector<Segment>{whole(e)} : e.segments) {
    // The motion before a window decides how it begins, and needs accurate inputs, too.
    for (std::size_t begin = segment.usable_begin + warm; begin + length <= segment.usable_end;
         begin += length) {
      e.windows.push_back({begin - warm, begin, begin + length});
    }
  }
  assign_uses(e.windows);
  const double span_s = static_cast<double>(warm + length) * e.period_s;
  e.drive_knots = drive_knots_for(model, e, span_s);
  if (model.oscillator.excitation == Excitation::force) {
    e.drive_noise = force_noise_at_knots(e, span_s);
  }
}

}  // namespace stickslip::diagnosis
