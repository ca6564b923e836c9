#include "diagnosis/experiment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/spectrum.h"
#include "diagnosis/time_grid.h"
#include "diagnosis/wide_band.h"
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

// Lagrange interpolation through six samples around, the order falling towards the ends.
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

}  // namespace

Experiment make_experiment(const protocol::Recording& recording, const Model& model, Steps steps) {
  const std::string& source = recording.source;
  const auto& frames = recording.frames;
  if (frames.size() < 32) {
    refuse(source, "holds " + std::to_string(frames.size()) + " samples; at least 32 are needed");
  }
  const Excitation excitation = model.oscillator.excitation;
  const auto recorded = [&](Channel channel) {
    return ((recording.channels >> index_of(channel)) & 1U) != 0;
  };
  const auto demand = [&](Channel channel, const char* why) {
    if (!recorded(channel)) {
      refuse(source, "lacks the column " + std::string(info(channel).column) + ", which " + why);
    }
  };
  if (excitation == Excitation::base) {
    demand(Channel::base_displacement, "a base-excited rig (excitation = \"base\") is driven by");
  }
  if (excitation == Excitation::force) {
    demand(Channel::drive_force, "a force-excited rig (excitation = \"force\") is driven by");
  }
  if (excitation == Excitation::imposed) {
    demand(Channel::displacement, "is the imposed motion itself");
    demand(Channel::friction_force, "is all that a rig with imposed motion can be judged by");
  } else {
    demand(Channel::displacement, "the model is held against");
  }
  const bool measured_load =
      model.normal_load && model.normal_load->law == physics::NormalLoadLaw::measured;
  if (measured_load) demand(Channel::normal_load, "the normal-load law \"measured\" takes as N");

  Experiment e;
  e.source = source;
  const TimeGrid grid = time_grid_of(frames);
  e.start_s = grid.start_s;
  e.period_s = grid.period_s;
  e.samples = grid.frame.size();
  if (e.samples > 4 * frames.size()) {
    refuse(source, "has time steps from " + std::to_string(grid.period_s) +
                       " s to much more: more than three quarters "
                       "of the samples are missing");
  }

  const physics::Rig rig(model);
  // A load cell that is declared may turn out to ring.
  double resolving = rig.longest_step_s();
  if (model.load_cell) {
    resolving = std::min(
        resolving, 0.05 / (2.0 * std::numbers::pi * model.load_cell->natural_frequency_hz.value));
  }
  const double longest = steps == Steps::fine ? resolving : std::min(2.0 * resolving, 1.0e-3);
  e.substeps = std::max(1, static_cast<int>(std::ceil(e.period_s / longest - 0.01)));

  std::array<std::vector<double>, channel_count> values;
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!recorded(channel)) continue;
    values[c] = filled(frames, grid, channel);
    constexpr double beyond_any_rig = 1.0e12;
    for (std::size_t k = 0; k < values[c].size(); ++k) {
      if (std::abs(values[c][k]) < beyond_any_rig) continue;
      refuse(source,
             std::string(info(channel).column) + " is " + physics::number_text(values[c][k]) +
                 " at time " +
                 std::to_string(frames.front().time_s() + e.period_s * static_cast<double>(k)) +
                 " s, which no rig does; expected SI units");
    }
    e.channel_std[c] = standard_deviation(values[c]);
    const auto& declared = model.sensors[c].noise_std;
    e.noise_declared[c] = declared.has_value();
    // No model is right to better than a thousandth: a recording that is smoother than that (an
    // encoder, a file that was filtered afterwards) does not say how well it can be predicted.
    const double least = std::max(1.0e-3 * e.channel_std[c], 1.0e-15);
    const double found = declared ? *declared : noise_of(values[c]);
    e.noise_assumed[c] = !declared && found < least;
    e.noise_std[c] = e.noise_assumed[c] ? least : found;
  }

  const bool imposed = excitation == Excitation::imposed;
  const auto compare = [&](Channel channel, bool yes) {
    if (yes && recorded(channel)) {
      e.compared = static_cast<std::uint8_t>(e.compared | (1U << index_of(channel)));
    }
  };
  compare(Channel::displacement, !imposed);
  compare(Channel::velocity, !imposed);
  compare(Channel::friction_force, true);
  compare(Channel::normal_load, model.normal_load && !measured_load);

  bool moves = false;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    moves = moves || (((e.compared >> c) & 1U) != 0 && e.channel_std[c] > 0.0);
  }
  if (!moves) {
    refuse(source, "shows no motion: every channel that the model predicts is constant");
  }

  e.reading.resize(e.samples);
  e.valid.assign(e.samples, 0);
  bool hole = false;
  for (std::size_t k = 0; k < e.samples; ++k) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (!values[c].empty()) e.reading[k][c] = values[c][k];
    }
    if (grid.frame[k] < 0) {
      hole = true;
      continue;
    }
    if (hole) e.gaps.push_back(k);
    hole = false;
    e.valid[k] = frames[static_cast<std::size_t>(grid.frame[k])].valid & e.compared;
  }

  // The mains would spoil every guess of a velocity. Only guesses: what is compared is left as it
  // was read.
  const auto cleaned = [&](Channel channel) {
    return without_mains(values[index_of(channel)], e.period_s);
  };
  const auto undo = [&](Channel channel, const std::vector<double>& v,
                        std::vector<physics::Filter> filters) {
    const FilterChain chain(filters, e.period_s);
    return wide_band(v, e.period_s, chain, e.noise_std[index_of(channel)]);
  };
  const auto filters_of = [&](Channel channel) { return model.sensors[index_of(channel)].filters; };

  const WideBand x =
      undo(Channel::displacement, imposed ? values[0] : cleaned(Channel::displacement),
           filters_of(Channel::displacement));
  WideBand base;
  if (excitation == Excitation::base) {
    base = undo(Channel::base_displacement, values[index_of(Channel::base_displacement)],
                filters_of(Channel::base_displacement));
    e.base_doubt_m_s2 = base.acceleration_noise_std;
  }
  WideBand force;
  if (recorded(Channel::friction_force)) {
    force = undo(Channel::friction_force, cleaned(Channel::friction_force),
                 filters_of(Channel::friction_force));
  }
  std::vector<double> drive;
  if (excitation == Excitation::force) {
    const auto& raw = values[index_of(Channel::drive_force)];
    const auto filters = filters_of(Channel::drive_force);
    drive = filters.empty() ? raw : undo(Channel::drive_force, raw, filters).value;
  }
  std::vector<double> load;
  if (recorded(Channel::normal_load)) {
    const auto& raw = values[index_of(Channel::normal_load)];
    const auto filters = filters_of(Channel::normal_load);
    load = filters.empty() ? raw : undo(Channel::normal_load, raw, filters).value;
    double sum = 0.0;
    for (const double n : raw) sum += n;
    e.mean_load_n = sum / static_cast<double>(raw.size());
  } else if (model.normal_load) {
    e.mean_load_n = model.normal_load->load_n.value;
  }

  e.input.resize((e.samples - 1) * static_cast<std::size_t>(e.substeps) + 1);
  for (std::size_t i = 0; i < e.input.size(); ++i) {
    const std::size_t k = i / static_cast<std::size_t>(e.substeps);
    const double fraction =
        static_cast<double>(i % static_cast<std::size_t>(e.substeps)) / e.substeps;
    physics::Input& input = e.input[i];
    if (excitation == Excitation::base) {
      input.base_displacement_m = interpolated(base.value, k, fraction);
      input.base_acceleration_m_s2 = interpolated(base.acceleration, k, fraction);
    }
    if (excitation == Excitation::force) input.drive_force_n = interpolated(drive, k, fraction);
    if (imposed) {
      input.displacement_m = interpolated(x.value, k, fraction);
      input.velocity_m_s = interpolated(x.rate, k, fraction);
    }
    if (measured_load) input.normal_load_n = interpolated(load, k, fraction);
  }

  const double cell_stiffness =
      model.load_cell
          ? model.load_cell->mass_kg.value *
                std::pow(2.0 * std::numbers::pi * model.load_cell->natural_frequency_hz.value, 2)
          : 0.0;
  e.guess.resize(e.samples);
  for (std::size_t k = 0; k < e.samples; ++k) {
    StateGuess& guess = e.guess[k];
    guess.displacement_m = x.value[k];
    guess.velocity_m_s = x.rate[k];
    if (!force.value.empty()) {
      guess.friction_n = force.value[k];
      if (model.load_cell) {
        guess.load_cell_deflection_m = force.value[k] / cell_stiffness;
        guess.load_cell_velocity_m_s = force.rate[k] / cell_stiffness;
        if (!base.acceleration.empty()) {
          guess.friction_n += model.load_cell->mass_kg.value * base.acceleration[k];  // Eq. (1)
        }
      }
    }
  }

  const auto widen = [](double& most, double value) { most = std::max(most, std::abs(value)); };
  for (const StateGuess& guess : e.guess) {
    widen(e.largest.displacement_m, guess.displacement_m);
    widen(e.largest.velocity_m_s, guess.velocity_m_s);
    widen(e.largest.load_cell_deflection_m, guess.load_cell_deflection_m);
    widen(e.largest.load_cell_velocity_m_s, guess.load_cell_velocity_m_s);
    widen(e.largest.friction_n, guess.friction_n);
  }

  // What is reconstructed through filters or derivatives is poor where it cannot look around.
  const double margin_s = excitation == Excitation::force &&
                                  filters_of(Channel::drive_force).empty() &&
                                  filters_of(Channel::displacement).empty()
                              ? 0.0
                              : 0.35;
  const auto margin = std::min(e.samples / 8, static_cast<std::size_t>(margin_s / e.period_s));
  e.usable_begin = margin;
  e.usable_end = e.samples - margin;
  return e;
}

constexpr double fewest_samples = 8.0;  // of a window

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
      period_s = 0.5;  // no spring: nothing brings a wrong velocity back, so errors grow fast
    }
  }
  const double longest = experiment.period_s * static_cast<double>(experiment.samples) / 24.0;
  return std::max(std::min(std::clamp(period_s, 0.4, 1.5), longest),
                  fewest_samples * experiment.period_s);
}

void cut_windows(Experiment& e, const Model& model, double horizon_s) {
  e.windows.clear();
  const double h = e.period_s / e.substeps;
  const double settling_s = physics::SensorBank(model, h).settling_time_s();
  const auto warm = static_cast<std::size_t>(std::ceil(settling_s / e.period_s));
  if (horizon_s < (fewest_samples - 0.5) * e.period_s) {
    throw InputError(Problem{"--horizon", 0, 0,
                             physics::number_text(horizon_s) + " s is less than " +
                                 physics::number_text(fewest_samples) + " samples of " + e.source +
                                 "; expected at least " +
                                 physics::number_text(fewest_samples * e.period_s) + " s"});
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
  // Blocks of up to four windows, so that neighbours, which share what happens at their seam,
  // mostly stand on the same side. About a third is held out, spread by the golden ratio: a regular
  // pattern could fall in step with a periodic drive, and then hold out the same part of the motion
  // each time.
  const std::size_t block = std::clamp<std::size_t>(e.windows.size() / 12, 1, 4);
  for (std::size_t i = 0; i < e.windows.size(); ++i) {
    const std::size_t number = i / block;  // of the block
    const double turn = static_cast<double>(number) / std::numbers::phi;
    e.windows[i].held_out = turn - std::floor(turn) > 2.0 / 3.0;
  }
}

}  // namespace stickslip::diagnosis
