// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/expected_separation.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "diagnosis/design/expected_motion.h"
#include "diagnosis/experiment.h"
#include "diagnosis/parallel/for_each.h"

namespace stickslip::design {

namespace {

using diagnosis::OpenHypothesis;
using diagnosis::predicted_channels;

constexpr std::size_t samples_apart = 4;  // readings of a design are 8 ms apart

// A stretch of the true motion that is predicted.
struct Window {
  std::size_t reading = 0;  // its first one, whose state is known
  std::size_t count = 0;
};

std::vector<Window> windows_of(const Motion& motion, const SeparationSettings& settings) {
  const auto count =
      std::max<std::size_t>(8, static_cast<std::size_t>(settings.horizon_s / motion.period_s));
  std::vector<Window> out;
  for (std::size_t at = 1; at + count < motion.readings.size(); at += count) {
    out.push_back({at, count});
  }
  if (out.size() <= settings.most_windows) return out;
  std::vector<Window> some;
  for (std::size_t i = 0; i < settings.most_windows; ++i) {
    some.push_back(out[i * out.size() / settings.most_windows]);
  }
  return some;
}

// Scaled difference of two stretches of readings, in one column; values that are not finite or
// absurd are cut.
Eigen::VectorXd difference(std::span<const Frame> a, std::span<const Frame> b,
                           const SeparationSettings& settings) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(a.size() * predicted_channels));
  for (std::size_t k = 0; k < a.size(); ++k) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      const double sigma = settings.noise_std[c];
      double r = sigma > 0.0 ? (a[k].value[c] - b[k].value[c]) / sigma : 0.0;
      r = std::isfinite(r) ? std::clamp(r, -1.0e4, 1.0e4) : 1.0e4;
      out(static_cast<Eigen::Index>(k * predicted_channels + c)) = r;
    }
  }
  return out;
}

struct Sizes {
  double displacement = 1.0e-6;
  double velocity = 1.0e-5;
};

Sizes sizes_of(const Motion& motion) {
  Sizes out;
  for (const physics::RigTruth& state : motion.state) {
    out.displacement = std::max(out.displacement, std::abs(state.displacement_m));
    out.velocity = std::max(out.velocity, std::abs(state.velocity_m_s));
  }
  return out;
}

// Displacement and velocity of a window's state: prior standard deviations, or shifts in units of
// them.
using OfState = std::array<double, 2>;

// As in the windows of a diagnosis: a fit finds the states anew in each.
OfState state_sigmas(const Sizes& sizes, const SeparationSettings& settings) {
  return {0.05 * sizes.displacement + 5.0 * settings.noise_std[index_of(Channel::displacement)],
          0.1 * sizes.velocity};
}

physics::RigTruth moved(physics::RigTruth state, const OfState& by, const OfState& sigmas) {
  state.displacement_m += by[0] * sigmas[0];
  state.velocity_m_s += by[1] * sigmas[1];
  return state;
}

// Predictions of a stretch of a run by a hypothesis.
struct Predictor {
  const OpenHypothesis& of;
  const Drive& drive;
  std::size_t begin = 0;
  std::size_t count = 0;
  const SeparationSettings& settings;

  std::vector<Frame> readings(const physics::Model& model, const physics::RigTruth& start) const {
    return readings_from(model, drive, start, begin, count, samples_apart);
  }
  std::vector<Frame> readings(const physics::RigTruth& start) const {
    return readings(of.models.front(), start);
  }
};

// Changes of the prediction by one standard deviation of each parameter axis, in columns.
Eigen::MatrixXd by_parameters(const Predictor& predictor, const physics::RigTruth& start,
                              std::span<const Frame> predicted) {
  const std::vector<physics::Model>& models = predictor.of.models;
  Eigen::MatrixXd out(static_cast<Eigen::Index>(predicted.size() * predicted_channels),
                      static_cast<Eigen::Index>(models.size() - 1));
  for (std::size_t i = 1; i < models.size(); ++i) {
    out.col(static_cast<Eigen::Index>(i - 1)) =
        difference(predictor.readings(models[i], start), predicted, predictor.settings);
  }
  return out;
}

// The same of the state, from a step that is small against the speeds at which friction reverses.
Eigen::MatrixXd by_state(const Predictor& predictor, const physics::RigTruth& start,
                         const OfState& sigmas, std::span<const Frame> predicted) {
  constexpr double step = 0.01;
  Eigen::MatrixXd out(static_cast<Eigen::Index>(predicted.size() * predicted_channels), 2);
  for (std::size_t i = 0; i < 2; ++i) {
    OfState by{};
    by[i] = step;
    out.col(static_cast<Eigen::Index>(i)) =
        difference(predictor.readings(moved(start, by, sigmas)), predicted, predictor.settings) /
        step;
  }
  return out;
}

// The drive that the other hypothesis reads out of the recording of a true motion: a diagnosis
// knows the drive by its readings alone, so that a wrong zero of its sensor and a force on the mass
// are not separated by the drive that was wished.
Drive drive_by_readings(const Drive& drive, const physics::Model& other, const Motion& truth,
                        const Motion& others) {
  const std::size_t c = index_of(other.oscillator.excitation == physics::Excitation::force
                                     ? Channel::drive_force
                                     : Channel::base_displacement);
  const std::size_t count = std::min(truth.readings.size(), others.readings.size());
  const auto excess = [&](std::size_t reading) {
    const std::size_t at = std::min(reading, count - 1);
    return truth.readings[at].value[c] - others.readings[at].value[c];
  };
  Drive out = drive;
  if (count == 0) return out;
  for (std::size_t k = 0; k < out.samples.size(); ++k) {
    const std::size_t reading = k / samples_apart;
    const double share = static_cast<double>(k % samples_apart) / samples_apart;
    out.samples[k] += std::lerp(excess(reading), excess(reading + 1), share);
  }
  return out;
}

// A window to first order: 0.5 (denser |r - P p - S s|^2 + |s + from|^2) is what the log density
// loses where the parameters are `p` standard deviations off and the state moves by `s`.
struct Linearised {
  Eigen::VectorXd r;
  Eigen::MatrixXd parameters;  // P
  Eigen::MatrixXd state;       // S
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  double denser = 1.0;  // readings of the rig for each of r

  // Shift of the state that loses least, for parameters p.
  Eigen::Vector2d best_state(const Eigen::VectorXd& p) const {
    return information().ldlt().solve(denser * (state.transpose() * (r - parameters * p)) - from);
  }
  // Loss with that state.
  double lost(const Eigen::VectorXd& p) const {
    const Eigen::Vector2d s = best_state(p);
    return 0.5 *
           (denser * (r - parameters * p - state * s).squaredNorm() + (s + from).squaredNorm());
  }
  // Gradient and curvature of the loss by p, at p = 0.
  Eigen::VectorXd gradient() const {
    const Eigen::Vector2d s = best_state(Eigen::VectorXd::Zero(parameters.cols()));
    return -denser * (parameters.transpose() * (r - state * s));
  }
  Eigen::MatrixXd curvature() const {
    const Eigen::MatrixXd cross = denser * (state.transpose() * parameters);
    return denser * (parameters.transpose() * parameters) -
           cross.transpose() * information().ldlt().solve(cross);
  }

 private:
  Eigen::Matrix2d information() const {
    return denser * (state.transpose() * state) + Eigen::Matrix2d::Identity();
  }
};

// The parameters with which `weight` times all windows together, and their prior, lose least.
Eigen::VectorXd best_parameters(const std::vector<Linearised>& windows, double weight) {
  const Eigen::Index n = windows.front().parameters.cols();
  Eigen::MatrixXd curvature = Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
  for (const Linearised& each : windows) {
    curvature += weight * each.curvature();
    gradient += weight * each.gradient();
  }
  return -curvature.ldlt().solve(gradient);
}

// A window about the state that the other hypothesis would find there, with its parameters free:
// friction reverses where the state says so, and it is found as a fit does, step by step.
Linearised linearised(std::span<const Frame> readings, const Predictor& other,
                      const physics::RigTruth& start, const OfState& sigmas, double denser) {
  constexpr int most_steps = 5;
  constexpr double enough = 0.5;  // [nat]
  Linearised best;
  Linearised now;
  now.denser = denser;
  double least = std::numeric_limits<double>::infinity();
  for (int step = 0; step < most_steps; ++step) {
    const physics::RigTruth from = moved(start, {now.from[0], now.from[1]}, sigmas);
    const std::vector<Frame> predicted = other.readings(from);
    if (step == 0) now.parameters = by_parameters(other, from, predicted);
    now.state = by_state(other, from, sigmas, predicted);
    now.r = difference(readings, predicted, other.settings);
    const Eigen::VectorXd p = best_parameters({now}, 1.0);
    const double lost = now.lost(p) + 0.5 * p.squaredNorm();
    const bool is_better = lost < 0.9 * least;
    if (lost < least) best = now;
    least = std::min(least, lost);
    if (!is_better || least < enough) break;
    now.from += now.best_state(p);
  }
  return best;
}

// The state that the other hypothesis reads out of the first readings of a window: a wrong zero of
// the displacement is no force on the mass.
physics::RigTruth state_by_readings(physics::RigTruth start, std::span<const Frame> readings,
                                    Predictor other) {
  other.count = 1;
  const Frame& truth = readings.front();
  const Frame predicted = other.readings(start).front();
  const auto excess = [&](Channel channel) {
    const bool is_read = truth.has(channel) && predicted.has(channel);
    return is_read ? truth[channel] - predicted[channel] : 0.0;
  };
  start.displacement_m += excess(Channel::displacement);
  start.velocity_m_s += excess(Channel::velocity);
  return start;
}

// Both predictions begin with sensors at rest, so that the response of their filters to that
// beginning is nearly the same.
PairSeparation separation(const OpenHypothesis& truth, const OpenHypothesis& other,
                          const Motion& motion, const Drive& drive, const Drive& read,
                          const SeparationSettings& settings) {
  const double denser = settings.rate_hz * motion.period_s;
  const OfState sigmas = state_sigmas(sizes_of(motion), settings);
  const std::vector<Window> windows = windows_of(motion, settings);
  PairSeparation out;
  if (windows.empty() || !motion.finite) return out;
  std::vector<Linearised> linear;
  for (const Window& window : windows) {
    const physics::RigTruth& start = motion.state[window.reading];
    const std::size_t begin = window.reading * samples_apart;
    const Predictor of_truth{truth, drive, begin, window.count, settings};
    const Predictor of_other{other, read, begin, window.count, settings};
    const std::vector<Frame> readings = of_truth.readings(start);
    linear.push_back(linearised(readings, of_other, state_by_readings(start, readings, of_other),
                                sigmas, denser));
  }
  const auto n = static_cast<double>(windows.size());
  const double in_all =
      static_cast<double>(motion.readings.size()) / static_cast<double>(windows.front().count);
  const Eigen::VectorXd p = best_parameters(linear, in_all / n);
  double sum = 0.0;
  double squares = 0.0;
  for (const Linearised& each : linear) {
    const double lost = each.lost(p);
    sum += lost;
    squares += lost * lost;
  }
  const double compared = diagnosis::select_share * in_all;
  const double mean = sum / n;
  out.expected = compared * mean;
  out.error = compared * std::sqrt(std::max(0.0, squares / n - mean * mean) / n);
  return out;
}

}  // namespace

std::vector<PairSeparation> separations(const std::vector<OpenHypothesis>& hypotheses,
                                        const Drive& drive, const SeparationSettings& settings) {
  std::vector<PairSeparation> out;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    for (std::size_t j = 0; j < hypotheses.size(); ++j) {
      if (i != j) out.push_back({i, j});
    }
  }
  std::vector<Motion> motions(hypotheses.size());
  parallel::for_each(motions.size(), settings.threads, [&](std::size_t i) {
    motions[i] = motion_of(hypotheses[i].models.front(), drive, samples_apart);
  });
  parallel::for_each(out.size(), settings.threads, [&](std::size_t k) {
    const PairSeparation pair = out[k];
    const Motion& truth = motions[pair.truth];
    const OpenHypothesis& other = hypotheses[pair.other];
    const Drive read = drive_by_readings(drive, other.models.front(), truth, motions[pair.other]);
    out[k] = separation(hypotheses[pair.truth], other, truth, drive, read, settings);
    out[k].truth = pair.truth;
    out[k].other = pair.other;
  });
  return out;
}

double expected_gain(const std::vector<OpenHypothesis>& hypotheses,
                     const std::vector<PairSeparation>& separations) {
  double out = 0.0;
  for (const PairSeparation& pair : separations) {
    const double truth = hypotheses[pair.truth].probability;
    const double rest = std::max(1.0e-9, 1.0 - truth);
    const double excluded = pair.safe() / (pair.safe() + enough_nats);
    out += truth * hypotheses[pair.other].probability / rest * excluded;
  }
  return out;
}

}  // namespace stickslip::design
