#include "tools/diagnose/evidence.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <unsupported/Eigen/FFT>

#include "tools/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

using Readings = std::vector<std::array<double, predicted_channels>>;

std::vector<Readings> readings_of(const Task& task, const Explanation& explanation) {
  std::vector<Readings> readings(task.windows.size());
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const Experiment& e = task.experiments[task.windows[w].experiment];
    const Window& window = e.windows[task.windows[w].window];
    readings[w] = predict(e, window, window.end, *explanation.hypothesis, explanation.z,
                          (*explanation.state)[w]);
  });
  return readings;
}

// A model that blew up in a window tells nothing more than that.
double bounded(double residual) {
  return std::isfinite(residual) ? std::clamp(residual, -1.0e6, 1.0e6) : 1.0e6;
}

std::vector<double> mean_power(const Task& task, const std::vector<Readings>& readings,
                               std::size_t c, double period_s, std::vector<double>& frequency_hz) {
  std::vector<double> power;
  double count = 0.0;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment != 0) continue;
    const Experiment& e = task.experiments.front();
    const Window& window = e.windows[task.windows[w].window];
    const std::size_t n = window.end - window.begin;
    if (!power.empty() && n / 2 + 1 != power.size()) continue;
    std::vector<double> residual(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t k = window.begin + i;
      if (((e.valid[k] >> c) & 1U) == 0) continue;
      residual[i] = bounded((readings[w][i][c] - e.reading[k][c]) / task.sigma[c]);
    }
    Eigen::FFT<double> fft;
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, residual);
    power.resize(n / 2 + 1, 0.0);
    for (std::size_t i = 0; i < power.size(); ++i) {
      power[i] += std::norm(spectrum[i]) / static_cast<double>(n);
    }
    count += 1.0;
  }
  frequency_hz.clear();
  for (std::size_t i = 0; i < power.size(); ++i) {
    power[i] /= std::max(1.0, count);
    frequency_hz.push_back(static_cast<double>(i) /
                           (2.0 * period_s * static_cast<double>(power.size() - 1)));
  }
  return power;
}

}  // namespace

std::vector<Curve> shape_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment) {
  constexpr int points = 81;
  const unsigned hooks = effect.hooks();
  struct Variable {
    const char* name;
    const char* unit;
    double low;
    double high;
  };
  const double x = experiment.largest.displacement_m;
  const double v = experiment.largest.velocity_m_s;
  const double load = std::max(experiment.mean_load_n, 1.0e-12);
  const double spread = experiment.channel_std[index_of(Channel::normal_load)];
  const double last_s = experiment.period_s * static_cast<double>(experiment.samples);
  const std::array<Variable, 4> variables = {
      {{"displacement", "m", -x, x},
       {"velocity", "m/s", -v, v},
       {"normal_load", "N", std::max(0.0, load - 2.0 * spread), load + 2.0 * spread},
       {"time", "s", 0.0, last_s}}};
  std::vector<Curve> curves;
  const auto add = [&](const char* quantity, const char* unit, auto&& value_at) {
    for (std::size_t i = 0; i < variables.size(); ++i) {
      const Variable& variable = variables[i];
      if (!(variable.high > variable.low)) continue;
      Curve curve{variable.name, variable.unit, quantity, unit, {}, {}};
      for (int k = 0; k < points; ++k) {
        const double at = variable.low + (variable.high - variable.low) * k / (points - 1.0);
        physics::Instant<double> instant;
        instant.load = load;
        // In the middle of a recording, moving: where an effect that needs motion shows itself.
        instant.time_s = 0.5 * last_s;
        instant.slip = instant.v = i == 0 || i >= 2 ? 0.3 * v : 0.0;
        if (i == 0) instant.x = at;
        if (i == 1) instant.slip = instant.v = at;
        if (i == 2) instant.load = at;
        if (i == 3) instant.time_s = at;
        curve.at.push_back(at);
        curve.value.push_back(value_at(instant));
      }
      const auto [least, most] = std::minmax_element(curve.value.begin(), curve.value.end());
      const double size = std::max(std::abs(*least), std::abs(*most));
      if (std::isfinite(size) && *most - *least > 1.0e-3 * size) curves.push_back(std::move(curve));
    }
  };
  const std::vector<double> states(2, 0.0);
  if (effect.state_count() > 0) return curves;
  if ((hooks & physics::hook::force) != 0) {
    add("force against +x", "N", [&](const physics::Instant<double>& at) {
      return effect.force(at, parameters.data(), states.data());
    });
  }
  if ((hooks & physics::hook::friction) != 0) {
    add("factor on the friction law", "1", [&](const physics::Instant<double>& at) {
      physics::FrictionFactors<double> factors;
      effect.scale_friction(factors, at, parameters.data(), states.data());
      return factors.mu * factors.backbone;
    });
  }
  if ((hooks & physics::hook::load) != 0) {
    add("normal load", "N", [&](const physics::Instant<double>& at) {
      double n = at.load;
      effect.scale_load(n, at, parameters.data(), states.data());
      return n;
    });
  }
  return curves;
}

Evidence evidence_of(const Task& task, const Explanation& before, const Explanation& after) {
  Evidence out;
  const Experiment& e = task.experiments.front();
  const auto early = readings_of(task, before);
  const auto late = readings_of(task, after);

  // The windows of the first recording in the order of time.
  std::vector<std::size_t> order;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment == 0) order.push_back(w);
  }
  const auto window_of = [&](std::size_t w) -> const Window& {
    return e.windows[task.windows[w].window];
  };
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return window_of(a).begin < window_of(b).begin; });

  constexpr std::size_t cells = PhaseMap::cells;
  out.map.displacement_m = std::max(e.largest.displacement_m, 1.0e-12);
  out.map.velocity_m_s = std::max(e.largest.velocity_m_s, 1.0e-12);
  out.map.before.assign(cells * cells, 0.0);
  out.map.after.assign(cells * cells, 0.0);
  std::vector<double> visits(cells * cells, 0.0);
  std::vector<double> excess(order.size(), 0.0);
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (((e.compared >> c) & 1U) == 0) continue;
    ChannelEvidence channel;
    channel.channel = all_channels[c];
    for (std::size_t i = 0; i < order.size(); ++i) {
      const std::size_t w = order[i];
      const Window& window = window_of(w);
      double square_before = 0.0;
      double square_after = 0.0;
      double count = 0.0;
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        const double r0 =
            bounded((early[w][k - window.begin][c] - e.reading[k][c]) / task.sigma[c]);
        const double r1 = bounded((late[w][k - window.begin][c] - e.reading[k][c]) / task.sigma[c]);
        square_before += r0 * r0;
        square_after += r1 * r1;
        count += 1.0;
        const auto cell_of = [](double value, double reach) {
          const double share = std::clamp(0.5 + 0.5 * value / reach, 0.0, 0.999999);
          return static_cast<std::size_t>(share * static_cast<double>(cells));
        };
        const std::size_t cell = cell_of(e.guess[k].velocity_m_s, out.map.velocity_m_s) * cells +
                                 cell_of(e.guess[k].displacement_m, out.map.displacement_m);
        out.map.before[cell] += r0 * r0;
        out.map.after[cell] += r1 * r1;
        visits[cell] += 1.0;
      }
      if (!(count > 0.0)) continue;
      channel.window_time_s.push_back(e.time_s((window.begin + window.end) / 2));
      channel.window_before.push_back(square_before / count);
      channel.window_after.push_back(square_after / count);
      excess[i] += std::log1p(square_before / count);
    }
    channel.power_before = mean_power(task, early, c, e.period_s, channel.frequency_hz);
    channel.power_after = mean_power(task, late, c, e.period_s, channel.frequency_hz);
    out.channels.push_back(std::move(channel));
  }
  for (std::size_t i = 0; i < visits.size(); ++i) {
    const double none = std::numeric_limits<double>::quiet_NaN();
    out.map.before[i] = visits[i] > 0.0 ? std::sqrt(out.map.before[i] / visits[i]) : none;
    out.map.after[i] = visits[i] > 0.0 ? std::sqrt(out.map.after[i] / visits[i]) : none;
  }

  // Six windows in a row where the declared model fails most.
  constexpr std::size_t shown = 6;
  if (order.empty()) return out;
  std::size_t begin = 0;
  double most = -1.0;
  for (std::size_t i = 0; i + std::min(shown, order.size()) <= order.size(); ++i) {
    double sum = 0.0;
    for (std::size_t j = i; j < std::min(order.size(), i + shown); ++j) sum += excess[j];
    if (sum > most) {
      most = sum;
      begin = i;
    }
  }
  for (std::size_t i = begin; i < std::min(order.size(), begin + shown); ++i) {
    const std::size_t w = order[i];
    const Window& window = window_of(w);
    out.window_begin_s.push_back(e.time_s(window.begin));
    for (ChannelEvidence& channel : out.channels) {
      const std::size_t c = index_of(channel.channel);
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        channel.time_s.push_back(e.time_s(k));
        channel.recorded.push_back(e.reading[k][c]);
        channel.before.push_back(early[w][k - window.begin][c]);
        channel.after.push_back(late[w][k - window.begin][c]);
      }
    }
  }
  return out;
}

}  // namespace stickslip::diagnosis
