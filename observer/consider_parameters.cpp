#include "observer/consider_parameters.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stickslip::observer {

namespace state = physics::state;

ConsiderParameters::ConsiderParameters(physics::Model model, const physics::Rig& rig,
                                       const Layout& layout, double period_s)
    : structure_(&rig.structure()), layout_(&layout), period_s_(period_s) {
  const std::vector<double>& values = rig.parameter_values();
  const std::vector<physics::NamedParameter> parameters = physics::parameters_of(model);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double sigma = parameters[i].parameter->sigma;
    // Other parameters are states or noise, or are not considered.
    if (!(sigma > 0.0) || !parameters[i].path.starts_with("oscillator.")) continue;
    // Central difference, with a step of at most half the value: sigma may exceed the mass.
    const double size = std::abs(values[i]);
    const double step = size > 0.0 ? std::min(0.5 * sigma, 0.5 * size) : 0.5 * sigma;
    const double sigmas = 0.5 * sigma / step;
    const auto numbers_at = [&](double offset) {
      std::vector<double> moved = values;
      moved[i] += offset;
      return rig.numbers<double>(std::span<const double>(moved));
    };
    const physics::RigNumbers<double> more = numbers_at(step);
    const physics::RigNumbers<double> less = numbers_at(-step);
    const auto change = [&](auto coefficient) {
      return sigmas *
             (coefficient(more.c) * more.inverse_mass - coefficient(less.c) * less.inverse_mass);
    };
    Input input;
    input.by_v = -change([](const auto& c) { return c.damping; });
    if (structure_->two_well) {
      input.by_x = change([](const auto& c) { return c.well_linear; });
      input.by_x_cubed = -change([](const auto& c) { return c.well_cubic; });
    } else {
      input.by_x = -change([](const auto& c) { return c.stiffness; });
    }
    input.by_force = sigmas * (more.inverse_mass - less.inverse_mass);
    input_.push_back(input);
  }
  group_.resize((input_.size() + lanes - 1) / lanes);
  reset();
}

void ConsiderParameters::reset() {
  for (Group& group : group_) group.fill(Lanes::Zero());
}

void ConsiderParameters::add_input(const Vector& mean) {
  const Layout& l = *layout_;
  const double x = mean[l.rig[state::x]];
  const double v = mean[l.rig[state::v]];
  double force = l.friction >= 0 ? -mean[l.friction] : 0.0;
  if (structure_->excitation == physics::Excitation::force) force += mean[l.drive];
  const auto at = [](int index) { return static_cast<std::size_t>(index); };
  for (int i = 0; i < static_cast<int>(input_.size()); ++i) {
    const Input& p = input_[at(i)];
    const double acceleration =
        p.by_x * x + p.by_x_cubed * x * x * x + p.by_v * v + p.by_force * force;
    Group& group = group_[at(i / lanes)];
    group[at(l.rig[state::v])][i % lanes] += period_s_ * acceleration;
    // The velocity changes at the start of the step: without this x would move twice as far.
    group[at(l.rig[state::x])][i % lanes] -= 0.5 * period_s_ * period_s_ * acceleration;
  }
}

void ConsiderParameters::propagate(const Transition& transition) {
  for (Group& group : group_) propagate(group, transition);
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
    group[static_cast<std::size_t>(sum)] =
        sum_of(transition.shared_begin(i), transition.shared_end(i));
  }
  for (int i = 0; i < count; ++i) {
    next_[static_cast<std::size_t>(i)] = sum_of(transition.row_begin(i), transition.row_end(i));
  }
  std::copy_n(next_.begin(), count, group.begin());
}

void ConsiderParameters::correct(const MeasurementRow& row, const Covariance::States& gain) {
  for (Group& group : group_) {
    Lanes error = group[static_cast<std::size_t>(row.state[0])];
    if (row.count > 1) {
      error *= row.weight[0];
      for (std::size_t j = 1; j < static_cast<std::size_t>(row.count); ++j) {
        error += row.weight[j] * group[static_cast<std::size_t>(row.state[j])];
      }
    }
    if ((error == 0.0).all()) continue;  // the drive, which does not depend on the parameters
    for (int i = 0; i < layout_->count; ++i) group[static_cast<std::size_t>(i)] -= gain[i] * error;
  }
}

void ConsiderParameters::covariance_of(
    std::span<const int> states,
    std::array<std::array<double, quantity_count>, quantity_count>& out) const {
  // Parameters outside, so that a row of the result is a few sums over whole registers.
  Eigen::Array<double, padded(quantity_count), lanes> error;
  Eigen::Array<double, padded(quantity_count), padded(quantity_count)> sum;
  error.setZero();
  sum.setZero();
  for (const Group& group : group_) {
    for (std::size_t i = 0; i < states.size(); ++i) {
      error.row(static_cast<int>(i)) = group[static_cast<std::size_t>(states[i])].transpose();
    }
    for (int i = 0; i < static_cast<int>(states.size()); ++i) {
      for (int k = 0; k < lanes; ++k) sum.col(i) += error(i, k) * error.col(k);
    }
  }
  for (std::size_t i = 0; i < states.size(); ++i) {
    for (std::size_t j = 0; j < states.size(); ++j) {
      out[i][j] = sum(static_cast<int>(j), static_cast<int>(i));
    }
  }
}

double ConsiderParameters::slip_variance() const {
  const int v = layout_->rig[state::v];
  const int u = layout_->rig[state::u];
  double sum = 0.0;
  for (const Group& group : group_) {
    Lanes slip = group[static_cast<std::size_t>(v)];
    if (u >= 0) slip -= group[static_cast<std::size_t>(u)];
    sum += slip.square().sum();
  }
  return sum;
}

}  // namespace stickslip::observer
