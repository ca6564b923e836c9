// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/detection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

// Tolerance of a limit, in the logarithm of the change of the readings.
constexpr double log_tolerance = 0.1;

using Change = std::vector<Eigen::VectorXd>;  // of the scaled readings, by window

// Inner product of two changes of the readings after the nuisance parameters (window states,
// calibrated parameters, knots of the base's noise) have been projected out.
class NuisanceProjection {
 public:
  NuisanceProjection(const Hypothesis& hypothesis, std::vector<WindowJacobian> windows)
      : windows_(std::move(windows)) {
    const auto np = static_cast<Eigen::Index>(hypothesis.unknowns().size());
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(np, np);
    for (const WindowJacobian& w : windows_) {
      Eigen::MatrixXd own = w.free.transpose() * w.free;
      own.diagonal().array() += 1.0;  // free columns are in units of their priors
      own_.emplace_back(own);
      cross_.push_back(w.free.transpose() * w.parameters);
      information += w.parameters.transpose() * w.parameters -
                     cross_.back().transpose() * own_.back().solve(cross_.back());
    }
    for (Eigen::Index i = 0; i < np; ++i) {
      const double sigma = hypothesis.unknowns()[static_cast<std::size_t>(i)].prior_sigma;
      information(i, i) += sigma > 0.0 ? 1.0 / (sigma * sigma) : 0.0;
      information(i, i) += 1.0e-12 * (1.0 + information(i, i));
    }
    common_.compute(information);
  }

  const Eigen::VectorXd& residual(std::size_t w) const { return windows_[w].residual; }
  Change residuals() const {
    Change all;
    for (const WindowJacobian& w : windows_) all.push_back(w.residual);
    return all;
  }
  double samples() const {
    double sum = 0.0;
    for (const WindowJacobian& w : windows_) sum += static_cast<double>(w.residual.size());
    return sum;
  }

  // product(a, a) is the increase of chi-squared by the change.
  double product(const Change& a, const Change& b) const {
    double sum = 0.0;
    Eigen::VectorXd ga = Eigen::VectorXd::Zero(common_.rows());
    Eigen::VectorXd gb = ga;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const WindowJacobian& j = windows_[w];
      const Eigen::VectorXd own_a = j.free.transpose() * a[w];
      const Eigen::VectorXd solved = own_[w].solve(j.free.transpose() * b[w]);
      sum += a[w].dot(b[w]) - own_a.dot(solved);
      ga += j.parameters.transpose() * a[w] - cross_[w].transpose() * own_[w].solve(own_a);
      gb += j.parameters.transpose() * b[w] - cross_[w].transpose() * solved;
    }
    return sum - ga.dot(common_.solve(gb));
  }

 private:
  std::vector<WindowJacobian> windows_;
  std::vector<Eigen::LLT<Eigen::MatrixXd>> own_;
  std::vector<Eigen::MatrixXd> cross_;
  Eigen::LDLT<Eigen::MatrixXd> common_;
};

// True if the effect modifies the equations gradually with its size, without replacing a law.
bool is_gradual(const Hypothesis& base, const Hypothesis& with) {
  const auto& a = base.rig().structure();
  const auto& b = with.rig().structure();
  return a.kinetics == b.kinetics && a.resonant == b.resonant;
}

struct Influence {
  DetectionLimit limit;
  Change change;
};

// Secant search for the size at which the logarithm of a change reaches `target`.
class SizeSearch {
 public:
  SizeSearch(double amount, double target) : amount_(amount), target_(target) {}

  double amount() const { return amount_; }

  // Moves on along a straight line through the logarithms: most effects are proportional to their
  // size.
  void advance(double log_change) {
    const double log_amount = std::log(amount_);
    double slope = 1.0;
    if (!first_ && log_amount != last_log_amount_) {
      slope =
          std::clamp((log_change - last_log_change_) / (log_amount - last_log_amount_), 0.5, 3.0);
    }
    first_ = false;
    last_log_amount_ = log_amount;
    last_log_change_ = log_change;
    amount_ = std::exp(log_amount + std::clamp((target_ - log_change) / slope, -12.0, 12.0));
  }

 private:
  double amount_;
  double target_;
  bool first_ = true;
  double last_log_amount_ = 0.0;
  double last_log_change_ = 0.0;
};

class LimitSearch {
 public:
  LimitSearch(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
              const Criteria& criteria)
      : task_(task),
        hypothesis_(hypothesis),
        fitted_(fitted),
        criteria_(criteria),
        projection_(hypothesis, jacobians_of(task, hypothesis, fitted.z, fitted.state)),
        residuals_(projection_.residuals()),
        samples_(projection_.samples()),
        target_(0.5 * std::log(criteria.claim_chi2 * samples_)) {}

  const NuisanceProjection& projection() const { return projection_; }

  // Of all starts of the effect, the smallest limit and the largest gain.
  std::optional<Influence> influence_of(const CandidateEffect& candidate,
                                        const physics::Scales& scales) const {
    const physics::Card& card = candidate.effect->card();
    if (!card.strength || candidate.is_number()) return std::nullopt;
    std::size_t position = 0;  // among the parameters that a start holds
    for (std::size_t k = 0; k < *card.strength; ++k) {
      if (!card.parameters[k].fixed_default) ++position;
    }
    const std::vector<double> fixed = candidate.effect->fixed(scales);
    std::optional<Influence> best;
    for (const std::vector<double>& start : candidate.effect->starts(scales)) {
      const std::size_t at = start.size() == card.parameters.size() ? *card.strength : position;
      if (!search_from(candidate, start, at, fixed, best)) break;
    }
    return best;
  }

 private:
  // Change of the readings by an effect that was added to the hypothesis.
  Change change_of(const Hypothesis& with) const {
    std::vector<double> z = fitted_.z;
    z.resize(with.unknowns().size(), 0.0);  // terms come last
    const std::vector<WindowState> state =
        warm_start_states(fitted_.state, task_, hypothesis_, with);
    Change change;
    for (std::size_t w = 0; w < task_.windows.size(); ++w) {
      change.push_back(residuals_of(task_, w, with, z, state[w]) - projection_.residual(w));
    }
    return change;
  }

  // Updates `best` by a search from one start, whose element `at` is the strength. False if the
  // effect replaces a law.
  bool search_from(const CandidateEffect& candidate, std::vector<double> start, std::size_t at,
                   const std::vector<double>& fixed, std::optional<Influence>& best) const {
    const physics::Card& card = candidate.effect->card();
    const physics::ParameterCard& parameter = card.parameters[*card.strength];
    double amount = std::abs(start[at] - parameter.neutral);
    if (!(amount > 0.0)) amount = 1.0e-3 * (parameter.high - parameter.neutral);
    SizeSearch size(amount, target_);
    for (int i = 0; i < criteria_.effort.detection_evaluations; ++i) {
      start[at] = parameter.neutral + size.amount();
      const Hypothesis with =
          hypothesis_.with(*candidate.effect, candidate.place, start, fixed, Detail::coarse);
      if (!is_gradual(hypothesis_, with)) return false;
      Change change = change_of(with);
      const double square = projection_.product(change, change);
      const double log_change =
          std::isfinite(square) ? 0.5 * std::log(std::max(square, 1.0e-30)) : 20.0;
      if (std::abs(log_change - target_) < log_tolerance) {
        const double correlation = projection_.product(residuals_, change);
        const double gain = std::max(best ? best->limit.gain : 0.0,
                                     correlation * correlation / (square * samples_));
        if (!best || size.amount() < std::abs(best->limit.value - parameter.neutral)) {
          best = Influence{{candidate, start[at]}, std::move(change)};
        }
        best->limit.gain = gain;
        break;
      }
      size.advance(log_change);
      if (parameter.neutral + size.amount() > parameter.high) break;
    }
    return true;
  }

  const Task& task_;
  const Hypothesis& hypothesis_;
  const Fit& fitted_;
  const Criteria& criteria_;
  NuisanceProjection projection_;
  Change residuals_;
  double samples_;
  double target_;
};

std::vector<InseparablePair> inseparable_pairs(const std::vector<const Influence*>& influences,
                                               const NuisanceProjection& projection, int threads,
                                               double min_cosine) {
  const std::size_t n = influences.size();
  std::vector<double> product(n * n, 0.0);
  parallel::for_each(n, threads, [&](std::size_t a) {
    for (std::size_t b = 0; b <= a; ++b) {
      product[a * n + b] = projection.product(influences[a]->change, influences[b]->change);
    }
  });
  std::vector<InseparablePair> out;
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const double norm = product[a * n + a] * product[b * n + b];
      const double cosine = norm > 0.0 ? std::abs(product[a * n + b]) / std::sqrt(norm) : 0.0;
      if (cosine >= min_cosine) out.push_back({b, a, std::min(cosine, 1.0)});
    }
  }
  std::stable_sort(out.begin(), out.end(), [](const InseparablePair& a, const InseparablePair& b) {
    return a.cosine > b.cosine;
  });
  return out;
}

}  // namespace

Detection detection_limits(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                           const std::vector<CandidateEffect>& candidates,
                           const std::function<physics::Scales(const physics::Place&)>& scales,
                           const Criteria& criteria) {
  const LimitSearch search(task, hypothesis, fitted, criteria);
  std::vector<std::optional<Influence>> influences(candidates.size());
  parallel::for_each(candidates.size(), task.threads, [&](std::size_t i) {
    influences[i] = search.influence_of(candidates[i], scales(candidates[i].place));
  });
  Detection out;
  std::vector<const Influence*> found;
  for (const auto& each : influences) {
    if (!each) continue;
    found.push_back(&*each);
    out.limits.push_back(each->limit);
  }
  out.inseparable =
      inseparable_pairs(found, search.projection(), task.threads, criteria.inseparable_cosine);
  return out;
}

}  // namespace stickslip::diagnosis
