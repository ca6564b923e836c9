// SPDX-License-Identifier: Apache-2.0
#include "observer/consider_parameters.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace stickslip::observer {

namespace {

namespace state = physics::state;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

}  // namespace

ConsiderParameters::ConsiderParameters(std::unique_ptr<ParameterResponse> response,
                                       ReadingErrors errors, const Layout& layout,
                                       Covariance& covariance)
    : response_(std::move(response)),
      errors_(std::move(errors)),
      layout_(&layout),
      covariance_(&covariance) {
  input_.resize(at((count() + lanes - 1) / lanes));
  for (Group& group : input_) group.fill(Lanes::Zero());
  error_.assign(input_.size(), Lanes::Zero());
  load_ = error_;
  driven_ = response_->rows();
  driven_.insert(driven_.end(), errors_.rows().begin(), errors_.rows().end());
}

// Changes by this period itself.
void ConsiderParameters::find_input(const Vector& before) {
  const std::vector<int>& rows = response_->rows();
  for (int g = 0; g < response_->groups(); ++g) {
    load_[at(g)] = response_->load(g);
    const std::vector<Lanes>& changes = response_->changes(g);
    for (std::size_t k = 0; k < rows.size(); ++k) input_[at(g)][at(rows[k])] = changes[k];
  }
  for (int i = 0; i < errors_.count(); ++i) {
    const int lane = response_->count() + i;
    const std::vector<double>& changes = errors_.changes(i, before);
    for (std::size_t k = 0; k < changes.size(); ++k) {
      input_[at(lane / lanes)][at(errors_.rows()[k])][lane % lanes] = changes[k];
    }
  }
}

void ConsiderParameters::propagate(const Vector& before, const Vector& after, double time_s,
                                   double transition_speed_m_s) {
  response_->update(before, after, time_s, transition_speed_m_s);
  find_input(before);
  for (std::size_t g = 0; g < input_.size(); ++g) {
    for (const int row : driven_) {
      covariance_->sensitivity(row, static_cast<int>(g)) += input_[g][at(row)];
    }
  }
}

void ConsiderParameters::read(const Frame& raw) { errors_.read(raw); }

double ConsiderParameters::project(Channel channel, const MeasurementRow& row, const Vector& mean) {
  for (std::size_t g = 0; g < error_.size(); ++g) {
    const auto sensitivity = [&](std::size_t term) {
      return covariance_->sensitivity(row.state[term], static_cast<int>(g));
    };
    Lanes error = row.weight[0] * sensitivity(0);
    for (std::size_t j = 1; j < at(row.count); ++j) error += row.weight[j] * sensitivity(j);
    error_[g] = error;
  }
  for (int i = 0; i < errors_.count(); ++i) {
    const int lane = response_->count() + i;
    error_[at(lane / lanes)][lane % lanes] += errors_.of(i, channel, mean);
  }
  double variance = 0.0;
  for (const Lanes& error : error_) variance += error.square().sum();
  affects_ = variance != 0.0;
  return variance;
}

Eigen::MatrixXd ConsiderParameters::sensitivity() const {
  Eigen::MatrixXd out(layout_->count, count());
  for (int k = 0; k < count(); ++k) {
    for (int i = 0; i < layout_->count; ++i) {
      out(i, k) = covariance_->sensitivity(i, k / lanes)[k % lanes];
    }
  }
  return out;
}

Eigen::MatrixXd ConsiderParameters::input() const {
  Eigen::MatrixXd out(layout_->count, count());
  for (int k = 0; k < count(); ++k) {
    for (int i = 0; i < layout_->count; ++i) out(i, k) = input_[at(k / lanes)][at(i)][k % lanes];
  }
  return out;
}

Eigen::VectorXd ConsiderParameters::load() const {
  Eigen::VectorXd out(count());
  for (int k = 0; k < count(); ++k) out[k] = load_[at(k / lanes)][k % lanes];
  return out;
}

Eigen::VectorXd ConsiderParameters::reading_errors(Channel channel, const Vector& mean) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(count());
  for (int i = 0; i < errors_.count(); ++i) {
    out[response_->count() + i] = errors_.of(i, channel, mean);
  }
  return out;
}

void ConsiderParameters::covariance_of(
    std::span<const QuantityRow> quantities,
    std::array<std::array<double, quantity_count>, quantity_count>& out) const {
  std::array<Lanes, quantity_count> error;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    std::fill_n(out[i].begin(), i + 1, 0.0);
  }
  for (int g = 0; g < static_cast<int>(error_.size()); ++g) {
    for (std::size_t i = 0; i < quantities.size(); ++i) {
      const QuantityRow& row = quantities[i];
      error[i] = row.weight[0] * covariance_->sensitivity(row.state[0], g);
      if (row.state[1] >= 0) error[i] += row.weight[1] * covariance_->sensitivity(row.state[1], g);
      if (row.is_load) error[i] += load_[at(g)];
      for (std::size_t j = 0; j <= i; ++j) out[i][j] += (error[i] * error[j]).sum();
    }
  }
}

double ConsiderParameters::slip_variance() const {
  const int v = layout_->rig[state::v];
  const int u = layout_->rig[state::u];
  double sum = 0.0;
  for (int g = 0; g < static_cast<int>(error_.size()); ++g) {
    Lanes slip = covariance_->sensitivity(v, g);
    if (u >= 0) slip -= covariance_->sensitivity(u, g);
    sum += slip.square().sum();
  }
  return sum;
}

}  // namespace stickslip::observer
