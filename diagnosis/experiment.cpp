#include "diagnosis/experiment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/spectrum.h"
#include "diagnosis/time_grid.h"
#include "diagnosis/wide_band.h"
#include "physics/integration_cost.h"
#include "physics/number_text.h"
#include "physics/problem.h"
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

// Lagrange interpolation through the six nearest samples; of lower order near the ends.
double interpolated(const std::vector<double>& values, std::size_t sample, double fraction) {
  if (fraction == 0.0) return values[sample];
  const auto n = static_cast<std::ptrdiff_t>(values.size());
  const auto k = static_cast<std::ptrdiff_t>(sample);
  const std::ptrdiff_t first = std::max<std::ptrdiff_t>(0, k - 2);
  const std::ptrdiff_t last = std::min(n - 1, k + 3);
  const double at = static_cast<double>(k) + fraction;
  double sum = 0.0;
  for (std::ptrdiff_t i = first; i <= last; ++i) {
    double weight = 1.0;
    for (std::ptrdiff_t j = first; j <= last; ++j) {
      if (j != i) weight *= (at - static_cast<double>(j)) / static_cast<double>(i - j);
    }
    sum += weight * values[static_cast<std::size_t>(i)];
  }
  return sum;
}

double standard_deviation(const std::vector<double>& values) {
  double mean = 0.0;
  for (const double v : values) mean += v;
  mean /= static_cast<double>(values.size());
  double sum = 0.0;
  for (const double v : values) sum += (v - mean) * (v - mean);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

// Magnitude that no SI reading of a rig reaches: the units of the file are wrong.
constexpr double implausible_reading = 1.0e12;
// Lower bound of an estimated noise over the channel's standard deviation. No model is more
// accurate: a smoother recording (an encoder, a file filtered afterwards) does not say how well it
// can be predicted.
constexpr double min_relative_noise = 1.0e-3;
// Ends of a recording in which signals reconstructed through filters or derivatives are inaccurate.
constexpr double reconstruction_margin_s = 0.35;
// Longest integration step under an imposed motion [s]: no inertia smooths the friction of a
// contact that passes through its transition speed.
constexpr double imposed_step_s = 1.0e-4;
constexpr double min_window_samples = 8.0;
// Integration steps between two samples, beyond which a comparison takes hours and says nothing.
constexpr double most_substeps = 2000.0;

// A recording on its uniform time grid, with the model that it is compared with.
struct Source {
  const protocol::Recording& recording;
  const Model& model;
  TimeGrid grid;
  std::array<std::vector<double>, channel_count> values;

  Excitation excitation() const { return model.oscillator.excitation; }
  bool recorded(Channel channel) const {
    return ((recording.channels >> index_of(channel)) & 1U) != 0;
  }
  const std::vector<double>& of(Channel channel) const { return values[index_of(channel)]; }
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

// Before there is a grid, which would have a place for every missing sample.
void check_time_steps(const protocol::Recording& recording) {
  const auto& frames = recording.frames;
  const double period_s = protocol::median_period_s(frames);
  const double span_s =
      static_cast<double>(frames.back().time_ns - frames.front().time_ns) * 1.0e-9;
  if (span_s / period_s + 1.0 <= 4.0 * static_cast<double>(frames.size())) return;
  refuse(recording.source, "has time steps from " + physics::number_text(period_s) +
                               " s to much longer ones: more than three quarters of the samples "
                               "are missing");
}

void set_time_base(Experiment& e, const Source& source) {
  e.source = source.recording.source;
  e.start_s = source.grid.start_s;
  e.period_s = source.grid.period_s;
  e.samples = source.grid.frame.size();
}

int substeps_for(const Model& model, const Experiment& e, Steps steps) {
  const physics::Rig rig(model);
  double resolving = rig.longest_step_s();
  // An effect on trial may make a declared load cell resonate. It rings at each reversal of
  // friction, whose time has an error of half a step: at 0.05 radians in place of 0.03,
  // that was a fifth of the power of the noise in recordings of `conceal`.
  if (model.load_cell) {
    resolving = std::min(
        resolving, 0.03 / (2.0 * std::numbers::pi * model.load_cell->natural_frequency_hz.value));
  }
  if (model.oscillator.excitation == Excitation::imposed) {
    resolving = std::min(resolving, imposed_step_s);
  }
  const double longest = steps == Steps::fine ? resolving : std::min(2.0 * resolving, 1.0e-3);
  const double count = std::ceil(e.period_s / longest - 0.01);
  if (count > most_substeps) {
    refuse(e.source, "has a sample every " + physics::number_text(e.period_s) +
                         " s, but the model moves within " + physics::number_text(20.0 * longest) +
                         " s: nothing between two samples can be compared. Is time_s in seconds?");
  }
  const std::string wrong =
      physics::wrong_with_simulation(model, e.period_s * static_cast<double>(e.samples));
  if (!wrong.empty()) refuse(e.source, "cannot be compared with this model: " + wrong);
  return std::max(1, static_cast<int>(count));
}

void check_magnitudes(const Source& source, Channel channel) {
  const auto& values = source.of(channel);
  const auto& frames = source.recording.frames;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (std::abs(values[k]) < implausible_reading) continue;
    refuse(source.recording.source,
           std::string(info(channel).column) + " is " + physics::number_text(values[k]) +
               " at time " +
               std::to_string(frames.front().time_s() +
                              source.grid.period_s * static_cast<double>(k)) +
               " s, beyond any rig; expected SI units");
  }
}

// Fills source.values and sets the noise of every channel.
void set_channels(Experiment& e, Source& source) {
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!source.recorded(channel)) continue;
    source.values[c] = filled(source.recording.frames, source.grid, channel);
    check_magnitudes(source, channel);
    e.channel_std[c] = standard_deviation(source.values[c]);
    const auto& declared = source.model.sensors[c].noise_std;
    e.noise_declared[c] = declared.has_value();
    const double least = std::max(min_relative_noise * e.channel_std[c], 1.0e-15);
    const double found = declared ? *declared : noise_of(source.values[c]);
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

void set_readings(Experiment& e, const Source& source) {
  e.reading.resize(e.samples);
  e.valid.assign(e.samples, 0);
  bool in_gap = false;
  for (std::size_t k = 0; k < e.samples; ++k) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (!source.values[c].empty()) e.reading[k][c] = source.values[c][k];
    }
    const std::ptrdiff_t frame = source.grid.frame[k];
    if (frame >= 0) {
      if (in_gap) e.gaps.push_back(k);
      e.valid[k] = source.recording.frames[static_cast<std::size_t>(frame)].valid & e.compared;
    }
    in_gap = frame < 0;
  }
}

WideBand reconstructed(const Experiment& e, const Source& source, Channel channel,
                       const std::vector<double>& values) {
  const FilterChain chain(source.filters(channel), e.period_s);
  return wide_band(values, e.period_s, chain, e.noise_std[index_of(channel)]);
}

// Without mains lines, which would corrupt the guess of a velocity. For guesses only: the readings
// that models are compared with keep them.
WideBand reconstructed_without_mains(const Experiment& e, const Source& source, Channel channel) {
  return reconstructed(e, source, channel, without_mains(source.of(channel), e.period_s));
}

// An input as it acted, before the filters of its channel.
std::vector<double> unfiltered(const Experiment& e, const Source& source, Channel channel) {
  if (source.filters(channel).empty()) return source.of(channel);
  return reconstructed(e, source, channel, source.of(channel)).value;
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
  out.displacement =
      excitation == Excitation::imposed
          ? reconstructed(e, source, Channel::displacement, source.of(Channel::displacement))
          : reconstructed_without_mains(e, source, Channel::displacement);
  if (excitation == Excitation::base) {
    out.base =
        reconstructed(e, source, Channel::base_displacement, source.of(Channel::base_displacement));
  }
  if (source.recorded(Channel::friction_force)) {
    out.friction = reconstructed_without_mains(e, source, Channel::friction_force);
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
    const auto& raw = source.of(Channel::normal_load);
    double sum = 0.0;
    for (const double n : raw) sum += n;
    if (sum > 0.0) return sum / static_cast<double>(raw.size());
  }
  const auto& declared = source.model.normal_load;
  return declared && declared->load_n.value > 0.0 ? declared->load_n.value : 1.0;
}

void set_inputs(Experiment& e, const Source& source, const WideBandSignals& signals) {
  const Excitation excitation = source.excitation();
  const bool measured_load = source.load_is_measured();
  e.input.resize((e.samples - 1) * static_cast<std::size_t>(e.substeps) + 1);
  for (std::size_t i = 0; i < e.input.size(); ++i) {
    const std::size_t k = i / static_cast<std::size_t>(e.substeps);
    const double fraction =
        static_cast<double>(i % static_cast<std::size_t>(e.substeps)) / e.substeps;
    physics::Input& input = e.input[i];
    if (excitation == Excitation::base) {
      input.base_displacement_m = interpolated(signals.base.value, k, fraction);
      input.base_acceleration_m_s2 = interpolated(signals.base.acceleration, k, fraction);
    }
    if (excitation == Excitation::force) {
      input.drive_force_n = interpolated(signals.drive_n, k, fraction);
    }
    if (excitation == Excitation::imposed) {
      input.displacement_m = interpolated(signals.displacement.value, k, fraction);
      input.velocity_m_s = interpolated(signals.displacement.rate, k, fraction);
    }
    if (measured_load) input.normal_load_n = interpolated(signals.load_n, k, fraction);
  }
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

void set_usable_range(Experiment& e, const Source& source) {
  const bool nothing_reconstructed = source.excitation() == Excitation::force &&
                                     source.filters(Channel::drive_force).empty() &&
                                     source.filters(Channel::displacement).empty();
  const double margin_s = nothing_reconstructed ? 0.0 : reconstruction_margin_s;
  const auto margin = std::min(e.samples / 5, static_cast<std::size_t>(margin_s / e.period_s));
  e.usable_begin = margin;
  e.usable_end = e.samples - margin;
}

// One third of the windows is held out, in blocks of up to four: neighbours share a boundary and
// belong on the same side. Blocks are spread by the golden ratio: a regular pattern could coincide
// with a periodic drive and always hold out the same part of the motion.
void hold_out(std::vector<Window>& windows) {
  const std::size_t block = std::clamp<std::size_t>(windows.size() / 12, 1, 4);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const double turn = static_cast<double>(i / block) / std::numbers::phi;
    windows[i].held_out = turn - std::floor(turn) > 2.0 / 3.0;
  }
}

}  // namespace

Experiment make_experiment(const protocol::Recording& recording, const Model& model, Steps steps) {
  const auto& frames = recording.frames;
  if (frames.size() < 32) {
    refuse(recording.source,
           "holds " + physics::counted(frames.size(), "sample") + "; at least 32 are needed");
  }
  check_time_steps(recording);
  Source source{recording, model, {}, {}};
  check_channels(source);
  source.grid = time_grid_of(frames);
  Experiment e;
  set_time_base(e, source);
  e.substeps = substeps_for(model, e, steps);
  set_channels(e, source);
  set_compared(e, source);
  set_readings(e, source);
  const WideBandSignals signals = wide_band_signals(e, source);
  e.drive_noise = source.excitation() == Excitation::imposed ? signals.displacement.rate_noise_std
                                                             : signals.base.acceleration_noise_std;
  e.mean_load_n = mean_load_n(source);
  set_inputs(e, source, signals);
  set_guesses(e, model, signals);
  e.largest = largest_of(e.guess);
  set_usable_range(e, source);
  return e;
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
  const double h = e.period_s / e.substeps;
  const double settling_s = physics::SensorBank(model, h).settling_time_s();
  const auto warm = static_cast<std::size_t>(std::ceil(settling_s / e.period_s));
  if (horizon_s < (min_window_samples - 0.5) * e.period_s) {
    throw InputError(Problem{"--horizon", 0, 0,
                             physics::number_text(horizon_s) + " s is less than " +
                                 physics::number_text(min_window_samples) + " samples of " +
                                 e.source + "; expected at least " +
                                 physics::number_text(min_window_samples * e.period_s) + " s"});
  }
  const auto length = static_cast<std::size_t>(std::llround(horizon_s / e.period_s));
  const auto across_gap = [&](std::size_t from, std::size_t to) {
    return std::any_of(e.gaps.begin(), e.gaps.end(),
                       [&](std::size_t gap) { return gap > from && gap < to; });
  };
  for (std::size_t begin = std::max(e.usable_begin, warm); begin + length <= e.usable_end;
       begin += length) {
    if (!across_gap(begin - warm, begin + length)) {
      e.windows.push_back({begin - warm, begin, begin + length, false});
    }
  }
  hold_out(e.windows);
}

}  // namespace stickslip::diagnosis
