// SPDX-License-Identifier: Apache-2.0
#include "observer_runs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <Eigen/Dense>

#include "physics/sensor_chain.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::runs {

using observer::FrictionEstimate;
using observer::Quantity;
namespace test = observer::test;
using physics::Model;

namespace {

constexpr int steps_per_period = 50;

double relative(std::mt19937_64& random, double share) {
  return 1.0 + std::uniform_real_distribution<double>(-share, share)(random);
}

/// Scales a parameter and sets its relative standard deviation.
void set_prior(physics::Parameter& parameter, double factor, double sigma) {
  parameter.value *= factor;
  parameter.sigma = sigma * std::abs(parameter.value);
}

}  // namespace

Run run_of(const config::Rig& preset_rig, std::uint64_t seed, double seconds) {
  const Model& preset = preset_rig.model;
  std::mt19937_64 random(seed);
  Run run;
  run.real = preset;
  // Parameters with a standard deviation are drawn from their distribution.
  for (const physics::NamedParameter& named : physics::parameters_of(run.real)) {
    physics::Parameter& parameter = *named.parameter;
    if (parameter.sigma == 0.0) continue;
    const double error = std::normal_distribution<double>(0.0, parameter.sigma)(random);
    parameter.value = std::max(parameter.value + error, 0.2 * parameter.value);
  }
  run.real.friction.mu = preset.friction.mu;
  run.real.friction.rate_per_s = preset.friction.rate_per_s;
  run.real.friction.mu.value *= relative(random, 0.2);
  if (run.real.friction.rate_per_s.value > 0.0) {
    run.real.friction.rate_per_s.value *= relative(random, 0.2);
  }
  run.assumed = run.assumed_half = preset;
  const double side = random() % 2 == 0 ? 0.5 : 1.5;
  run.assumed_half.friction.mu = run.real.friction.mu;
  run.assumed_half.friction.rate_per_s = run.real.friction.rate_per_s;
  set_prior(run.assumed.friction.mu, 1.0, 0.15);
  set_prior(run.assumed_half.friction.mu, side, 0.5 / side);
  if (preset.friction.law == physics::FrictionLaw::state_variable) {
    set_prior(run.assumed.friction.rate_per_s, 1.0, 0.15);
    set_prior(run.assumed_half.friction.rate_per_s, random() % 2 == 0 ? 0.5 : 1.5, 0.5);
  }
  const auto about = [&](double value, double share) { return value * relative(random, share); };
  // The rig's excitation with small random changes and an amplitude modulation.
  test::ModulatedBase drive;
  drive.carrier_hz = about(preset_rig.excitation.carrier_hz, 0.05);
  drive.amplitude_m = about(preset_rig.excitation.amplitude, 0.2);
  drive.modulation_hz = about(0.15, 0.5);
  drive.phase_rad = about(std::numbers::pi, 1.0) + std::numbers::pi;
  drive.depth = 0.9;

  physics::RigSimulator rig(run.real, {.step_s = period_s / steps_per_period, .seed = seed});
  rig.set_input(drive(0.0));
  const auto count = static_cast<long>(std::llround(seconds / period_s));
  for (long k = 1; k <= count; ++k) {
    for (int piece = 1; piece <= 4; ++piece) {
      const double t = (static_cast<double>(k - 1) + 0.25 * piece) * period_s;
      rig.advance(0.25 * period_s, drive(t));
    }
    run.frames.push_back(rig.read());
    run.truth.push_back(rig.truth());
  }
  return run;
}

physics::Model with_true_parameters(const Run& run) {
  Model model = run.real;
  model.friction.mu.sigma = run.assumed.friction.mu.sigma;
  model.friction.rate_per_s.sigma = run.assumed.friction.rate_per_s.sigma;
  return model;
}

double nees_of(const FrictionEstimate& e, const physics::RigTruth& t, double mu) {
  constexpr std::array<Quantity, nees_states> quantities = {
      Quantity::displacement, Quantity::velocity, Quantity::theta, Quantity::mu};
  std::array<std::size_t, nees_states> at{};
  for (std::size_t i = 0; i < nees_states; ++i) {
    at[i] = static_cast<std::size_t>(
        std::find(e.quantities.begin(), e.quantities.end(), quantities[i]) - e.quantities.begin());
  }
  Eigen::Matrix4d covariance;
  for (std::size_t i = 0; i < nees_states; ++i) {
    for (std::size_t j = 0; j < nees_states; ++j) {
      covariance(static_cast<int>(i), static_cast<int>(j)) = e.covariance[at[i]][at[j]];
    }
  }
  const Eigen::Vector4d error(e.displacement_m - t.displacement_m, e.velocity_m_s - t.velocity_m_s,
                              e.theta - t.theta, e.mu - mu);
  // In standard deviations: the units differ by orders of magnitude. The floors are far below any
  // uncertainty (m, m/s, 1) and above rounding errors.
  constexpr double least_deviation = 1.0e-9;
  constexpr double least_eigenvalue = 1.0e-9;
  constexpr double rounding = 1.0e-6;
  const Eigen::Vector4d scale =
      covariance.diagonal().cwiseMax(least_deviation * least_deviation).cwiseSqrt().cwiseInverse();
  const Eigen::Matrix4d correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  const Eigen::Vector4d scaled = scale.cwiseProduct(error);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (!correlation.allFinite() || !scaled.allFinite()) return infinity;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(correlation);
  if (eigen.eigenvalues().minCoeff() < -rounding) return infinity;
  const Eigen::Vector4d along = eigen.eigenvectors().transpose() * scaled;
  return along.cwiseAbs2().cwiseQuotient(eigen.eigenvalues().cwiseMax(least_eigenvalue)).sum();
}

namespace {

double square(double x) { return x * x; }

/// Sticking of the truth at each frame, and which frames are away from transitions.
struct Contact {
  std::vector<bool> sticks;
  std::vector<bool> steady;
};

/// `delay`: frames from a transition within which a classification is not judged.
Contact contact_of(const Run& run, double transition_speed_m_s, long delay) {
  Contact out;
  for (const auto& truth : run.truth) {
    out.sticks.push_back(std::abs(truth.slip_velocity_m_s) < transition_speed_m_s);
  }
  const std::vector<bool>& sticks = out.sticks;
  std::vector<long> since(sticks.size());
  for (std::size_t i = 1; i < sticks.size(); ++i) {
    since[i] = sticks[i] == sticks[i - 1] ? since[i - 1] + 1 : 0;
  }
  std::vector<long> until(sticks.size(), 1000000);
  for (std::size_t i = sticks.size() - 1; i-- > 0;) {
    until[i] = sticks[i] == sticks[i + 1] ? until[i + 1] + 1 : 0;
  }
  for (std::size_t i = 0; i < sticks.size(); ++i) {
    out.steady.push_back(since[i] > delay && until[i] > delay);
  }
  return out;
}

/// Sums of squares over the frames of a run.
class ErrorSums {
 public:
  void add(const FrictionEstimate& e, const physics::RigTruth& t) {
    ++count_;
    sum_.theta += square(e.theta - t.theta);
    sum_.force += square(e.friction_force_n - t.friction_force_n);
    sum_.theta_std += square(e.standard_deviation(Quantity::theta));
    sum_.force_std += square(e.standard_deviation(Quantity::friction_force));
    if (e.raw_valid) {
      sum_.raw += square(e.raw_friction_force_n - t.friction_force_n);
      ++raw_count_;
    }
    nis_ += e.nis;
    nis_freedom_ += e.nis_freedom;
  }
  void add_nees(double nees) { sum_.mean_nees += nees; }

  Errors means() const {
    const auto n = static_cast<double>(std::max(count_, 1L));
    Errors out;
    out.theta = std::sqrt(sum_.theta / n);
    out.force = std::sqrt(sum_.force / n);
    out.theta_std = std::sqrt(sum_.theta_std / n);
    out.force_std = std::sqrt(sum_.force_std / n);
    out.raw = raw_count_ > 0 ? std::sqrt(sum_.raw / static_cast<double>(raw_count_)) : 0.0;
    out.mean_nees = sum_.mean_nees / n;
    out.nis = nis_ / std::max(nis_freedom_, 1.0);
    return out;
  }

 private:
  Errors sum_;
  long count_ = 0, raw_count_ = 0;
  double nis_ = 0.0, nis_freedom_ = 0.0;
};

}  // namespace

Errors evaluate(const Run& run, const Model& assumed, double from_s, const Estimator& estimator) {
  const double mu = run.real.friction.mu.value;
  const auto from = static_cast<std::size_t>(from_s / period_s);
  // About the delay of the filters.
  const physics::SensorBank bank(assumed, period_s);
  const auto delay =
      static_cast<long>(bank.chain(Channel::displacement).settling_time_s() / 3.0 / period_s);
  const Contact contact =
      contact_of(run, std::max(run.real.friction.transition_speed_m_s.value, 1.0e-3), delay);
  ErrorSums sums;
  constexpr std::size_t nees_stride = 50;
  long judged = 0, correct = 0;
  const FrictionEstimate* latest = nullptr;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    const FrictionEstimate& e = estimator(run.frames[i]);
    latest = &e;
    if (i < from || !e.valid) continue;
    sums.add(e, run.truth[i]);
    if (i % nees_stride == 0) sums.add_nees(nees_of(e, run.truth[i], mu) / nees_states * 50.0);
    if (!contact.steady[i]) continue;
    ++judged;
    if ((e.sticking > 0.5) == contact.sticks[i]) ++correct;
  }
  const FrictionEstimate& last = *latest;
  Errors out = sums.means();
  out.nees = nees_of(last, run.truth.back(), mu);
  out.mu = std::abs(last.mu / mu - 1.0);
  if (last.gamma_per_s > 0.0) {
    out.gamma = std::abs(last.gamma_per_s / run.real.friction.rate_per_s.value - 1.0);
  }
  out.classified = judged > 0 ? static_cast<double>(correct) / static_cast<double>(judged) : 1.0;
  out.restarts = last.restarts;
  return out;
}

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(
      std::llround(share * (static_cast<double>(values.size()) - 1.0)))];
}

bool inside_bounds(double nees) {
  // Of chi-squared with 4 degrees of freedom.
  constexpr double low = 0.4844;
  constexpr double high = 11.143;
  return nees > low && nees < high;
}

}  // namespace stickslip::runs
