#include "observer_runs.h"

#include <algorithm>
#include <array>
#include <cmath>
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

constexpr int steps_a_period = 50;

double relative(std::mt19937_64& random, double share) {
  return 1.0 + std::uniform_real_distribution<double>(-share, share)(random);
}

void doubt(physics::Parameter& parameter, double factor, double sigma) {
  parameter.value *= factor;
  parameter.sigma = sigma * std::abs(parameter.value);
}

}  // namespace

Run run_of(const config::Rig& preset_rig, std::uint64_t seed, double seconds) {
  const Model& preset = preset_rig.model;
  std::mt19937_64 random(seed);
  Run run;
  run.real = preset;
  // Whatever the model doubts is drawn from its doubt.
  for (const physics::NamedParameter& named : physics::parameters_of(run.real)) {
    physics::Parameter& parameter = *named.parameter;
    if (parameter.sigma == 0.0) continue;
    const double off = std::normal_distribution<double>(0.0, parameter.sigma)(random);
    parameter.value = std::max(parameter.value + off, 0.2 * parameter.value);
  }
  run.real.friction.mu = preset.friction.mu;
  run.real.friction.rate_per_s = preset.friction.rate_per_s;
  run.real.friction.mu.value *= relative(random, 0.2);
  if (run.real.friction.rate_per_s.value > 0.0) {
    run.real.friction.rate_per_s.value *= relative(random, 0.2);
  }
  run.believed = run.believed_half = preset;
  const double side = random() % 2 == 0 ? 0.5 : 1.5;
  run.believed_half.friction.mu = run.real.friction.mu;
  run.believed_half.friction.rate_per_s = run.real.friction.rate_per_s;
  doubt(run.believed.friction.mu, 1.0, 0.15);
  doubt(run.believed_half.friction.mu, side, 0.5 / side);
  if (preset.friction.law == physics::FrictionLaw::state_variable) {
    doubt(run.believed.friction.rate_per_s, 1.0, 0.15);
    doubt(run.believed_half.friction.rate_per_s, random() % 2 == 0 ? 0.5 : 1.5, 0.5);
  }
  const auto about = [&](double value, double share) { return value * relative(random, share); };
  // The rig's own excitation, a little otherwise, amplitude-modulated as by hand.
  test::ModulatedBase drive;
  drive.carrier_hz = about(preset_rig.excitation.carrier_hz, 0.05);
  drive.amplitude_m = about(preset_rig.excitation.amplitude, 0.2);
  drive.modulation_hz = about(0.15, 0.5);
  drive.phase_rad = about(std::numbers::pi, 1.0) + std::numbers::pi;
  drive.depth = 0.9;

  physics::RigSimulator rig(run.real, {.step_s = period_s / steps_a_period, .seed = seed});
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

physics::Model knowing(const Run& run) {
  Model model = run.real;
  model.friction.mu.sigma = run.believed.friction.mu.sigma;
  model.friction.rate_per_s.sigma = run.believed.friction.rate_per_s.sigma;
  return model;
}

namespace {

// Of x, v, theta and mu, which every model has.
constexpr int judged_states = 4;
double nees_of(const FrictionEstimate& e, const physics::RigTruth& t, double mu) {
  constexpr std::array<Quantity, judged_states> judged = {
      Quantity::displacement, Quantity::velocity, Quantity::theta, Quantity::mu};
  std::array<std::size_t, judged_states> at{};
  for (std::size_t i = 0; i < judged_states; ++i) {
    at[i] = static_cast<std::size_t>(
        std::find(e.quantities.begin(), e.quantities.end(), judged[i]) - e.quantities.begin());
  }
  Eigen::Matrix4d covariance;
  for (std::size_t i = 0; i < judged_states; ++i) {
    for (std::size_t j = 0; j < judged_states; ++j) {
      covariance(static_cast<int>(i), static_cast<int>(j)) = e.covariance[at[i]][at[j]];
    }
  }
  const Eigen::Vector4d error(e.displacement_m - t.displacement_m, e.velocity_m_s - t.velocity_m_s,
                              e.theta - t.theta, e.mu - mu);
  return error.dot(covariance.ldlt().solve(error));
}

}  // namespace

Errors watch(const Run& run, const Model& believed, double from_s, const Estimator& estimator) {
  Errors out;
  const double mu = run.real.friction.mu.value;
  const double v0 = std::max(run.real.friction.transition_speed_m_s.value, 1.0e-3);
  const auto from = static_cast<std::size_t>(from_s / period_s);
  // One delay of the filters away from a transition.
  const physics::SensorBank bank(believed, period_s);
  const auto delay =
      static_cast<long>(bank.chain(Channel::displacement).settling_time_s() / 3.0 / period_s);
  std::vector<bool> sticks;
  for (const auto& truth : run.truth) sticks.push_back(std::abs(truth.slip_velocity_m_s) < v0);
  std::vector<long> since(sticks.size());
  for (std::size_t i = 1; i < sticks.size(); ++i)
    since[i] = sticks[i] == sticks[i - 1] ? since[i - 1] + 1 : 0;
  std::vector<long> until(sticks.size(), 1000000);
  for (std::size_t i = sticks.size() - 1; i-- > 0;)
    until[i] = sticks[i] == sticks[i + 1] ? until[i + 1] + 1 : 0;
  long judged = 0, right = 0, counted = 0, raw_counted = 0;
  double nis = 0.0, nis_freedom = 0.0;
  const FrictionEstimate* latest = nullptr;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    const FrictionEstimate& e = estimator(run.frames[i]);
    latest = &e;
    if (i < from || !e.valid) continue;
    const physics::RigTruth& t = run.truth[i];
    ++counted;
    const auto square = [](double x) { return x * x; };
    out.theta += square(e.theta - t.theta);
    out.force += square(e.friction_force_n - t.friction_force_n);
    out.theta_doubt += square(e.standard_deviation(Quantity::theta));
    out.force_doubt += square(e.standard_deviation(Quantity::friction_force));
    if (e.raw_valid) {
      out.raw += square(e.raw_friction_force_n - t.friction_force_n);
      ++raw_counted;
    }
    nis += e.nis;
    nis_freedom += e.nis_freedom;
    if (i % 50 == 0) {
      out.mean_nees += nees_of(e, t, mu) / judged_states * 50.0;
    }
    if (since[i] > delay && until[i] > delay) {
      ++judged;
      if ((e.sticking > 0.5) == sticks[i]) ++right;
    }
  }
  const auto n = static_cast<double>(std::max(counted, 1L));
  out.theta = std::sqrt(out.theta / n);
  out.force = std::sqrt(out.force / n);
  out.theta_doubt = std::sqrt(out.theta_doubt / n);
  out.force_doubt = std::sqrt(out.force_doubt / n);
  out.raw = raw_counted > 0 ? std::sqrt(out.raw / static_cast<double>(raw_counted)) : 0.0;
  out.mean_nees /= n;
  out.nis = nis / std::max(nis_freedom, 1.0);
  const FrictionEstimate& last = *latest;
  out.nees = nees_of(last, run.truth.back(), mu);
  out.mu = std::abs(last.mu / mu - 1.0);
  if (last.gamma_per_s > 0.0) {
    out.gamma = std::abs(last.gamma_per_s / run.real.friction.rate_per_s.value - 1.0);
  }
  out.classified = judged > 0 ? static_cast<double>(right) / static_cast<double>(judged) : 1.0;
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
