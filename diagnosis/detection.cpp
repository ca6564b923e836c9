// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/detection.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnosis/nuisance_projection.h"
#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

// Tolerance of a limit, in the logarithm of the change of the readings.
constexpr double log_tolerance = 0.1;

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
        projection_(hypothesis, fitted.z, jacobians_of(task, hypothesis, fitted.z, fitted.state)),
        samples_(projection_.samples()),
        target_(0.5 * std::log(criteria.detection_chi2 * samples_)) {}

  const NuisanceProjection& projection() const { return projection_; }

  // Of all starts of the effect, the smallest limit and the largest gain.
  std::optional<Influence> influence_of(const CandidateEffect& candidate,
                                        const physics::Scales& scales) const {
    const physics::Card& card = candidate.effect->card();
    if (!card.strength || candidate.is_number()) return std::nullopt;
    const std::vector<double> fixed = candidate.effect->fixed(scales);
    std::optional<Influence> best;
    for (const std::vector<double>& start : candidate.effect->starts(scales)) {
      if (!search_from(candidate, start, strength_in(card, start.size()), fixed, best)) break;
    }
    return best;
  }

 private:
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
      Change change =
          change_by(with, task_, {&hypothesis_, fitted_.z, &fitted_.state}, projection_);
      const double square = projection_.product(change, change);
      const double log_change =
          std::isfinite(square) ? 0.5 * std::log(std::max(square, 1.0e-30)) : 20.0;
      if (std::abs(log_change - target_) < log_tolerance) {
        const double slope = projection_.slope(change);
        const double gain =
            std::max(best ? best->limit.gain : 0.0, slope * slope / (square * samples_));
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
  out.samples = search.projection().samples();
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
