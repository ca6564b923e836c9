// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/window_derivatives.h"

#include <algorithm>

namespace stickslip::diagnosis {

using physics::Dual;
using physics::Quantities;
using physics::RigState;

namespace {

constexpr std::size_t block_size = Dual::directions;

std::size_t blocks_for(std::size_t directions) {
  return std::max<std::size_t>(1, (directions + block_size - 1) / block_size);
}

float& slope_at(std::vector<Dual::Derivatives>& row, std::size_t direction) {
  return row[direction / block_size][static_cast<Eigen::Index>(direction % block_size)];
}

bool has_own_states(const physics::Rig& rig) {
  return std::any_of(rig.terms().begin(), rig.terms().end(),
                     [](const physics::BoundTerm& term) { return term.effect->state_count() > 0; });
}

}  // namespace

std::vector<std::vector<Dual>> seeded_blocks(std::span<const double> parameters,
                                             const Directions& directions) {
  std::vector<std::vector<Dual>> out(blocks_for(directions.size()),
                                     {parameters.begin(), parameters.end()});
  for (std::size_t i = 0; i < directions.parameters.size(); ++i) {
    const Directions::Slope& each = directions.parameters[i];
    out[i / block_size][each.index].d[static_cast<Eigen::Index>(i % block_size)] =
        Dual::slope(each.slope);
  }
  return out;
}

DerivedMotion::DerivedMotion(const WindowRun& run, const physics::Rig& rig,
                             std::span<const double> parameters, const Directions& directions,
                             const WindowState& from, const physics::Input& now)
    : rig_(rig),
      parameters_(parameters),
      directions_(directions),
      from_(from),
      blocks_(blocks_for(directions.size())),
      derived_counts_(has_own_states(rig)) {
  for (const Directions::Slope& each : directions.states) state_.push_back(each.index);
  carried_ = state_.size() + (derived_counts_ ? 3 : 0);
  end_.assign(carried_ + 4, Row(blocks_, Slopes::Zero()));
  beginning_ = end_;
  for (std::size_t i = 0; i < state_.size(); ++i) {
    slope_at(beginning_[i], directions.parameters.size() + i) =
        Dual::slope(directions.states[i].slope);
  }
  add_passes(run);
  const double time_s = run.e.elapsed_s(run.window.warm);
  std::copy_n(from.begin(), value_.s.size(), value_.s.begin());
  const RigState<double> start = value_;
  for (const Pass& pass : passes_) {
    value_ = start;
    RigState<Dual> s = begun(pass);
    rig_.complete(s, now, time_s, pass.n);
    take(pass, {}, s, rig_.quantities(s, now, pass.n));
  }
  beginning_.swap(end_);
}

void DerivedMotion::add_passes(const WindowRun& run) {
  const auto capacity = static_cast<Eigen::Index>(block_size);
  const std::size_t count = directions_.parameters.size();
  drive_direction_ = static_cast<Eigen::Index>(carried_);
  Eigen::Index next = drive_direction_ + (directions_.knots > 0 ? 1 : 0);
  std::size_t first = 0;
  do {
    const std::size_t some = std::min(count - first, static_cast<std::size_t>(capacity - next));
    std::vector<Dual> seeded(parameters_.begin(), parameters_.end());
    for (std::size_t i = 0; i < some; ++i) {
      const Directions::Slope& each = directions_.parameters[first + i];
      seeded[each.index].d[next + static_cast<Eigen::Index>(i)] = Dual::slope(each.slope);
    }
    const auto n = numbers_on_recording<Dual>(rig_, std::span<const Dual>(seeded));
    const CorrectedInput<Dual> input(run, n, rig_.structure().excitation);
    passes_.push_back({n, input, first, some, next, passes_.empty()});
    first += some;
    next = 0;
  } while (first < count);
}

// The present state; in the first pass with its derivatives with respect to itself.
RigState<Dual> DerivedMotion::begun(const Pass& pass) const {
  RigState<Dual> s;
  std::copy(value_.s.begin(), value_.s.end(), s.s.begin());
  s.friction = value_.friction;
  s.theta = value_.theta;
  s.slip = value_.slip;
  s.load = value_.load;
  if (!pass.of_beginning) return s;
  Eigen::Index direction = 0;
  for (const std::size_t i : state_) s.s[i].d[direction++] = 1.0F;
  if (derived_counts_) {
    for (Dual* each : {&s.friction, &s.slip, &s.load}) each->d[direction++] = 1.0F;
  }
  return s;
}

void DerivedMotion::advance(const WindowStep& step) {
  const RigState<double> start = value_;
  for (const Pass& pass : passes_) {
    value_ = start;
    RigState<Dual> s = begun(pass);
    Dual error(step.error.of(from_));
    if (pass.of_beginning && directions_.knots > 0) error.d[drive_direction_] = 1.0F;
    s.unrecorded = pass.input.derivative_term(step.element, step.now, step.next) + error;
    if (rig_.structure().excitation == physics::Excitation::imposed) {
      s.s[physics::state::v] = step.now.velocity_m_s + s.unrecorded;
    }
    rig_.step(s, step.now, step.next, step.time_s, step.length_s, pass.n);
    take(pass, step.error, s, rig_.quantities(s, step.next, pass.n));
  }
  beginning_.swap(end_);
}

// The derivatives of the results of one step, from those with respect to what it begins with. Later
// passes add those of their parameters.
void DerivedMotion::carry(const Pass& pass, const DriveError::Shares& error,
                          std::span<const Slopes* const> result) {
  for (std::size_t b = 0; b < blocks_ && pass.of_beginning; ++b) {
    for (std::size_t r = 0; r < result.size(); ++r) {
      Slopes sum = Slopes::Zero();
      for (std::size_t i = 0; i < carried_; ++i) {
        sum += (*result[r])[static_cast<Eigen::Index>(i)] * beginning_[i][b];
      }
      end_[r][b] = sum;
    }
  }
  const std::size_t first_knot = directions_.parameters.size() + state_.size() + error.left;
  for (std::size_t r = 0; r < result.size(); ++r) {
    const Slopes& slopes = *result[r];
    if (pass.of_beginning && directions_.knots > 0) {
      slope_at(end_[r], first_knot) += slopes[drive_direction_] * Dual::slope(error.of_left);
      slope_at(end_[r], first_knot + 1) += slopes[drive_direction_] * Dual::slope(error.of_right);
    }
    for (std::size_t i = 0; i < pass.parameters; ++i) {
      slope_at(end_[r], pass.first_parameter + i) +=
          slopes[pass.first_direction + static_cast<Eigen::Index>(i)];
    }
  }
}

// The result of a step: its values, and its derivatives by direction.
void DerivedMotion::take(const Pass& pass, const DriveError::Shares& error, const RigState<Dual>& s,
                         const Quantities<Dual>& q) {
  std::array<const Slopes*, physics::max_rig_states + 7> result{};
  std::size_t rows = 0;
  for (const std::size_t i : state_) result[rows++] = &s.s[i].d;
  if (derived_counts_) {
    for (const Dual* each : {&s.friction, &s.slip, &s.load}) result[rows++] = &each->d;
  }
  for (const Dual* each : {&q.displacement, &q.velocity, &q.friction_reading, &q.normal_load}) {
    result[rows++] = &each->d;
  }
  carry(pass, error, std::span(result).first(rows));
  std::transform(s.s.begin(), s.s.end(), value_.s.begin(), [](const Dual& x) { return x.a; });
  value_.friction = s.friction.a;
  value_.theta = s.theta.a;
  value_.slip = s.slip.a;
  value_.load = s.load.a;
  read_ = {q.displacement.a, q.velocity.a, q.friction_reading.a, q.normal_load.a};
}

// After a step its result is what the next one begins with.
Quantities<Dual> DerivedMotion::quantities(std::size_t block) const {
  const auto slopes = [&](std::size_t i) { return beginning_[carried_ + i][block]; };
  return {{read_.displacement, slopes(0)},
          {read_.velocity, slopes(1)},
          {read_.friction_reading, slopes(2)},
          {read_.normal_load, slopes(3)}};
}

}  // namespace stickslip::diagnosis
