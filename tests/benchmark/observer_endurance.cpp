// SPDX-License-Identifier: Apache-2.0
// Long-term stability of the observer's covariance: many steps (10^8 by default) with dropouts of
// channels, checked every 10^5 steps.
//
//   observer_endurance [--steps N] [--rig NAME]
//
// Exit status 1 where a variance was not positive, where the covariance, scaled by the standard
// deviations, had an eigenvalue below -10^-9 of the largest, where a value was not finite, or where
// the filter restarted more often than every 10^7 steps.
#include <CLI/CLI.hpp>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <random>
#include <string>
#include <vector>

#include "config/rig.h"
#include "observer/kalman_filter.h"
#include "physics/simulator.h"
#include "tests/unit/observer/bench.h"

namespace stickslip {
namespace {

constexpr double period_s = 1.0e-3;

// One period of the rig's modulated drive, 60 s, which is repeated.
std::vector<Frame> minute_of(const config::Rig& rig) {
  physics::RigSimulator simulator(rig.model, {.step_s = 1.0e-4, .seed = 1});
  const observer::test::ModulatedBase input{
      .amplitude_m = rig.excitation.amplitude,
      .carrier_hz = std::round(10.0 * rig.excitation.carrier_hz) / 10.0,
      .depth = 0.9};
  simulator.set_input(input(0.0));
  std::vector<Frame> frames;
  constexpr int warm_up = 10'000;
  constexpr int count = 60'000;
  for (int k = 1; k <= warm_up + count; ++k) {
    simulator.advance(period_s, input(k * period_s));
    if (k > warm_up) frames.push_back(simulator.read());
  }
  return frames;
}

/// Random dropouts of channels.
class Outages {
 public:
  void apply(Frame& frame) {
    for (Channel channel : all_channels) {
      long& left = left_[index_of(channel)];
      if (left == 0 && random_() % 5000 == 0) left = 1 + static_cast<long>(random_() % 300);
      if (left == 0) continue;
      --left;
      if (frame.has(channel)) frame.invalidate(channel);
    }
  }

 private:
  std::mt19937_64 random_{1};
  std::array<long, channel_count> left_{};
};

/// Ratio of the smallest to the largest eigenvalue of the correlation matrix of all states.
double min_eigenvalue(const observer::Covariance& p) {
  Eigen::MatrixXd scaled(p.count(), p.count());
  for (int i = 0; i < p.count(); ++i) {
    for (int j = 0; j < p.count(); ++j) {
      scaled(i, j) = p(i, j) / std::sqrt(std::max(1.0e-300, p(i, i) * p(j, j)));
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() / solver.eigenvalues().maxCoeff();
}

int run(const std::string& name, long steps) {
  const config::Rig rig =
      config::load_rig(std::string(STICKSLIP_SOURCE_DIR "/config/") + name + ".toml");
  const std::vector<Frame> minute = minute_of(rig);
  observer::KalmanFilter filter(rig.model, period_s);
  Outages outages;
  double worst = 1.0;
  bool valid = true;
  for (long step = 0; step < steps && valid; ++step) {
    Frame frame = minute[static_cast<std::size_t>(step) % minute.size()];
    frame.time_ns = step * 1'000'000;
    frame.sequence = static_cast<std::uint64_t>(step);
    outages.apply(frame);
    filter.update(frame);
    if (step % 100'000 != 99'999) continue;
    for (int i = 0; i < filter.covariance().count(); ++i) {
      valid = valid && filter.covariance()(i, i) > 0.0 && std::isfinite(filter.mean()[i]);
    }
    worst = std::min(worst, min_eigenvalue(filter.covariance()));
    valid = valid && worst > -1.0e-9;
  }
  const auto restarts = static_cast<double>(filter.estimate().restarts);
  std::printf(
      "%s: %ld steps, least eigenvalue %.2g of the largest, %.0f restarts, mu %.4f of %.4f\n",
      name.c_str(), steps, worst, restarts, filter.estimate().mu, rig.model.friction.mu.value);
  return valid && restarts <= 1.0 + static_cast<double>(steps) / 1.0e7 ? 0 : 1;
}

}  // namespace
}  // namespace stickslip

int main(int argc, char** argv) try {
  long steps = 100'000'000;
  std::string rig = "simulated";
  CLI::App app("Long-term stability of the observer's covariance.");
  app.add_option("--steps", steps)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--rig", rig, "name of a rig in config/")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return stickslip::run(rig, steps);
} catch (const std::exception& error) {
  std::fprintf(stderr, "observer_endurance: %s\n", error.what());
  return 2;
}
