// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/expected_separation.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "diagnosis/design/expected_motion.h"
#include "diagnosis/experiment.h"
#include "diagnosis/parallel/for_each.h"

namespace stickslip::design {

namespace {

using diagnosis::OpenHypothesis;
using diagnosis::predicted_channels;

constexpr std::size_t samples_apart = 4;  // readings of a design are 8 ms apart
// Of the states of a window, over the size of the motion: a fit finds them anew in each.
constexpr double state_sigma = 0.05;

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

// Changes of the prediction by one standard deviation of what is marginalised, in columns.
Eigen::MatrixXd sensitivities(const OpenHypothesis& other, const Drive& drive,
                              const physics::RigTruth& start, const Sizes& sizes, std::size_t begin,
                              std::span<const Frame> predicted,
                              const SeparationSettings& settings) {
  std::vector<Eigen::VectorXd> columns;
  const auto add = [&](const physics::Model& model, const physics::RigTruth& from) {
    const auto changed = readings_from(model, drive, from, begin, predicted.size(), samples_apart);
    columns.push_back(difference(changed, predicted, settings));
  };
  for (std::size_t i = 1; i < other.models.size(); ++i) add(other.models[i], start);
  physics::RigTruth moved = start;
  moved.displacement_m += state_sigma * sizes.displacement;
  add(other.models.front(), moved);
  moved = start;
  moved.velocity_m_s += state_sigma * sizes.velocity;
  add(other.models.front(), moved);
  Eigen::MatrixXd out(columns.front().size(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i)
    out.col(static_cast<Eigen::Index>(i)) = columns[i];
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

// Half of r' (I + S S')^-1 r, for readings that are `denser` times as many.
double log_density_lost(const Eigen::VectorXd& r, const Eigen::MatrixXd& s, double denser) {
  const Eigen::VectorXd projected = denser * (s.transpose() * r);
  const Eigen::MatrixXd information =
      denser * (s.transpose() * s) + Eigen::MatrixXd::Identity(s.cols(), s.cols());
  const double absorbed = projected.dot(information.ldlt().solve(projected));
  return std::max(0.0, 0.5 * (denser * r.squaredNorm() - absorbed));
}

// Both predictions begin at the true state with sensors at rest there, so that the response of
// their filters to that beginning is the same.
PairSeparation separation(const OpenHypothesis& truth, const OpenHypothesis& other,
                          const Motion& motion, const Drive& drive, const Drive& read,
                          const SeparationSettings& settings) {
  const double denser = settings.rate_hz * motion.period_s;
  const Sizes sizes = sizes_of(motion);
  const std::vector<Window> windows = windows_of(motion, settings);
  PairSeparation out;
  if (windows.empty() || !motion.finite) return out;
  double sum = 0.0;
  double squares = 0.0;
  for (const Window& window : windows) {
    const physics::RigTruth& start = motion.state[window.reading];
    const std::size_t begin = window.reading * samples_apart;
    const auto readings =
        readings_from(truth.models.front(), drive, start, begin, window.count, samples_apart);
    const auto predicted =
        readings_from(other.models.front(), read, start, begin, window.count, samples_apart);
    const Eigen::VectorXd r = difference(readings, predicted, settings);
    const Eigen::MatrixXd s = sensitivities(other, read, start, sizes, begin, predicted, settings);
    const double lost = log_density_lost(r, s, denser);
    sum += lost;
    squares += lost * lost;
  }
  const auto n = static_cast<double>(windows.size());
  const double in_all =
      static_cast<double>(motion.readings.size()) / static_cast<double>(windows.front().count);
  const double mean = sum / n;
  out.expected = in_all * mean;
  out.error = in_all * std::sqrt(std::max(0.0, squares / n - mean * mean) / n);
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
