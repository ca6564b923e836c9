// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/first_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/window_problem.h"

namespace stickslip::diagnosis {

namespace {

// Mean square of a change [noise variances]: the largest that is in proportion to its size, the
// smallest that rounding does not spoil, and what the next attempt aims at.
constexpr double largest_change = 1.0;
constexpr double smallest_change = 1.0e-6;
constexpr double next_change = 0.01;
constexpr int size_attempts = 4;
// Size of the first attempt, as a share of the start, and of the plausible range where a start has
// none of the effect: starts are large.
constexpr double share_of_start = 0.01;
constexpr double share_of_range = 1.0e-3;
// Damping of the steps, of which the first that lowers the cost is taken.
constexpr std::array step_damping = {0.0, 1.0e-2, 1.0e-1, 1.0, 10.0};

// Cost after a step to `z`, which `problem` is prepared for. Each window takes the better of its
// state after the step, `moved`, and the one before it: in chaotic motion some windows do not
// follow a step that all others do.
double cost_after(const WindowProblem& problem, std::span<const double> z,
                  const std::vector<WindowState>& before, std::vector<WindowState>& moved) {
  double cost = problem.parameter_prior(z);
  for (std::size_t w = 0; w < moved.size(); ++w) {
    const double with_moved = problem.evaluate(w, moved[w]).cost();
    const double with_old = problem.evaluate(w, before[w]).cost();
    if (with_old < with_moved) moved[w] = before[w];
    cost += std::min(with_old, with_moved);
  }
  return cost;
}

double square_of(const Change& change) {
  double sum = 0.0;
  for (const Eigen::VectorXd& each : change) sum += each.squaredNorm();
  return sum;
}

// True at a start without any of the effect.
bool has_none(const CandidateEffect& candidate, const Hypothesis& with) {
  const physics::Card& card = candidate.effect->card();
  const physics::BoundTerm& term = with.rig().terms().back();
  const auto strength = static_cast<std::size_t>(term.parameter[*card.strength]);
  const auto unknown = with.unknown_of(strength);
  return !unknown || with.value(*unknown, 0.0) == card.parameters[*card.strength].neutral;
}

// True if a campaign has every parameter of the effect in common.
bool is_common(const Hypothesis& base, const Hypothesis& with, const physics::Card& card) {
  const auto own = std::count_if(
      card.parameters.begin(), card.parameters.end(),
      [](const physics::ParameterCard& each) { return !each.fixed_default.has_value(); });
  return with.unknowns().size() == base.unknowns().size() + static_cast<std::size_t>(own);
}

// Outlying windows count as little as in a fit.
std::vector<NuisanceProjection> projections(const Task& task, const FittedCandidate& base,
                                            const std::vector<WindowState>& states) {
  const auto windows = jacobians_of(task, *base.hypothesis, base.fitted.z, states);
  std::vector<NuisanceProjection> out;
  out.reserve(step_damping.size());
  for (const double damping : step_damping) {
    out.emplace_back(*base.hypothesis, base.fitted.z, windows,
                     NuisanceProjection::Options{robust_weights(windows), damping});
  }
  return out;
}

}  // namespace

FirstSteps::FirstSteps(const Task& task, const FittedCandidate& base,
                       const std::vector<WindowState>& states)
    : task_(task), base_(base), states_(states), damped_(projections(task, base, states)) {
  const WindowProblem problem(task, *base.hypothesis, base.fitted.z, true);
  std::vector<WindowState> unmoved = states;
  cost_ = cost_after(problem, base.fitted.z, states, unmoved);
}

Change FirstSteps::change_at(const Hypothesis& with, std::span<const double> z) const {
  return change_by(with, task_, {&*base_.hypothesis, z, &states_}, damped_.front());
}

// The unknowns of the base as they are, beside the effect at its start.
std::vector<double> FirstSteps::unchanged(const Hypothesis& with) const {
  return carried_over(*base_.hypothesis, base_.fitted.z, with);
}

// The change by a small size of one unknown, which becomes the unit of the direction; none where
// the readings do not show it.
std::optional<Change> FirstSteps::scaled_change(const Hypothesis& with,
                                                Direction& direction) const {
  const double samples = damped_.front().samples();
  std::vector<double> z = unchanged(with);
  for (int i = 0; i < size_attempts; ++i) {
    z[direction.unknown] = with.z_of(direction.unknown, direction.none + direction.unit);
    Change change = change_at(with, z);
    const double mean_square = square_of(change) / samples;
    if (mean_square > smallest_change && mean_square < largest_change) return change;
    direction.unit *=
        mean_square > 0.0 ? std::sqrt(next_change / mean_square) : 1.0 / share_of_range;
  }
  return std::nullopt;
}

std::optional<FirstSteps::Sized> FirstSteps::sized(const CandidateEffect& candidate,
                                                   const Hypothesis& with) const {
  const auto& cards = candidate.effect->card().parameters;
  const physics::BoundTerm& term = with.rig().terms().back();
  const bool none_yet = has_none(candidate, with);
  std::vector<Direction> directions;
  std::vector<Change> changes;
  for (std::size_t k = 0; k < cards.size(); ++k) {
    if (!none_yet && k != *candidate.effect->card().strength) continue;
    const auto unknown = with.unknown_of(static_cast<std::size_t>(term.parameter[k]));
    if (!unknown) continue;
    const double start = with.value(*unknown, 0.0);
    Direction direction{*unknown, none_yet ? start : cards[k].neutral, 0.0, cards[k].positive};
    direction.unit = none_yet ? share_of_range * (cards[k].high - direction.none)
                              : share_of_start * (start - direction.none);
    if (direction.unit == 0.0) continue;
    auto change = scaled_change(with, direction);
    if (!change) continue;
    directions.push_back(direction);
    changes.push_back(std::move(*change));
  }
  if (directions.empty()) return std::nullopt;
  const Response response = damped_.front().response_to(changes);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const Direction& each = directions[i];
    const double value = each.none + response.size[static_cast<Eigen::Index>(i)] * each.unit;
    if (each.positive && !(value > 0.0)) return std::nullopt;
  }
  return Sized{with, std::move(directions), std::move(changes), response.gain};
}

// The unknowns after a step from `z`.
std::vector<double> FirstSteps::stepped(const Sized& sized, const Response& response,
                                        std::vector<double> z) {
  for (Eigen::Index u = 0; u < response.parameters.size(); ++u) {
    z[static_cast<std::size_t>(u)] += response.parameters[u];
  }
  for (std::size_t i = 0; i < sized.directions.size(); ++i) {
    const Direction& each = sized.directions[i];
    const double size = response.size[static_cast<Eigen::Index>(i)] * each.unit;
    z[each.unknown] = sized.hypothesis.z_of(each.unknown, each.none + size);
  }
  return z;
}

// The step, damped until it lowers the cost.
FittedCandidate FirstSteps::moved(const CandidateEffect& candidate, const Sized& sized) const {
  const Hypothesis& with = sized.hypothesis;
  const std::vector<double> from = unchanged(with);
  WindowProblem problem(task_, with, from, true);
  FittedCandidate out;
  out.candidate = candidate;
  out.hypothesis = with;
  out.fitted.states_per_window = static_cast<int>(problem.states());
  out.fitted.z = from;
  out.fitted.state = states_;
  out.fitted.cost = std::numeric_limits<double>::infinity();
  for (const NuisanceProjection& projection : damped_) {
    const Response response = projection.response_to(sized.changes);
    std::vector<double> z = stepped(sized, response, from);
    std::vector<WindowState> states;
    for (std::size_t w = 0; w < states_.size(); ++w) {
      states.push_back(problem.moved(w, states_[w], response.free[w]));
    }
    problem.prepare(z);
    const double cost = cost_after(problem, z, states_, states);
    if (cost < out.fitted.cost) {
      out.fitted.cost = cost;
      out.fitted.z = std::move(z);
      out.fitted.state = std::move(states);
    }
    if (cost < cost_) break;
  }
  return out;
}

std::optional<FirstStep> FirstSteps::after(const CandidateEffect& candidate,
                                           std::span<const std::vector<double>> starts,
                                           std::span<const double> fixed) const {
  if (candidate.is_number() || candidate.is_comparison() || starts.empty()) return std::nullopt;
  const physics::Card& card = candidate.effect->card();
  if (!card.strength) return std::nullopt;
  std::optional<Sized> best;
  std::optional<Hypothesis> first;
  for (const std::vector<double>& start : starts) {
    Hypothesis with = extended(*base_.hypothesis, candidate, start, fixed, Detail::coarse);
    if (replaces_law(*base_.hypothesis, with) || !is_common(*base_.hypothesis, with, card)) {
      return std::nullopt;
    }
    auto found = sized(candidate, with);
    if (found && (!best || found->gain > best->gain)) best = std::move(found);
    if (!first) first = std::move(with);
  }
  if (!best) best = Sized{*first, {}, {}, 0.0};
  return FirstStep{moved(candidate, *best), best->gain};
}

}  // namespace stickslip::diagnosis
