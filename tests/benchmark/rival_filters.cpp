// SPDX-License-Identifier: Apache-2.0
#include "rival_filters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace stickslip::observer {

namespace {

namespace state = physics::state;

// As in KalmanFilter.
constexpr double steep_transition_m_s = 5.0e-4;
constexpr double outlier_sigmas = 8.0;
constexpr double outliers_to_restart_s = 0.05;
constexpr double nis_memory_s = 0.5;
constexpr double nis_to_restart = 12.0;
constexpr double implausible_to_restart_s = 0.2;
constexpr double drive_measured_s = 0.1;

double square(double x) { return x * x; }

physics::Model without_jumps(physics::Model model) {
  auto& speed = model.friction.transition_speed_m_s.value;
  speed = std::max(speed, steep_transition_m_s);
  return model;
}

Vector small(const Eigen::VectorXd& states) { return states; }

}  // namespace

RivalFilter::RivalFilter(const physics::Model& model, double period_s)
    : model_(without_jumps(model)),
      rig_(model_),
      period_s_(period_s),
      layout_(make_layout(model_, rig_, reason_)),
      reporter_(model, period_s),
      scratch_(std::min(layout_.count, max_states)) {
  if (!reporter_.unsupported().empty()) throw std::invalid_argument(reporter_.unsupported());
  const int steps = static_cast<int>(std::ceil(period_s / rig_.longest_step_s() - 1.0e-9));
  prediction_ = make_prediction(rig_, model_, layout_, period_s_, steps);
  noise_ = std::make_unique<NoiseModel>(model_, rig_, layout_, prediction_->numbers(), period_s_,
                                        FrictionPrior::from_model);
  const physics::SensorBank bank(model_, period_s_ / steps);
  settle_s_ = std::clamp(bank.settling_time_s(), 20.0 * period_s_, 2.0);
  startup_s_ = 2.0 * settle_s_;
  refused_in_a_row_.assign(channel_count, 0);
  estimate_ = reporter_.estimate();
}

void RivalFilter::begin(const Frame& frame) {
  const bool keeps_mu = layout_.mu >= 0 && started_ && std::isfinite(state_.mean[layout_.mu]);
  const double old_mu = keeps_mu ? state_.mean[layout_.mu] : 0.0;
  Vector mean = Vector::Zero(layout_.count);
  scratch_.set_zero();
  noise_->initialise(frame, old_mu, mean, scratch_);
  state_.mean = mean;
  state_.covariance.setZero(layout_.count, layout_.count);
  for (int i = 0; i < layout_.count; ++i) {
    for (int j = 0; j < layout_.count; ++j) state_.covariance(i, j) = scratch_(i, j);
  }
  started_ = true;
  since_start_s_ = 0.0;
  nis_level_ = 1.0;
  implausible_s_ = 0.0;
  std::fill(refused_in_a_row_.begin(), refused_in_a_row_.end(), 0);
}

const FrictionEstimate& RivalFilter::update(const Frame& frame) {
  noise_->estimate_reading_noise(frame);
  FrameResult seen;
  since_drive_s_ += period_s_;
  if (!started_) {
    begin(frame);
    seen = correct(frame, state_);
    reinitialised(state_);
  } else {
    since_start_s_ += period_s_;
    seen = update_state(frame, state_);
  }
  if (frame.has(drive_channel(rig_.structure()))) {
    since_drive_s_ = 0.0;
    noise_->adapt_input_noise(drive_channel(rig_.structure()), seen.drive);
  }
  if (!is_healthy(seen)) {
    ++estimate_.restarts;
    begin(frame);
    reinitialised(state_);
  }
  for (int i = 0; i < layout_.count; ++i) {
    for (int j = 0; j <= i; ++j) scratch_.set(i, j, state_.covariance(i, j));
  }
  reporter_.fill_estimate(small(state_.mean), scratch_, nullptr, estimate_);
  estimate_.time_ns = frame.time_ns;
  estimate_.nis = seen.nis;
  estimate_.nis_freedom = static_cast<std::uint8_t>(seen.nis_freedom);
  estimate_.status = since_start_s_ < settle_s_ ? EstimateStatus::settling : EstimateStatus::good;
  estimate_.valid = estimate_.status == EstimateStatus::good;
  return estimate_;
}

bool RivalFilter::is_healthy(const FrameResult& seen) {
  if (seen.nis_freedom > 0) {
    nis_level_ +=
        std::min(1.0, period_s_ / nis_memory_s) * (seen.nis / seen.nis_freedom - nis_level_);
  }
  for (std::size_t i = 0; i < channel_count; ++i) {
    refused_in_a_row_[i] = (seen.refused >> i & 1U) != 0 ? refused_in_a_row_[i] + 1 : 0;
  }
  if (!state_.mean.allFinite() || !state_.covariance.allFinite()) return false;
  implausible_s_ = noise_->is_implausible(small(state_.mean)) ? implausible_s_ + period_s_ : 0.0;
  if (implausible_s_ > implausible_to_restart_s) return false;
  if (state_.covariance.diagonal().minCoeff() < -1.0e-18) return false;
  if (since_start_s_ > startup_s_ && nis_level_ > nis_to_restart) return false;
  const int most = std::max(5, static_cast<int>(outliers_to_restart_s / period_s_));
  return *std::max_element(refused_in_a_row_.begin(), refused_in_a_row_.end()) <= most;
}

Eigen::RowVectorXd RivalFilter::slip_row() const {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(layout_.count);
  row[layout_.rig[state::v]] = 1.0;
  if (layout_.rig[state::u] >= 0) row[layout_.rig[state::u]] = -1.0;
  return row;
}

double RivalFilter::slip_variance(const Eigen::MatrixXd& p) const {
  const int v = layout_.rig[state::v];
  const int u = layout_.rig[state::u];
  if (u < 0) return p(v, v);
  return p(v, v) + p(u, u) - 2.0 * p(v, u);
}

Eigen::MatrixXd RivalFilter::process_noise(const Gaussian& estimate, double slip_variance) {
  scratch_.set_zero();
  // The noise of the drive's lambda depends on its variance.
  const int lambda = layout_.drive + 3;
  const double before = estimate.covariance(lambda, lambda);
  scratch_.set(lambda, lambda, before);
  noise_->add_process_noise(small(estimate.mean), slip_variance, since_start_s_ - period_s_,
                            {.drive = noise_->reading_variance(drive_channel(rig_.structure())),
                             .load = noise_->reading_variance(Channel::normal_load)},
                            scratch_);
  scratch_.add(lambda, lambda, -before);
  Eigen::MatrixXd q(layout_.core, layout_.core);
  for (int i = 0; i < layout_.core; ++i) {
    for (int j = 0; j < layout_.core; ++j) q(i, j) = scratch_(i, j);
  }
  return q;
}

void RivalFilter::add_output_noise(Gaussian& estimate) {
  if (layout_.friction < 0) return;
  scratch_.set_zero();
  noise_->add_output_noise(small(estimate.mean), 0.0, scratch_);
  for (const int i : {layout_.theta, layout_.friction}) {
    for (const int j : {layout_.theta, layout_.friction}) {
      estimate.covariance(i, j) += scratch_(i, j);
    }
  }
}

void RivalFilter::predict(Gaussian& estimate, double slip_variance) {
  estimate.covariance.topLeftCorner(layout_.core, layout_.core) +=
      process_noise(estimate, slip_variance);
  Vector mean = estimate.mean;
  prediction_->advance(mean, 0.0, slip_variance);
  estimate.mean = mean;
  const Eigen::MatrixXd f = prediction_->transition().dense();
  estimate.covariance = f * estimate.covariance * f.transpose();
  add_output_noise(estimate);
}

FrameResult RivalFilter::correct(const Frame& frame, Gaussian& estimate) const {
  FrameResult seen;
  Eigen::VectorXd& mean = estimate.mean;
  Eigen::MatrixXd& p = estimate.covariance;
  const bool starting = since_start_s_ < startup_s_;
  const double mu_gain_factor =
      starting ? 0.0 : noise_->mu_gain_factor(small(mean), slip_variance(estimate.covariance));
  const Channel driven = drive_channel(rig_.structure());
  double since_drive_s = since_drive_s_;
  for (Channel channel : all_channels) {
    const Chain& chain = layout_.of(channel);
    if (!frame.has(channel) || !chain.used) continue;
    const Eigen::VectorXd column = p.col(chain.reading);
    const double innovation = frame[channel] - mean[chain.reading];
    const double expected = column[chain.reading] + noise_->reading_variance(channel);
    const double squared = square(innovation) / expected;
    if (channel == driven) {
      seen.drive = innovation / std::sqrt(expected);
      since_drive_s = 0.0;
    }
    seen.log_likelihood -= 0.5 * (std::min(squared, square(outlier_sigmas)) + std::log(expected));
    if (since_start_s_ > startup_s_ && squared > square(outlier_sigmas)) {
      seen.refused = static_cast<std::uint8_t>(seen.refused | (1U << index_of(channel)));
      continue;
    }
    seen.nis += squared;
    ++seen.nis_freedom;
    Eigen::VectorXd gain = column / expected;
    if (layout_.mu >= 0) gain[layout_.mu] *= mu_gain_factor;
    if (layout_.log_rate >= 0 && starting) gain[layout_.log_rate] = 0.0;
    if (channel != driven && since_drive_s < drive_measured_s) {
      gain.segment(layout_.drive, 4).setZero();
      gain.segment(layout_.of(driven).first, layout_.of(driven).count).setZero();
    }
    mean += gain * innovation;
    const Eigen::VectorXd rest = column - expected * gain;
    p -= gain * column.transpose() + rest * gain.transpose();
    p = (0.5 * (p + p.transpose())).eval();
  }
  Vector confined = mean;
  noise_->constrain(confined);
  mean = confined;
  return seen;
}

FrameResult TangentFilter::update_state(const Frame& frame, Gaussian& estimate) {
  predict(estimate, 0.0);
  return correct(frame, estimate);
}

FrameResult LinearisedFilter::update_state(const Frame& frame, Gaussian& estimate) {
  predict(estimate, slip_variance(estimate.covariance));
  return correct(frame, estimate);
}

FrameResult IteratedFilter::update_state(const Frame& frame, Gaussian& estimate) {
  const double variance = slip_variance(estimate.covariance);
  Eigen::MatrixXd before = estimate.covariance;
  before.topLeftCorner(layout_.core, layout_.core) += process_noise(estimate, variance);
  std::vector<Channel> read;
  for (Channel channel : all_channels) {
    if (frame.has(channel) && layout_.of(channel).used) read.push_back(channel);
  }
  const auto m = static_cast<Eigen::Index>(read.size());

  Eigen::VectorXd about = estimate.mean;  // point of linearisation
  double about_variance = variance;
  Gaussian predicted;
  for (int round = 0; round <= rounds_; ++round) {
    Vector end = about;
    prediction_->advance(end, 0.0, about_variance);
    const Eigen::MatrixXd f = prediction_->transition().dense();
    predicted.mean = end + f * (estimate.mean - about);
    const Eigen::MatrixXd across = before * f.transpose();
    predicted.covariance = f * across;
    if (round == rounds_) break;
    Eigen::MatrixXd with_readings(layout_.count, m);
    Eigen::MatrixXd s(m, m);
    Eigen::VectorXd innovation(m);
    for (Eigen::Index i = 0; i < m; ++i) {
      const Channel channel = read[static_cast<std::size_t>(i)];
      const int at = layout_.of(channel).reading;
      with_readings.col(i) = across.col(at);
      innovation[i] = frame[channel] - predicted.mean[at];
      for (Eigen::Index j = 0; j < m; ++j) {
        s(i, j) = predicted.covariance(at, layout_.of(read[static_cast<std::size_t>(j)]).reading);
      }
      s(i, i) += noise_->reading_variance(channel);
    }
    // Drive and mu are not smoothed by these readings.
    with_readings.middleRows(layout_.drive, 4).setZero();
    if (layout_.mu >= 0) with_readings.row(layout_.mu).setZero();
    const Eigen::LDLT<Eigen::MatrixXd> factor(s);
    about = estimate.mean + with_readings * factor.solve(innovation);
    const Eigen::RowVectorXd slip = slip_row() * with_readings;
    about_variance =
        std::max(0.0, slip_variance(before) - slip.dot(factor.solve(slip.transpose())));
    about_variance = std::min(about_variance, variance);
  }
  estimate = predicted;
  add_output_noise(estimate);
  return correct(frame, estimate);
}

Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = covariance.rows();
  Eigen::MatrixXd l = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    Eigen::VectorXd column =
        covariance.col(j).tail(n - j) - l.block(j, 0, n - j, j) * l.row(j).head(j).transpose();
    // The rest of a dependent state is rounding error.
    if (!(column[0] > 1.0e-12 * covariance(j, j))) continue;
    l.col(j).tail(n - j) = column / std::sqrt(column[0]);
  }
  return l;
}

FrameResult SigmaPointFilter::update_state(const Frame& frame, Gaussian& estimate) {
  const int n = layout_.count;
  const int core = layout_.core;
  // No widened tanh and no noise for its error: the points account for the nonlinearity.
  estimate.covariance.topLeftCorner(core, core) += process_noise(estimate, 0.0);
  const Eigen::MatrixXd root = root_of(estimate.covariance);
  const auto arrive = [&](const Eigen::VectorXd& from) -> Eigen::VectorXd {
    Vector states = from;
    prediction_->advance(states, 0.0, 0.0);
    return states;
  };
  const Eigen::VectorXd centre = arrive(estimate.mean);
  const Eigen::MatrixXd f = prediction_->transition().dense();
  const double h2 = points_ == Points::near ? 3.0 : static_cast<double>(n);
  const double h = std::sqrt(h2);
  Eigen::MatrixXd slope = f * root;  // of the linear directions; the core follows
  Eigen::MatrixXd curvature = Eigen::MatrixXd::Zero(n, core);
  for (int j = 0; j < core; ++j) {
    const Eigen::VectorXd ahead = arrive(estimate.mean + h * root.col(j));
    const Eigen::VectorXd behind = arrive(estimate.mean - h * root.col(j));
    slope.col(j) = (ahead - behind) / (2.0 * h);
    curvature.col(j) = 0.5 * (ahead + behind) - centre;
  }
  const Eigen::VectorXd shift = curvature.rowwise().sum() / h2;
  estimate.mean = centre + shift;
  estimate.covariance = slope * slope.transpose();
  if (points_ == Points::near) {
    estimate.covariance += (h2 - 1.0) / (h2 * h2) * curvature * curvature.transpose();
  } else {
    const Eigen::MatrixXd about_mean = curvature.colwise() - shift;
    estimate.covariance += (about_mean * about_mean.transpose() +
                            static_cast<double>(n - core) * shift * shift.transpose()) /
                           h2;
  }
  add_output_noise(estimate);
  return correct(frame, estimate);
}

Gaussian merged(const std::vector<double>& weights, const std::vector<Gaussian>& estimates) {
  Gaussian out{Eigen::VectorXd::Zero(estimates.front().mean.size()), {}};
  const Eigen::Index n = out.mean.size();
  out.covariance = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < estimates.size(); ++i) out.mean += weights[i] * estimates[i].mean;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const Eigen::VectorXd off = estimates[i].mean - out.mean;
    out.covariance += weights[i] * (estimates[i].covariance + off * off.transpose());
  }
  return out;
}

namespace {

double density(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi); }
double share_below(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

/// A Gaussian truncated to low..high.
struct Part {
  double share = 0.0;
  double mean = 0.0;
  double variance = 0.0;
};

Part part_of(double mean, double variance, double low, double high) {
  const double deviation = std::sqrt(variance);
  const double a = (low - mean) / deviation;
  const double b = (high - mean) / deviation;
  Part part;
  // Difference in the smaller tail, against cancellation.
  part.share = a > 0.0 ? share_below(-a) - share_below(-b) : share_below(b) - share_below(a);
  if (part.share < 1.0e-9) return part;
  const double at_a = std::isfinite(a) ? density(a) : 0.0;
  const double at_b = std::isfinite(b) ? density(b) : 0.0;
  const double shift = (at_a - at_b) / part.share;
  const double a_edge = std::isfinite(a) ? a * at_a : 0.0;
  const double b_edge = std::isfinite(b) ? b * at_b : 0.0;
  part.mean = mean + deviation * shift;
  part.variance =
      variance * std::clamp(1.0 + (a_edge - b_edge) / part.share - square(shift), 1.0e-3, 1.0);
  return part;
}

}  // namespace

// The estimates in the three regions of the slip velocity, without those of negligible weight.
std::vector<InteractingFilter::Mode> InteractingFilter::mixed() const {
  // tanh(2) = 0.96: the contact slides beyond.
  const double limit = 2.0 * prediction_->numbers().c.transition_speed;
  const double edges[] = {-HUGE_VAL, -limit, limit, HUGE_VAL};
  constexpr double min_weight = 1.0e-6;
  const Eigen::RowVectorXd slip = slip_row();
  std::vector<Mode> out;
  for (int region = 0; region < 3; ++region) {
    std::vector<double> weights;
    std::vector<Gaussian> estimates;
    double sum = 0.0;
    for (const Mode& mode : modes_) {
      const double mean = slip * mode.estimate.mean;
      const double variance = std::max(slip_variance(mode.estimate.covariance), 1.0e-18);
      const Part part = part_of(mean, variance, edges[region], edges[region + 1]);
      const double weight = mode.weight * part.share;
      if (weight < min_weight) continue;
      const Eigen::VectorXd gain = mode.estimate.covariance * slip.transpose() / variance;
      estimates.push_back(
          {mode.estimate.mean + gain * (part.mean - mean),
           mode.estimate.covariance + gain * gain.transpose() * (part.variance - variance)});
      weights.push_back(weight);
      sum += weight;
    }
    if (weights.empty()) continue;
    for (double& weight : weights) weight /= sum;
    out.push_back({sum, merged(weights, estimates)});
  }
  return out;
}

FrameResult InteractingFilter::update_state(const Frame& frame, Gaussian& estimate) {
  modes_ = mixed();
  std::vector<FrameResult> seen;
  for (Mode& mode : modes_) {
    predict(mode.estimate, slip_variance(mode.estimate.covariance));
    seen.push_back(correct(frame, mode.estimate));
  }
  std::size_t best = 0;
  for (std::size_t i = 1; i < seen.size(); ++i) {
    if (seen[i].log_likelihood > seen[best].log_likelihood) best = i;
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    modes_[i].weight *= std::exp(seen[i].log_likelihood - seen[best].log_likelihood);
    sum += modes_[i].weight;
  }
  std::vector<double> weights;
  std::vector<Gaussian> estimates;
  std::size_t heaviest = 0;
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    modes_[i].weight /= sum;
    weights.push_back(modes_[i].weight);
    estimates.push_back(modes_[i].estimate);
    if (modes_[i].weight > modes_[heaviest].weight) heaviest = i;
  }
  estimate = merged(weights, estimates);
  return seen[heaviest];
}

}  // namespace stickslip::observer
