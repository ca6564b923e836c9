#include "diagnosis/locate.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <unsupported/Eigen/FFT>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

// The value below which `share` of the total weight lies.
double weighted_quantile(std::vector<std::pair<double, double>>& value_weight, double share) {
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

// What the relation is called in a sentence.
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

}  // namespace

Location locate(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                physics::Relation relation, double excess) {
  Location location;
  location.relation = relation;
  const std::size_t windows = task.windows.size();
  std::vector<std::vector<std::array<double, predicted_channels>>> readings(windows);
  parallel::for_each(windows, task.threads, [&](std::size_t w) {
    const WindowRef ref = task.windows[w];
    const Experiment& e = task.experiments[ref.experiment];
    const Window& window = e.windows[ref.window];
    readings[w] = predict(e, window, window.end, hypothesis, fitted.z, fitted.state[w]);
  });

  // The channel whose residual stands highest above its noise.
  std::array<double, predicted_channels> energy{};
  std::array<double, predicted_channels> count{};
  const auto each_residual = [&](auto&& visit) {
    for (std::size_t w = 0; w < windows; ++w) {
      const Experiment& e = task.experiments[task.windows[w].experiment];
      const Window& window = e.windows[task.windows[w].window];
      for (std::size_t k = window.begin; k < window.end; ++k) {
        for (std::size_t c = 0; c < predicted_channels; ++c) {
          if (((e.valid[k] >> c) & 1U) == 0) continue;
          visit(e, w, k, c, (readings[w][k - window.begin][c] - e.reading[k][c]) / task.sigma[c]);
        }
      }
    }
  };
  each_residual([&](const Experiment&, std::size_t, std::size_t, std::size_t c, double r) {
    energy[c] += std::min(r * r, 1.0e12);
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
  location.channel = all_channels[worst];

  // When: windows in which chi-squared is beyond `excess`. One recording's times are reported as
  // they are; with several, those of the first that fails.
  std::size_t failing = 0;
  std::optional<std::size_t> in_experiment;
  for (std::size_t w = 0; w < windows; ++w) {
    const double freedom = std::max(1, fitted.count[w] - fitted.states_per_window);
    if (fitted.chi2[w] / freedom <= excess) continue;
    ++failing;
    const WindowRef ref = task.windows[w];
    if (in_experiment && *in_experiment != ref.experiment) continue;
    in_experiment = ref.experiment;
    const Experiment& e = task.experiments[ref.experiment];
    const Window& window = e.windows[ref.window];
    const double from = e.time_s(window.begin);
    const double to = e.time_s(window.end);
    const double join = 2.5 * (to - from);
    if (!location.when_s.empty() && from - location.when_s.back().second < join) {
      location.when_s.back().second = to;
    } else {
      location.when_s.emplace_back(from, to);
    }
  }
  const Experiment& shown = task.experiments[in_experiment.value_or(0)];
  const bool throughout = static_cast<double>(failing) > 0.6 * static_cast<double>(windows);
  if (throughout || location.when_s.empty()) {
    location.when_s = {{shown.time_s(0), shown.time_s(shown.samples - 1)}};
  }

  // Where in phase space: the middle four fifths of the residual's energy.
  std::vector<std::pair<double, double>> by_x;
  std::vector<std::pair<double, double>> by_v;
  each_residual([&](const Experiment& e, std::size_t, std::size_t k, std::size_t c, double r) {
    if (c != worst) return;
    const double weight = std::min(r * r, 1.0e12);
    by_x.emplace_back(e.guess[k].displacement_m, weight);
    by_v.emplace_back(e.guess[k].velocity_m_s, weight);
  });
  location.where["displacement_m"] = {weighted_quantile(by_x, 0.1), weighted_quantile(by_x, 0.9)};
  location.where["velocity_m_s"] = {weighted_quantile(by_v, 0.1), weighted_quantile(by_v, 0.9)};

  // In which band: periodograms of the residual, averaged over windows, above their white part.
  std::vector<double> power;
  double period_s = shown.period_s;
  for (std::size_t w = 0; w < windows; ++w) {
    const Experiment& e = task.experiments[task.windows[w].experiment];
    const Window& window = e.windows[task.windows[w].window];
    const std::size_t n = window.end - window.begin;
    if (!power.empty() && n / 2 + 1 != power.size()) continue;
    std::vector<double> residual(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      if (((e.valid[window.begin + i] >> worst) & 1U) != 0) {
        residual[i] = readings[w][i][worst] - e.reading[window.begin + i][worst];
      }
    }
    Eigen::FFT<double> fft;
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, residual);
    power.resize(n / 2 + 1, 0.0);
    for (std::size_t k = 0; k < power.size(); ++k)
      power[k] += std::min(std::norm(spectrum[k]), 1.0e30);
    period_s = e.period_s;
  }
  if (power.size() > 4) {
    std::vector<double> sorted = power;
    std::sort(sorted.begin(), sorted.end());
    const double white = sorted[sorted.size() / 2];
    std::vector<std::pair<double, double>> by_frequency;
    const double bin = 1.0 / (2.0 * period_s * static_cast<double>(power.size() - 1));
    for (std::size_t k = 0; k < power.size(); ++k) {
      by_frequency.emplace_back(bin * static_cast<double>(k), std::max(0.0, power[k] - white));
    }
    const double low = weighted_quantile(by_frequency, 0.1);
    const double high = weighted_quantile(by_frequency, 0.9);
    location.band_hz = {std::max(0.0, low - 0.5 * bin), high + 0.5 * bin};
  }

  char band[64] = "";
  if (location.band_hz) {
    std::snprintf(band, sizeof band, ", mostly between %.2g and %.2g Hz", location.band_hz->first,
                  location.band_hz->second);
  }
  char when[96] = " throughout the recording";
  if (!throughout) {
    std::snprintf(when, sizeof when, " in %zu of %zu windows, first at %.3g s", failing, windows,
                  location.when_s.front().first);
  }
  location.statement = std::string("The model and the recording part in ") + words_for(relation) +
                       ": it shows most in " + std::string(info(*location.channel).stem) + when +
                       band + ".";
  return location;
}

}  // namespace stickslip::diagnosis
