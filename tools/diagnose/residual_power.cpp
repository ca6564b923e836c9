#include "tools/diagnose/residual_power.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

namespace stickslip::diagnosis {

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

}  // namespace stickslip::diagnosis
