#include "observer/smoother.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <vector>

#include "observer/kalman_filter.h"

namespace stickslip::observer {

namespace {

Matrix matrix_of(const Covariance& covariance) {
  Matrix out(covariance.count(), covariance.count());
  for (int i = 0; i < covariance.count(); ++i) {
    for (int j = 0; j <= i; ++j) out(i, j) = out(j, i) = covariance(i, j);
  }
  return out;
}

/// A Gaussian belief.
struct Belief {
  Vector mean;
  Matrix covariance;
};

/// What all later readings say of a state: the logarithm of their likelihood is
/// -d' weight d / 2 + d' pull for a state that is d off what the filter held it to be.
struct Future {
  Matrix weight;
  Vector pull;

  /// The same with `noise` between the state and what they speak of.
  void blur(Matrix noise);
};

void Future::blur(Matrix noise) {
  // One direction of the noise after the other, as in Cholesky's factors.
  for (Eigen::Index i = 0; i < noise.rows(); ++i) {
    if (!(noise(i, i) > 0.0)) continue;
    const Vector direction = noise.col(i) / std::sqrt(noise(i, i));
    noise -= direction * direction.transpose();
    const Vector seen = weight * direction;
    const double share = 1.0 / (1.0 + direction.dot(seen));
    pull -= seen * (share * direction.dot(pull));
    weight -= share * seen * seen.transpose();
  }
}

/// A period that passed.
struct Passage {
  Matrix derivatives;
  Matrix process_noise;  ///< added before it
  Matrix output_noise;   ///< and after it
};

/// A moment at which the filter stood.
struct Moment {
  std::optional<Passage> passage;           ///< to it; none where the filter began
  Vector predicted;                         ///< before its readings
  Belief held;                              ///< after them
  std::array<double, channel_count> off{};  ///< readings less predictions
  std::array<Sight, channel_count> sight{};
  std::array<double, channel_count> exact{};  ///< 1 / variance of the readings; 0: not used
  std::optional<FrictionEstimate> estimate;   ///< none of a frame that is missing
};

class Smoother {
 public:
  Smoother(const physics::Model& model, double period_s, const SmoothingWindow& window,
           const std::function<void(const FrictionEstimate&)>& take)
      : filter_(model, period_s, Contact::learnt),
        take_(take),
        keep_(static_cast<std::size_t>(std::max(1.0, window.keep_s / period_s))),
        ahead_(static_cast<std::size_t>(std::max(1.0, window.ahead_s / period_s))) {}

  void add(const Frame& frame);
  void finish() { look_back(moments_.size()); }

 private:
  void pass(KalmanFilter& filter);
  void look_back(std::size_t keep);
  void step_back(const Moment& moment, Future& future) const;
  FrictionEstimate told(const Moment& moment, const Future& future, bool followed) const;

  KalmanFilter filter_;
  const std::function<void(const FrictionEstimate&)>& take_;
  std::size_t keep_, ahead_;
  std::deque<Moment> moments_;
};

void Smoother::pass(KalmanFilter& filter) {
  Moment moment;
  Passage passage;
  passage.process_noise = matrix_of(filter.process_noise());
  filter.predict();
  passage.derivatives = filter.transition().dense();
  passage.output_noise = matrix_of(filter.output_noise());
  moment.passage = std::move(passage);
  moment.predicted = filter.mean();
  moment.held.mean = filter.mean();  // of a frame that is missing
  moments_.push_back(std::move(moment));
}

void Smoother::add(const Frame& frame) {
  const FrictionEstimate& estimate = filter_.estimate();
  const std::uint64_t restarts = estimate.restarts;
  const std::size_t moments = moments_.size();
  filter_.update(frame, [this](KalmanFilter& filter) { pass(filter); });
  if (estimate.standing == Standing::out_of_step) return;
  if (moments_.size() == moments || estimate.restarts != restarts) {
    // What was begun here knows nothing of what was before, nor does that of this.
    moments_.resize(moments);
    moments_.emplace_back();
  }
  Moment& moment = moments_.back();
  moment.held = {filter_.mean(), matrix_of(filter_.covariance())};
  moment.estimate = estimate;
  if (moment.passage) {
    for (Channel channel : all_channels) {
      const std::size_t i = index_of(channel);
      const unsigned used = estimate.innovation_valid & ~unsigned{estimate.refused};
      if (((used >> i) & 1U) == 0) continue;
      const KalmanFilter::Look look = filter_.look(channel, filter_.frame(), moment.predicted);
      moment.sight[i] = *look.sight;
      moment.off[i] = filter_.frame()[channel] - look.foretold;
      moment.exact[i] = 1.0 / look.variance;
    }
  }
  if (moments_.size() >= keep_ + ahead_) look_back(keep_);
}

// From after a moment's readings to before the period that led to it.
void Smoother::step_back(const Moment& moment, Future& future) const {
  future.pull += future.weight * (moment.held.mean - moment.predicted);
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (moment.exact[i] == 0.0) continue;
    const Sight& sight = moment.sight[i];
    const auto terms = static_cast<std::size_t>(sight.count);
    for (std::size_t j = 0; j < terms; ++j) {
      for (std::size_t k = 0; k < terms; ++k) {
        future.weight(sight.at[j], sight.at[k]) +=
            moment.exact[i] * sight.weight[j] * sight.weight[k];
      }
      future.pull[sight.at[j]] += moment.exact[i] * sight.weight[j] * moment.off[i];
    }
  }
  future.blur(moment.passage->output_noise);
  const Matrix& f = moment.passage->derivatives;
  future.weight = (f.transpose() * future.weight * f).eval();
  future.pull = (f.transpose() * future.pull).eval();
  future.blur(moment.passage->process_noise);
}

// Smooths all moments and hands on the first `keep` of them.
void Smoother::look_back(std::size_t keep) {
  const auto nothing = [this] {
    const auto count = filter_.mean().size();
    return Future{Matrix::Zero(count, count), Vector::Zero(count)};
  };
  Future future = nothing();
  bool followed = false;  // whether the filter was sure of itself later in this stretch
  std::vector<FrictionEstimate> out;
  for (std::size_t i = moments_.size(); i-- > 0;) {
    const Moment& moment = moments_[i];
    if (moment.estimate) {
      followed = followed || moment.estimate->standing == Standing::good;
      if (i < keep) out.push_back(told(moment, future, followed));
    }
    if (moment.passage) {
      step_back(moment, future);
    } else {
      future = nothing();
      followed = false;
    }
  }
  for (std::size_t i = out.size(); i-- > 0;) take_(out[i]);
  moments_.erase(moments_.begin(), moments_.begin() + static_cast<std::ptrdiff_t>(keep));
}

FrictionEstimate Smoother::told(const Moment& moment, const Future& future, bool followed) const {
  FrictionEstimate estimate = *moment.estimate;
  if (estimate.standing == Standing::waiting) return estimate;
  // Past and future together: P - P W (1 + P W)^-1 P, with states measured by their own doubt.
  const Matrix& p = moment.held.covariance;
  const Vector scale = p.diagonal().cwiseMax(1.0e-300).cwiseSqrt();
  const auto scaled = scale.asDiagonal();
  const auto unscaled = scale.cwiseInverse().asDiagonal();
  const Matrix past = unscaled * p * unscaled;
  const Matrix seen = past * (scaled * future.weight * scaled);
  const Matrix known = (Matrix::Identity(p.rows(), p.cols()) + seen).partialPivLu().solve(past);
  const Vector mean = moment.held.mean + scaled * (known * (scaled * future.pull));

  Covariance covariance(static_cast<int>(p.rows()));
  for (int i = 0; i < covariance.count(); ++i) {
    for (int j = 0; j <= i; ++j) {
      covariance.set(i, j, 0.5 * (known(i, j) + known(j, i)) * scale[i] * scale[j]);
    }
  }
  filter_.tell(mean, covariance, nullptr, estimate);
  if (estimate.standing == Standing::settling && followed) {
    estimate.standing = Standing::good;
    estimate.valid = true;
  }
  return estimate;
}

void count(const FrictionEstimate& e, Foretelling& foretelling) {
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (((e.innovation_valid >> i) & 1U) == 0) continue;
    if (((e.refused >> i) & 1U) != 0) {
      ++foretelling.refused;
      continue;
    }
    const double variance = e.innovation_std[i] * e.innovation_std[i];
    const double squared = e.innovation[i] * e.innovation[i] / variance;
    foretelling.negative_log_likelihood +=
        0.5 * (squared + std::log(2.0 * std::numbers::pi * variance));
    foretelling.normalised_squares += squared;
    ++foretelling.readings;
  }
  foretelling.restarts = e.restarts;
}

/// Means of what is learnt of a contact, weighted by how sure it is.
class Learnt {
 public:
  void add(const FrictionEstimate& e) {
    if (!e.valid) return;
    mu_.add(e.mu, e.standard_deviation(Quantity::mu));
    gamma_.add(e.gamma_per_s, e.standard_deviation(Quantity::gamma));
  }
  /// The model with these means in the place of its own values.
  physics::Model in(physics::Model model) const {
    mu_.put(model.friction.mu);
    gamma_.put(model.friction.rate_per_s);
    return model;
  }

 private:
  struct Mean {
    double sum = 0.0;
    double weight = 0.0;
    void add(double value, double deviation) {
      if (!(deviation > 0.0)) return;
      sum += value / (deviation * deviation);
      weight += 1.0 / (deviation * deviation);
    }
    void put(physics::Parameter& parameter) const {
      if (weight > 0.0) parameter.value = sum / weight;
    }
  };
  Mean mu_, gamma_;
};

/// The share of the whole work that the first of the two passes takes.
constexpr double first_pass = 0.1;

}  // namespace

Foretelling smooth(const physics::Model& model, double period_s, std::span<const Frame> frames,
                   const std::function<void(const FrictionEstimate&)>& take,
                   const SmoothingWindow& window,
                   const std::function<void(double share)>& progress) {
  if (!(period_s > 0.0)) throw std::invalid_argument("smooth: the period must be more than 0");
  // The filter is linear about what it holds to be true: once more, from where it ended.
  Learnt learnt;
  KalmanFilter first(model, period_s);
  if (!first.unsupported().empty()) throw std::invalid_argument(first.unsupported());
  Foretelling foretelling;
  const double count_of_frames = static_cast<double>(frames.size());
  double done = 0.0;
  for (const Frame& frame : frames) {
    if (progress) progress(first_pass * done++ / count_of_frames);
    first.update(frame);
    learnt.add(first.estimate());
    if (first.estimate().standing != Standing::out_of_step) count(first.estimate(), foretelling);
  }
  Smoother smoother(learnt.in(model), period_s, window, take);
  done = 0.0;
  for (const Frame& frame : frames) {
    if (progress) progress(first_pass + (1.0 - first_pass) * done++ / count_of_frames);
    smoother.add(frame);
  }
  smoother.finish();
  return foretelling;
}

}  // namespace stickslip::observer
