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
                                       ReadingErrors errors, const Layout& layout)
    : response_(std::move(response)), errors_(std::move(errors)), layout_(&layout) {
  const int count = response_->count() + errors_.count();
  group_.resize(at((count + lanes - 1) / lanes));
  input_.resize(group_.size());
  for (Group& group : input_) group.fill(Lanes::Zero());
  error_.assign(group_.size(), Lanes::Zero());
  load_ = error_;
  driven_ = response_->rows();
  driven_.insert(driven_.end(), errors_.rows().begin(), errors_.rows().end());
  reset();
}

void ConsiderParameters::reset() {
  for (Group& group : group_) group.fill(Lanes::Zero());
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

void ConsiderParameters::propagate(const Transition& transition, const Vector& before,
                                   const Vector& after, double time_s,
                                   double transition_speed_m_s) {
  response_->update(before, after, time_s, transition_speed_m_s);
  find_input(before);
  for (std::size_t g = 0; g < group_.size(); ++g) {
    propagate(group_[g], transition);
    for (const int row : driven_) group_[g][at(row)] += input_[g][at(row)];
  }
}

void ConsiderParameters::propagate(Group& group, const Transition& transition) {
  const auto sum_of = [&group](const Transition::Entry* entry,
                               const Transition::Entry* end) -> Lanes {
    // Two independent sums hide the latency of the additions.
    Lanes even = Lanes::Zero();
    Lanes odd = Lanes::Zero();
    for (; end - entry > 1; entry += 2) {
      even += entry[0].weight * group[entry[0].from];
      odd += entry[1].weight * group[entry[1].from];
    }
    if (entry != end) even += entry->weight * group[entry->from];
    return even + odd;
  };
  const int count = transition.count();
  for (int i = 0; i < transition.shared(); ++i) {
    const int sum = padded(count) + i;
    group[at(sum)] = sum_of(transition.shared_begin(i), transition.shared_end(i));
  }
  for (int i = 0; i < count; ++i) {
    next_[at(i)] = sum_of(transition.row_begin(i), transition.row_end(i));
  }
  std::copy_n(next_.begin(), count, group.begin());
}

void ConsiderParameters::read(const Frame& raw) { errors_.read(raw); }

double ConsiderParameters::project(Channel channel, const MeasurementRow& row, const Vector& mean) {
  Lanes sum = Lanes::Zero();
  for (std::size_t g = 0; g < group_.size(); ++g) {
    Lanes& error = error_[g];
    error = row.weight[0] * group_[g][at(row.state[0])];
    for (std::size_t j = 1; j < at(row.count); ++j) {
      error += row.weight[j] * group_[g][at(row.state[j])];
    }
  }
  for (int i = 0; i < errors_.count(); ++i) {
    const int lane = response_->count() + i;
    error_[at(lane / lanes)][lane % lanes] += errors_.of(i, channel, mean);
  }
  for (const Lanes& error : error_) sum += error.square();
  return sum.sum();
}

void ConsiderParameters::add_to(Covariance::States& column) const {
  for (std::size_t g = 0; g < group_.size(); ++g) {
    const Lanes& error = error_[g];
    if ((error == 0.0).all()) continue;  // the drive, which does not depend on the parameters
    for (int i = 0; i < layout_->count; ++i) column[i] += (group_[g][at(i)] * error).sum();
  }
}

void ConsiderParameters::correct(const Covariance::States& gain) {
  for (std::size_t g = 0; g < group_.size(); ++g) {
    const Lanes& error = error_[g];
    if ((error == 0.0).all()) continue;
    for (int i = 0; i < layout_->count; ++i) group_[g][at(i)] -= gain[i] * error;
  }
}

Eigen::MatrixXd ConsiderParameters::columns_of(const std::vector<Group>& groups) const {
  Eigen::MatrixXd out(layout_->count, count());
  for (int k = 0; k < count(); ++k) {
    for (int i = 0; i < layout_->count; ++i) out(i, k) = groups[at(k / lanes)][at(i)][k % lanes];
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
  // Parameters outside, so that a row of the result is a few sums over whole registers.
  Eigen::Array<double, padded(quantity_count), lanes> error;
  Eigen::Array<double, padded(quantity_count), padded(quantity_count)> sum;
  error.setZero();
  sum.setZero();
  const auto count = static_cast<int>(quantities.size());
  for (std::size_t g = 0; g < group_.size(); ++g) {
    for (int i = 0; i < count; ++i) {
      const QuantityRow& row = quantities[at(i)];
      Lanes of_row = row.weight[0] * group_[g][at(row.state[0])];
      if (row.state[1] >= 0) of_row += row.weight[1] * group_[g][at(row.state[1])];
      if (row.is_load) of_row += load_[g];
      error.row(i) = of_row.transpose();
    }
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < lanes; ++k) sum.col(i) += error(i, k) * error.col(k);
    }
  }
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) out[at(i)][at(j)] = sum(j, i);
  }
}

double ConsiderParameters::slip_variance() const {
  const int v = layout_->rig[state::v];
  const int u = layout_->rig[state::u];
  double sum = 0.0;
  for (const Group& group : group_) {
    Lanes slip = group[at(v)];
    if (u >= 0) slip -= group[at(u)];
    sum += slip.square().sum();
  }
  return sum;
}

}  // namespace stickslip::observer
