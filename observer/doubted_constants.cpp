#include "observer/doubted_constants.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stickslip::observer {

namespace state = physics::state;

DoubtedConstants::DoubtedConstants(physics::Model model, const physics::Rig& rig,
                                   const Layout& layout, double period_s)
    : structure_(&rig.structure()), layout_(&layout), period_s_(period_s) {
  const std::vector<double>& values = rig.parameter_values();
  const std::vector<physics::NamedParameter> parameters = physics::parameters_of(model);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double sigma = parameters[i].parameter->sigma;
    // Imposed motion has no oscillator, and the rest is a state, noise, or not followed.
    if (!(sigma > 0.0) || !parameters[i].path.starts_with("oscillator.")) continue;
    // The slope at the value, within half of it: a doubt may be larger than a mass can be.
    const double size = std::abs(values[i]);
    const double off = size > 0.0 ? std::min(0.5 * sigma, 0.5 * size) : 0.5 * sigma;
    const double sigmas = 0.5 * sigma / off;
    const auto numbers_at = [&](double offset) {
      std::vector<double> moved = values;
      moved[i] += offset;
      return rig.numbers<double>(std::span<const double>(moved));
    };
    const physics::RigNumbers<double> more = numbers_at(off);
    const physics::RigNumbers<double> less = numbers_at(-off);
    const auto change = [&](auto coefficient) {
      return sigmas *
             (coefficient(more.c) * more.inverse_mass - coefficient(less.c) * less.inverse_mass);
    };
    Push push;
    push.by_v = -change([](const auto& c) { return c.damping; });
    if (structure_->two_well) {
      push.by_x = change([](const auto& c) { return c.well_linear; });
      push.by_x_cubed = -change([](const auto& c) { return c.well_cubic; });
    } else {
      push.by_x = -change([](const auto& c) { return c.stiffness; });
    }
    push.by_force = sigmas * (more.inverse_mass - less.inverse_mass);
    push_.push_back(push);
  }
  group_.resize((push_.size() + lanes - 1) / lanes);
  forget();
}

void DoubtedConstants::forget() {
  for (Group& group : group_) group.fill(Off::Zero());
}

void DoubtedConstants::push(const Vector& mean) {
  const Layout& l = *layout_;
  const double x = mean[l.rig[state::x]];
  const double v = mean[l.rig[state::v]];
  double force = l.friction >= 0 ? -mean[l.friction] : 0.0;
  if (structure_->excitation == physics::Excitation::force) force += mean[l.drive];
  const auto at = [](int index) { return static_cast<std::size_t>(index); };
  for (int i = 0; i < static_cast<int>(push_.size()); ++i) {
    const Push& p = push_[at(i)];
    const double acceleration =
        p.by_x * x + p.by_x_cubed * x * x * x + p.by_v * v + p.by_force * force;
    Group& group = group_[at(i / lanes)];
    group[at(l.rig[state::v])][i % lanes] += period_s_ * acceleration;
    // At once, not bit by bit: with the whole of it the mass would go twice as far.
    group[at(l.rig[state::x])][i % lanes] -= 0.5 * period_s_ * period_s_ * acceleration;
  }
}

void DoubtedConstants::propagate(const Transition& transition) {
  for (Group& group : group_) move(group, transition);
}

void DoubtedConstants::move(Group& group, const Transition& transition) {
  const auto sum_of = [&group](const Transition::Entry* entry,
                               const Transition::Entry* end) -> Off {
    // Two sums, so that an addition need not wait for the one before it.
    Off even = Off::Zero();
    Off odd = Off::Zero();
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

void DoubtedConstants::correct(const Sight& sight, const Covariance::States& gain) {
  for (Group& group : group_) {
    Off seen = group[static_cast<std::size_t>(sight.at[0])];
    if (sight.count > 1) {
      seen *= sight.weight[0];
      for (std::size_t j = 1; j < static_cast<std::size_t>(sight.count); ++j) {
        seen += sight.weight[j] * group[static_cast<std::size_t>(sight.at[j])];
      }
    }
    if ((seen == 0.0).all()) continue;  // the drive, which no constant pushes
    for (int i = 0; i < layout_->count; ++i) group[static_cast<std::size_t>(i)] -= gain[i] * seen;
  }
}

void DoubtedConstants::covariance_of(
    std::span<const int> states,
    std::array<std::array<double, quantity_count>, quantity_count>& out) const {
  // By constants, so that a row of the result is a few sums over whole registers.
  Eigen::Array<double, padded(quantity_count), lanes> off;
  Eigen::Array<double, padded(quantity_count), padded(quantity_count)> sum;
  off.setZero();
  sum.setZero();
  for (const Group& group : group_) {
    for (std::size_t i = 0; i < states.size(); ++i) {
      off.row(static_cast<int>(i)) = group[static_cast<std::size_t>(states[i])].transpose();
    }
    for (int i = 0; i < static_cast<int>(states.size()); ++i) {
      for (int k = 0; k < lanes; ++k) sum.col(i) += off(i, k) * off.col(k);
    }
  }
  for (std::size_t i = 0; i < states.size(); ++i) {
    for (std::size_t j = 0; j < states.size(); ++j) {
      out[i][j] = sum(static_cast<int>(j), static_cast<int>(i));
    }
  }
}

double DoubtedConstants::slip_variance() const {
  const int v = layout_->rig[state::v];
  const int u = layout_->rig[state::u];
  double sum = 0.0;
  for (const Group& group : group_) {
    Off slip = group[static_cast<std::size_t>(v)];
    if (u >= 0) slip -= group[static_cast<std::size_t>(u)];
    sum += slip.square().sum();
  }
  return sum;
}

}  // namespace stickslip::observer
