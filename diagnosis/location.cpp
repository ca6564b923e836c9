// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/location.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>

#include "diagnosis/fourier.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

// Bound of a squared residual, for windows in which the model diverged.
constexpr double largest_square = 1.0e12;

using Weighted = std::vector<std::pair<double, double>>;  // value, weight

// Value below which `share` of the total weight lies.
double weighted_quantile(Weighted& value_weight, double share) {
  std::sort(value_weight.begin(), value_weight.end());
  double total = 0.0;
  for (const auto& [value, weight] : value_weight) total += weight;
  double sum = 0.0;
  for (const auto& [value, weight] : value_weight) {
    sum += weight;
    if (sum >= share * total) return value;
  }
  return value_weight.empty() ? 0.0 : value_weight.back().first;
}

// The range of the weight without the share `tail` at each end.
std::pair<double, double> central_range(Weighted value_weight, double tail) {
  const double low = weighted_quantile(value_weight, tail);
  return {low, weighted_quantile(value_weight, 1.0 - tail)};
}

const char* words_for(physics::Relation relation) {
  switch (relation) {
    case physics::Relation::kinematics:
      return "the relation between velocity and displacement";
    case physics::Relation::force_balance:
      return "the force balance of the mass";
    case physics::Relation::friction_law:
      return "the friction law";
    case physics::Relation::normal_load:
      return "the normal load";
    case physics::Relation::load_cell:
      return "the load cell";
    case physics::Relation::sensor:
      return "a sensor";
  }
  return "the model";
}

std::vector<Readings> readings_by_window(const Task& task, const Hypothesis& hypothesis,
                                         const Fit& fitted) {
  std::vector<Readings> readings(task.windows.size());
  parallel::for_each(readings.size(), task.threads, [&](std::size_t w) {
    const Window& window = task.window(w);
    readings[w] =
        predict(task.experiment(w), window, window.end, hypothesis, fitted.z, fitted.state[w]);
  });
  return readings;
}

// Calls visit(experiment, sample, channel, whitened residual) for every compared reading.
template <class Visit>
void for_each_residual(const Task& task, const std::vector<Readings>& readings, Visit&& visit) {
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const Experiment& e = task.experiment(w);
    const Window& window = task.window(w);
    for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
      visit(e, k, c, (readings[w][k - window.begin][c] - e.reading[k][c]) / task.sigma_of(e, c));
    });
  }
}

// The channel with the largest mean square of the whitened residuals.
std::size_t worst_channel(const Task& task, const std::vector<Readings>& readings) {
  std::array<double, predicted_channels> energy{};
  std::array<double, predicted_channels> count{};
  for_each_residual(task, readings, [&](const Experiment&, std::size_t, std::size_t c, double r) {
    energy[c] += std::min(r * r, largest_square);
    count[c] += 1.0;
  });
  std::size_t worst = 0;
  double highest = -1.0;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (count[c] > 0.0 && energy[c] / count[c] > highest) {
      highest = energy[c] / count[c];
      worst = c;
    }
  }
  return worst;
}

// Times at which windows fail, in one experiment.
struct FailingWindows {
  std::size_t count = 0;
  bool throughout = false;
  std::size_t experiment = 0;
  std::vector<std::pair<double, double>> when_s;
};

// Of several recordings, the times are those of the first that fails.
FailingWindows failing_windows(const Task& task, const Fit& fitted, double explained_chi2,
                               const Criteria& criteria) {
  FailingWindows out;
  std::optional<std::size_t> in_experiment;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const double freedom = std::max(1, fitted.count[w] - fitted.states_per_window);
    if (fitted.chi2[w] / freedom <= explained_chi2) continue;
    ++out.count;
    const std::size_t experiment = task.windows[w].experiment;
    if (in_experiment && *in_experiment != experiment) continue;
    in_experiment = experiment;
    const double from = task.experiment(w).time_s(task.window(w).begin);
    const double to = task.experiment(w).time_s(task.window(w).end);
    const double joined = criteria.joined_gap_windows * (to - from);
    if (!out.when_s.empty() && from - out.when_s.back().second < joined) {
      out.when_s.back().second = to;
    } else {
      out.when_s.emplace_back(from, to);
    }
  }
  out.experiment = in_experiment.value_or(0);
  const auto windows = static_cast<double>(task.windows.size());
  out.throughout = static_cast<double>(out.count) > criteria.throughout_share * windows;
  if (out.throughout || out.when_s.empty()) {
    const Experiment& shown = task.experiments[out.experiment];
    out.when_s = {{shown.time_s(0), shown.time_s(shown.samples - 1)}};
  }
  return out;
}

// Ranges of the motion that hold most of the residual's energy.
std::map<std::string, std::pair<double, double>> ranges_of(const Task& task,
                                                           const std::vector<Readings>& readings,
                                                           std::size_t channel, double tail) {
  Weighted by_x;
  Weighted by_v;
  for_each_residual(task, readings,
                    [&](const Experiment& e, std::size_t k, std::size_t c, double r) {
                      if (c != channel) return;
                      const double weight = std::min(r * r, largest_square);
                      by_x.emplace_back(e.guess[k].displacement_m, weight);
                      by_v.emplace_back(e.guess[k].velocity_m_s, weight);
                    });
  return {{"displacement_m", central_range(std::move(by_x), tail)},
          {"velocity_m_s", central_range(std::move(by_v), tail)}};
}

struct Periodogram {
  std::vector<double> power;
  double bin_hz = 0.0;
};

// Sum of the residual's periodograms over the windows of one length.
Periodogram periodogram_of(const Task& task, const std::vector<Readings>& readings,
                           std::size_t channel, double period_s) {
  std::vector<double> power;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const Experiment& e = task.experiment(w);
    const Window& window = task.window(w);
    const std::size_t n = window.end - window.begin;
    if (!power.empty() && n / 2 + 1 != power.size()) continue;
    std::vector<double> residual(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      if (!e.is_compared(window.begin + i, channel)) continue;
      residual[i] = readings[w][i][channel] - e.reading[window.begin + i][channel];
    }
    const std::vector<std::complex<double>> spectrum = fourier(residual);
    power.resize(n / 2 + 1, 0.0);
    for (std::size_t k = 0; k < power.size(); ++k)
      power[k] += std::min(std::norm(spectrum[k]), 1.0e30);
    period_s = e.period_s;
  }
  const double bin_hz = 1.0 / (2.0 * period_s * static_cast<double>(power.size() - 1));
  return {std::move(power), bin_hz};
}

// The band that holds most of the residual's power above its white part.
std::optional<std::pair<double, double>> band_of(const Periodogram& periodogram, double tail) {
  const std::vector<double>& power = periodogram.power;
  if (power.size() <= 4) return std::nullopt;
  std::vector<double> sorted = power;
  std::sort(sorted.begin(), sorted.end());
  const double white = sorted[sorted.size() / 2];
  Weighted by_frequency;
  const double bin = periodogram.bin_hz;
  for (std::size_t k = 0; k < power.size(); ++k) {
    by_frequency.emplace_back(bin * static_cast<double>(k), std::max(0.0, power[k] - white));
  }
  const auto [low, high] = central_range(std::move(by_frequency), tail);
  return std::pair{std::max(0.0, low - 0.5 * bin), high + 0.5 * bin};
}

std::string statement_of(const Location& location, const FailingWindows& failing,
                         std::size_t windows) {
  char when[96] = "throughout the recording";
  if (!failing.throughout) {
    std::snprintf(when, sizeof when, "in %zu of %s, first at %.3g s", failing.count,
                  physics::counted(windows, "window").c_str(), location.when_s.front().first);
  }
  char band[96] = "";
  if (location.band_hz) {
    std::snprintf(band, sizeof band, ", mostly at frequencies between %.2g and %.2g Hz",
                  location.band_hz->first, location.band_hz->second);
  }
  return std::string("Model and recording disagree in ") + words_for(location.relation) +
         ", most visibly in " + std::string(info(*location.channel).stem) + ", " + when + band +
         ".";
}

}  // namespace

Location locate(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                physics::Relation relation, double explained_chi2, const Criteria& criteria) {
  const auto readings = readings_by_window(task, hypothesis, fitted);
  const double tail = criteria.located_tail_share;
  const std::size_t worst = worst_channel(task, readings);
  const FailingWindows failing = failing_windows(task, fitted, explained_chi2, criteria);
  Location location;
  location.relation = relation;
  location.channel = all_channels[worst];
  location.when_s = failing.when_s;
  location.where = ranges_of(task, readings, worst, tail);
  const double period_s = task.experiments[failing.experiment].period_s;
  location.band_hz = band_of(periodogram_of(task, readings, worst, period_s), tail);
  location.statement = statement_of(location, failing, task.windows.size());
  return location;
}

std::string contradiction_by(const BalanceLocation& location, const Balances& balances) {
  std::string out = "The balances of the readings, in which no effect has been tried, fail in ";
  out += location.relation == physics::Relation::sensor
             ? "the reading of " + std::string(info(*location.channel).stem)
             : words_for(location.relation);
  const BalanceResidual& largest = *balances[location.largest];
  return out + " instead: " + physics::number_text(largest.excess, 3) +
         " times the energy of noise and calibration.";
}

}  // namespace stickslip::diagnosis
