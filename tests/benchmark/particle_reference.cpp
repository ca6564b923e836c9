// SPDX-License-Identifier: Apache-2.0
#include "particle_reference.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "physics/backbone.h"

namespace stickslip::observer {

namespace {

using physics::gamma_ars;
using physics::Kinetics;
using physics::NormalLoadLaw;
namespace state = physics::state;

// exp(a t)
Eigen::MatrixXd exponential(const Eigen::MatrixXd& a, double t) {
  const double norm = a.lpNorm<Eigen::Infinity>() * t;
  const int halvings =
      std::max(0, static_cast<int>(std::ceil(std::log2(std::max(norm, 1e-9)))) + 2);
  const Eigen::MatrixXd x = a * (t / std::ldexp(1.0, halvings));
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(a.rows(), a.cols());
  Eigen::MatrixXd term = sum;
  for (int k = 1; k <= 14; ++k) {
    term = term * x / static_cast<double>(k);
    sum += term;
  }
  for (int k = 0; k < halvings; ++k) sum = (sum * sum).eval();
  return sum;
}

}  // namespace

ParticleReference::ParticleReference(RivalFilter& guide, double period_s, int particles,
                                     std::uint64_t seed)
    : guide_(&guide), period_s_(period_s), random_(seed) {
  const physics::Structure& structure = guide.rig().structure();
  if (structure.excitation != physics::Excitation::base || structure.two_well ||
      !structure.friction || structure.kinetics == Kinetics::bristle ||
      structure.load_law == NormalLoadLaw::measured) {
    throw std::invalid_argument("the particle reference supports base-excited linear rigs only");
  }
  build_layout();
  lambda_ = guide.estimate().mean[guide.layout().drive + 3];
  discretise();

  // Sampled states from their marginal distribution, linear ones from the conditional one.
  const Layout& l = guide.layout();
  const Gaussian& b = guide.estimate();
  std::vector<int> sampled;
  const bool relaxing = structure.kinetics == Kinetics::relaxing;
  if (relaxing) sampled.push_back(l.theta);
  for (const int i : {l.mu, l.log_rate, l.load}) {
    if (i >= 0) sampled.push_back(i);
  }
  const Eigen::MatrixXd among = b.covariance(sampled, sampled);
  const Eigen::MatrixXd across = b.covariance(linear_, sampled);
  const Eigen::MatrixXd gain = among.ldlt().solve(across.transpose()).transpose();
  covariance_ = b.covariance(linear_, linear_) - gain * across.transpose();
  const Eigen::MatrixXd root = root_of(among);
  Eigen::MatrixXd off(sampled.size(), particles);
  for (Eigen::Index i = 0; i < off.size(); ++i) off.data()[i] = normal_(random_);
  off = (root * off).eval();
  means_ = (gain * off).colwise() + Eigen::VectorXd(b.mean(linear_));
  const auto values = [&](int index, double otherwise) -> Eigen::RowVectorXd {
    const auto at = std::find(sampled.begin(), sampled.end(), index);
    if (index < 0 || at == sampled.end()) {
      return Eigen::RowVectorXd::Constant(particles, otherwise);
    }
    return (off.row(at - sampled.begin()).array() + b.mean[index]).matrix();
  };
  const auto& c = guide.numbers().c;
  theta_ = values(relaxing ? l.theta : -1, 0.0);
  mu_ = values(l.mu, c.mu);
  log_rate_ = values(l.log_rate, relaxing ? std::log(c.rate) : 0.0);
  load_ = values(l.load, structure.loaded ? c.load : 1.0);
  force_ = slip_ = log_weight_ = Eigen::RowVectorXd::Zero(particles);
}

void ParticleReference::build_layout() {
  const Layout& l = guide_->layout();
  place_.assign(static_cast<std::size_t>(l.count), -1);
  const auto add = [&](int index) {
    if (index < 0) return;
    place_[static_cast<std::size_t>(index)] = count_++;
    linear_.push_back(index);
  };
  for (const int i : {state::x, state::v, state::y, state::u}) {
    add(l.rig[static_cast<std::size_t>(i)]);
  }
  for (int i = 0; i < 4; ++i) add(l.drive + i);
  for (Channel channel : all_channels) {
    const Chain& chain = l.of(channel);
    if (!chain.used || channel == Channel::normal_load) continue;
    for (int i = 0; i < chain.count; ++i) add(chain.first + i);
  }
}

// Rate matrix of the linear states without contact force.
Eigen::MatrixXd ParticleReference::rates() const {
  const Layout& l = guide_->layout();
  const auto& c = guide_->numbers().c;
  const physics::Structure& structure = guide_->rig().structure();
  const auto at = [&](int index) { return place_[static_cast<std::size_t>(index)]; };
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(count_, count_);
  const int x = at(l.rig[state::x]);
  const int v = at(l.rig[state::v]);
  const int p = at(l.drive);
  a(x, v) = 1.0;
  a(v, x) = -c.stiffness / c.mass;
  a(v, v) = -c.damping / c.mass;
  a(v, p + 2) = -1.0;
  Eigen::RowVectorXd reads_force = Eigen::RowVectorXd::Zero(count_);
  if (structure.resonant) {
    const int y = at(l.rig[state::y]);
    const int u = at(l.rig[state::u]);
    a(y, u) = 1.0;
    a(u, y) = -c.cell_stiffness / c.cell_mass;
    a(u, u) = -c.cell_damping / c.cell_mass;
    a(u, p + 2) = -1.0;
    reads_force[y] = c.cell_stiffness;
  } else if (structure.load_cell) {
    reads_force[p + 2] = -c.cell_mass;
  }
  a(p, p + 1) = 1.0;
  a(p + 1, p + 2) = 1.0;
  a(p + 2, p + 1) = -lambda_;
  a(p + 1, p + 1) = a(p + 2, p + 2) = -1.0 / drive_memory_s;

  Eigen::RowVectorXd of_displacement = Eigen::RowVectorXd::Zero(count_);
  const auto connect = [&](Channel channel, Eigen::RowVectorXd input) {
    const Chain& chain = l.of(channel);
    int next = at(chain.first);
    for (const Section& section : chain.sections) {
      const int output = next++;
      if (!section.second_order) {
        a.row(output) = section.omega * input;
        a(output, output) -= section.omega;
      } else {
        const int rate = next++;
        a(output, rate) = 1.0;
        a.row(rate) = section.omega * section.omega * input;
        a(rate, output) -= section.omega * section.omega;
        a(rate, rate) -= section.damping;
      }
      if (channel == Channel::displacement) of_displacement = a.row(output);
      input.setZero();
      input[output] = 1.0;
    }
  };
  connect(Channel::displacement, Eigen::RowVectorXd::Unit(count_, x));
  connect(Channel::velocity, of_displacement);
  connect(Channel::friction_force, reads_force);
  connect(Channel::base_displacement, Eigen::RowVectorXd::Unit(count_, p));
  return a;
}

void ParticleReference::discretise() {
  const Layout& l = guide_->layout();
  const auto& c = guide_->numbers().c;
  const auto at = [&](int index) { return place_[static_cast<std::size_t>(index)]; };
  Eigen::VectorXd by_force = Eigen::VectorXd::Zero(count_);
  by_force[at(l.rig[state::v])] = -1.0 / c.mass;
  if (guide_->rig().structure().resonant) {
    by_force[at(l.rig[state::u])] = 1.0 / c.cell_mass;
  } else {
    // The force is the input of its channel's first section.
    const Chain& chain = l.of(Channel::friction_force);
    const Section& first = chain.sections.front();
    const int row = at(chain.first) + (first.second_order ? 1 : 0);
    by_force[row] = first.second_order ? first.omega * first.omega : first.omega;
  }
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(count_ + 1, count_ + 1);
  a.topLeftCorner(count_, count_) = rates();
  a.topRightCorner(count_, 1) = by_force;
  const Eigen::MatrixXd first = exponential(a, gamma_ars * period_s_);
  const Eigen::MatrixXd rest = exponential(a, (1.0 - gamma_ars) * period_s_);
  discrete_.middle = first.topLeftCorner(count_, count_);
  discrete_.whole = discrete_.middle * rest.topLeftCorner(count_, count_);
  discrete_.by_force_at_middle = first.topRightCorner(count_, 1);
  discrete_.by_end_force = discrete_.by_force_at_middle;
  discrete_.by_middle_force = discrete_.middle * rest.topRightCorner(count_, 1);
  const int p = at(l.drive);
  const double off = 0.01 * std::max(lambda_, 1.0);
  Eigen::MatrixXd faster = a.topLeftCorner(count_, count_);
  faster(p + 2, p + 1) -= off;
  const Eigen::MatrixXd moved = exponential(faster, period_s_) - discrete_.whole;
  discrete_.by_lambda = moved.middleCols(p + 1, 2) / off;
}

void ParticleReference::add_process_noise() {
  const Layout& l = guide_->layout();
  Gaussian centre = guide_->estimate();
  for (int i = 0; i < count_; ++i) {
    centre.mean[linear_[static_cast<std::size_t>(i)]] = means_.row(i).mean();
  }
  centre.mean[l.mu] = mu_mean_ > 0.0 ? mu_mean_ : mu_.mean();
  const Eigen::MatrixXd q = guide_->process_noise(centre, 0.0);
  const auto walk = [&](Eigen::RowVectorXd& values, int index) {
    if (index < 0 || index >= l.core) return;
    const double deviation = std::sqrt(q(index, index));
    for (double& value : values) value += deviation * normal_(random_);
  };
  walk(theta_, l.theta);
  walk(mu_, l.mu);
  walk(log_rate_, l.log_rate);
  walk(load_, l.load);
  for (int i = 0; i < count_; ++i) {
    for (int j = 0; j < count_; ++j) {
      const int row = linear_[static_cast<std::size_t>(i)];
      const int column = linear_[static_cast<std::size_t>(j)];
      if (row < l.core && column < l.core) covariance_(i, j) += q(row, column);
    }
  }
}

// Samples row * state + offset of each particle, and conditions its state on the result.
void ParticleReference::sample_along(const Eigen::RowVectorXd& row,
                                     const Eigen::RowVectorXd& offset,
                                     Eigen::RowVectorXd& sampled) {
  const Eigen::VectorXd column = covariance_ * row.transpose();
  const double variance = row * column;
  sampled = row * means_ + offset;
  if (variance < 1.0e-22) return;
  const double deviation = std::sqrt(variance);
  // tanh(5) is 1 to 10^-4.
  const double slides = 5.0 * guide_->numbers().c.transition_speed + 5.0 * deviation;
  if (sampled.cwiseAbs().minCoeff() > slides) return;
  Eigen::RowVectorXd off(means_.cols());
  for (double& value : off) value = deviation * normal_(random_);
  sampled += off;
  means_ += (column / variance) * off;
  covariance_ -= column * column.transpose() / variance;
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
}

// One implicit stage of the contact, as in the observer's prediction.
void ParticleReference::solve_stage(const Eigen::RowVectorXd& free_slip, double compliance,
                                    const Eigen::RowVectorXd& x, const Eigen::RowVectorXd& from,
                                    Eigen::RowVectorXd& theta, Eigen::RowVectorXd& force) {
  const auto& c = guide_->numbers().c;
  const physics::Structure& structure = guide_->rig().structure();
  const bool relaxing = structure.kinetics == Kinetics::relaxing;
  const bool wedge = structure.loaded && structure.load_law == NormalLoadLaw::wedge;
  for (Eigen::Index i = 0; i < free_slip.size(); ++i) {
    const double load = wedge ? std::max(0.0, load_[i] * (1.0 + c.load_slope * x[i])) : load_[i];
    const double level = mu_[i] * load;
    double kept = 0.0;
    double gain = 1.0;
    if (relaxing) {
      const double turn = gamma_ars * period_s_ * std::exp(log_rate_[i]);
      kept = 1.0 / (1.0 + turn);
      gain = turn * kept;
    }
    const double rest = kept * from[i];
    const auto solved = physics::solve_backbone(free_slip[i], compliance * level, rest, gain,
                                                c.transition_speed, slip_[i]);
    slip_[i] = solved.w;
    theta[i] = rest + gain * solved.tanh;
    force[i] = level * theta[i];
  }
}

void ParticleReference::update(const Frame& frame) {
  if (steps_++ % 50 == 0) {
    lambda_ = means_.row(place_[static_cast<std::size_t>(guide_->layout().drive + 3)]).mean();
    discretise();
  }
  add_process_noise();
  const Layout& l = guide_->layout();
  const auto at = [&](int index) { return place_[static_cast<std::size_t>(index)]; };
  const auto slip_of = [&](const Eigen::MatrixXd& m) -> Eigen::RowVectorXd {
    Eigen::RowVectorXd row = m.row(at(l.rig[state::v]));
    if (l.rig[state::u] >= 0) row -= m.row(at(l.rig[state::u]));
    return row;
  };
  const int x = at(l.rig[state::x]);
  const Eigen::Index particles = means_.cols();
  const Discrete& d = discrete_;
  Eigen::RowVectorXd theta(particles), force(particles), free;
  const Eigen::RowVectorXd zero = Eigen::RowVectorXd::Zero(particles);
  sample_along(slip_of(d.middle), zero, free);
  const Eigen::RowVectorXd middle_x = d.middle.row(x) * means_;
  solve_stage(free, -slip_of(d.by_force_at_middle)[0], middle_x, theta_, theta, force);

  sample_along(slip_of(d.whole), slip_of(d.by_middle_force)[0] * force, free);
  const int p = at(l.drive);
  Eigen::MatrixXd turned = means_.middleRows(p + 1, 2);
  Eigen::MatrixXd f = d.whole;
  f.col(p + 3) += d.by_lambda * turned.rowwise().mean();
  f.middleCols(p + 1, 2) += (means_.row(p + 3).mean() - lambda_) * d.by_lambda;
  turned.array().rowwise() *= means_.row(p + 3).array() - lambda_;
  means_ = d.whole * means_;
  means_ += d.by_lambda * turned;
  means_ += d.by_middle_force * force;
  covariance_ = f * covariance_ * f.transpose();
  const double on = (1.0 - gamma_ars) / gamma_ars;
  const Eigen::RowVectorXd from = (1.0 - on) * theta_ + on * theta;
  solve_stage(free, -slip_of(d.by_end_force)[0], means_.row(x), from, theta_, force_);
  means_ += d.by_end_force * force_;
  update_weights(frame);
  report_and_resample();
}

void ParticleReference::update_weights(const Frame& frame) {
  const Layout& l = guide_->layout();
  std::vector<int> read;
  std::vector<double> reading, variance;
  for (Channel channel : all_channels) {
    if (!frame.has(channel) || !l.of(channel).used || channel == Channel::normal_load) continue;
    read.push_back(place_[static_cast<std::size_t>(l.of(channel).reading)]);
    reading.push_back(frame[channel]);
    variance.push_back(guide_->noise().reading_variance(channel));
  }
  const auto m = static_cast<Eigen::Index>(read.size());
  Eigen::MatrixXd s = covariance_(read, read);
  s.diagonal() += Eigen::Map<const Eigen::VectorXd>(variance.data(), m);
  Eigen::MatrixXd innovation = -means_(read, Eigen::all);
  innovation.colwise() += Eigen::Map<const Eigen::VectorXd>(reading.data(), m);
  const Eigen::LLT<Eigen::MatrixXd> factor(s);
  const Eigen::MatrixXd across = covariance_(Eigen::all, read);
  const Eigen::MatrixXd gain = factor.solve(across.transpose()).transpose();
  log_weight_ -= 0.5 * factor.matrixL().solve(innovation).colwise().squaredNorm();
  means_ += gain * innovation;
  covariance_ -= gain * across.transpose();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
}

void ParticleReference::report_and_resample() {
  Eigen::RowVectorXd weight = (log_weight_.array() - log_weight_.maxCoeff()).exp();
  weight /= weight.sum();
  theta_mean_ = weight.dot(theta_);
  force_mean_ = weight.dot(force_);
  mu_mean_ = weight.dot(mu_);
  theta_variance_ = weight.dot((theta_.array() - theta_mean_).square().matrix());
  const double effective = 1.0 / weight.squaredNorm();
  min_effective_ = std::min(min_effective_, effective);
  const Eigen::Index particles = means_.cols();
  if (effective > 0.5 * static_cast<double>(particles)) return;
  // Systematic resampling.
  std::vector<Eigen::Index> chosen;
  const double step = 1.0 / static_cast<double>(particles);
  double next = step * std::uniform_real_distribution<double>(0.0, 1.0)(random_);
  double sum = 0.0;
  for (Eigen::Index i = 0; i < particles; ++i) {
    sum += weight[i];
    for (; next < sum; next += step) chosen.push_back(i);
  }
  chosen.resize(static_cast<std::size_t>(particles), particles - 1);
  means_ = means_(Eigen::all, chosen).eval();
  for (Eigen::RowVectorXd* values : {&theta_, &mu_, &log_rate_, &load_, &force_, &slip_}) {
    *values = (*values)(chosen).eval();
  }
  log_weight_.setZero();
}

}  // namespace stickslip::observer
