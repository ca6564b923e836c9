#include "diagnosis/search.h"

#include <algorithm>
#include <utility>

#include "diagnosis/finalists.h"
#include "diagnosis/screening.h"
#include "diagnosis/selection.h"
#include "physics/catalogue.h"

namespace stickslip::diagnosis {

using physics::Tier;

void Search::run(const physics::Model& model) {
  report("calibrating the declared model", 0.0);
  declared_ = calibrate(data_, model);
  declared_task_ = data_.train;
  current_ = declared_;
  update_features();
  while (claims_.size() < data_.criteria.max_findings && add_effect()) {
  }
  while (claims_.size() > 1 && drop_effect()) {
  }
}

void Search::report(const std::string& step, double share) const {
  if (!progress_) return;
  const double stages = static_cast<double>(data_.criteria.max_findings) + 1.0;
  progress_(step, 0.05 + 0.85 * (static_cast<double>(claims_.size()) + share) / stages);
}

std::vector<FittedCandidate> Search::screened(const FittedCandidate& base, double begin, double end,
                                              bool only_listed) const {
  return screen(data_, features_, base, only_listed, [&](const std::string& step, double done) {
    report(step, begin + done * (end - begin));
  });
}

// Of the residuals of the current model in all windows, fitted and held out.
void Search::update_features() {
  Task whole = data_.train;
  whole.windows.insert(whole.windows.end(), data_.held_out.windows.begin(),
                       data_.held_out.windows.end());
  std::sort(whole.windows.begin(), whole.windows.end(), [](const WindowRef& a, const WindowRef& b) {
    return std::pair(a.experiment, a.window) < std::pair(b.experiment, b.window);
  });
  FitOptions states_only;
  states_only.parameters_free = false;
  states_only.iterations = 6;
  states_only.multistart = false;
  const Fit fitted = fit(whole, *current_.hypothesis, current_.fitted.z,
                         initial_states(whole, *current_.hypothesis), states_only);
  features_ = residual_features(whole, *current_.hypothesis, fitted);
}

void Search::continue_from(const FittedCandidate& next) {
  current_ = next;
  settle(data_, current_);
}

void Search::claim(const FittedCandidate& winner, std::vector<FittedCandidate> rivals) {
  Claim claim;
  claim.candidate = winner.candidate;
  claim.rivals = std::move(rivals);
  claim.chi2_before = current_.held_out.chi2;
  continue_from(winner);
  update_features();
  claim.chi2_after = current_.held_out.chi2;
  claims_.push_back(std::move(claim));
}

Detection Search::detection() const {
  WindowSubset subset = window_subset(data_, current_);
  subset.task.threads = data_.threads;
  Fit fitted;
  fitted.z = current_.fitted.z;
  fitted.state = subset.state;
  std::vector<CandidateEffect> candidates =
      candidate_effects(current_.hypothesis->model(), data_.experiments);
  std::erase_if(candidates,
                [](const CandidateEffect& each) { return tier_of(each) == Tier::free_form; });
  const auto scales = [&](const physics::Place& place) {
    return scales_of(data_.experiments, *current_.hypothesis, current_.fitted.z, features_, place);
  };
  return detection_limits(subset.task, *current_.hypothesis, fitted, candidates, scales,
                          data_.criteria);
}

// True if a listed effect would explain a significant part of a small remainder.
bool Search::listed_effect_remains() const {
  const double least = data_.criteria.claim_share_explained;
  if (!data_.noise_is_known || current_.held_out.chi2 < 1.0 + least) return false;
  const Detection found = detection();
  return std::any_of(found.limits.begin(), found.limits.end(), [&](const DetectionLimit& limit) {
    return tier_of(limit.candidate) == Tier::listed && limit.gain > least;
  });
}

bool Search::is_complete() const {
  return !claims_.empty() && current_.held_out.chi2 < data_.criteria.noise_floor_chi2 &&
         !is_implausible() && !listed_effect_remains();
}

void Search::fit_finalists(std::vector<FittedCandidate>& candidates) {
  report("scoring on held-out data", 0.55);
  fit_and_score(data_, current_.held_out, candidates);
  restart_best(data_, *declared_.hypothesis, current_.held_out, candidates);
  for (const FittedCandidate& each : candidates) {
    trials_.push_back(
        {each.candidate.name(), static_cast<int>(claims_.size()), each.held_out.chi2, each.gain_z});
  }
  rank_determined(candidates, data_, current_.held_out, seed());
}

// An explained recording needs no unlisted physics.
bool Search::is_needless(const FittedCandidate& best) const {
  return !claims_.empty() && is_explained(current_) && !is_implausible() &&
         tier_of(best.candidate) != Tier::listed;
}

// True if the best single effect leaves so much that it may only imitate a pair.
bool Search::may_imitate_pair(const FittedCandidate& best) const {
  const double left = (best.held_out.chi2 - 1.0) / (declared_.held_out.chi2 - 1.0);
  return claims_.empty() && !is_explained(best) && left > 1.0 - data_.criteria.single_effect_share;
}

bool Search::add_effect() {
  if (is_complete()) return false;
  std::vector<FittedCandidate> candidates =
      finalists(data_, features_, current_,
                [&](const std::string& step, double done) { report(step, 0.5 * done); });
  if (candidates.empty()) return false;
  fit_finalists(candidates);
  const FittedCandidate& best = candidates.front();
  if (!relation_) relation_ = best.candidate.effect->card().relation;
  if (claims_.empty() && tier_of(best.candidate) != Tier::listed && add_listed_pair(candidates)) {
    return true;
  }
  if (!is_needless(best) && is_gain(current_.held_out, best.held_out)) {
    if (may_imitate_pair(best) &&
        add_pair(candidates, Limits{best.total_loss(), data_.explained_chi2()})) {
      return true;
    }
    const FittedCandidate winner = best;
    claim(winner, std::move(candidates));
    return true;
  }
  if (is_explained(current_) || !claims_.empty()) return false;
  return add_pair(candidates, std::nullopt);
}

// Tries two listed effects before the best candidate, an unlisted one, is claimed.
bool Search::add_listed_pair(const std::vector<FittedCandidate>& candidates) {
  std::vector<FittedCandidate> listed;
  for (const FittedCandidate& each : candidates) {
    if (tier_of(each.candidate) == Tier::listed) listed.push_back(each);
  }
  if (listed.empty()) return false;
  const Criteria& criteria = data_.criteria;
  const FittedCandidate& unlisted = candidates.front();
  // A formula is as simple as two listed effects; a drawn shape is not.
  const double best = unlisted.total_loss();
  const double gain = current_.total_loss() - best;
  const double enough = tier_of(unlisted.candidate) == Tier::free_form
                            ? current_.total_loss() - criteria.pair_over_shape_share * gain
                            : best;
  // A candidate that leaves only noise is not replaced by a pair that leaves more.
  const bool only_noise =
      data_.noise_is_known && unlisted.held_out.chi2 < criteria.noise_floor_chi2;
  return add_pair(listed, Limits{std::max(enough, best + criteria.claim_nats),
                                 only_noise ? criteria.noise_floor_chi2 : data_.explained_chi2()});
}

// Second effects for one first effect, the best of them fitted on all windows.
std::optional<Search::Pair> Search::pair_with(const std::vector<FittedCandidate>& firsts,
                                              std::size_t first, bool only_listed,
                                              double begin) const {
  const Effort& effort = data_.criteria.effort;
  std::vector<FittedCandidate> candidates =
      screened(firsts[first], begin, begin + 0.1, only_listed);
  if (candidates.empty()) return std::nullopt;
  const std::size_t fitted = std::min(effort.pair_second_effects, candidates.size());
  const std::size_t kept = std::min(effort.listed_finalists, candidates.size());
  const auto at = [&](std::size_t i) {
    return std::make_move_iterator(candidates.begin() + static_cast<std::ptrdiff_t>(i));
  };
  Pair pair;
  pair.first = first;
  pair.seconds.assign(at(0), at(fitted));
  pair.others.assign(at(fitted), at(kept));
  fit_and_score(data_, current_.held_out, pair.seconds);
  restart_best(data_, *declared_.hypothesis, current_.held_out, pair.seconds);
  rank(pair.seconds, data_, current_.held_out, seed());
  pair.best = pair.seconds.front();
  pair.best.candidate = firsts[first].candidate;
  return pair;
}

// The pair with the least loss, unless one that begins with a simpler rival is preferred.
std::size_t Search::preferred_pair(const std::vector<Pair>& pairs,
                                   const std::vector<FittedCandidate>& firsts) const {
  const Criteria& criteria = data_.criteria;
  std::size_t lowest = 0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    if (pairs[i].best.total_loss() < pairs[lowest].best.total_loss()) lowest = i;
  }
  const double gain = current_.total_loss() - pairs[lowest].best.total_loss();
  std::size_t chosen = lowest;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (complexity_of(firsts[pairs[i].first], criteria) <
            complexity_of(firsts[pairs[chosen].first], criteria) &&
        is_preferred_rival(pairs[i].best, pairs[lowest].best, gain, criteria)) {
      chosen = i;
    }
  }
  return chosen;
}

// Gives the second effect as many rivals as a single effect has.
void Search::complete_seconds(Pair& pair) {
  fit_and_score(data_, current_.held_out, pair.others);
  for (FittedCandidate& other : pair.others) pair.seconds.push_back(std::move(other));
  rank(pair.seconds, data_, current_.held_out, seed());
  for (const FittedCandidate& second : pair.seconds) {
    trials_.push_back({pair.best.candidate.name() + " + " + second.candidate.name(),
                       static_cast<int>(claims_.size()) + 1, second.held_out.chi2, second.gain_z});
  }
}

void Search::claim_pair(std::vector<Pair> pairs, std::size_t chosen, const FittedCandidate& first) {
  const double chi2_alone = first.held_out.chi2;
  Claim claimed;
  claimed.candidate = pairs[chosen].best.candidate;
  claimed.chi2_before = current_.held_out.chi2;
  claimed.chi2_after = chi2_alone;
  for (Pair& pair : pairs) claimed.rivals.push_back(std::move(pair.best));
  move_to_front(claimed.rivals, chosen);
  claims_.push_back(std::move(claimed));
  std::vector<FittedCandidate> seconds = std::move(pairs[chosen].seconds);
  const FittedCandidate winner = seconds.front();
  claim(winner, std::move(seconds));
  claims_.back().chi2_before = chi2_alone;
}

// Two effects that each gain little alone may explain much together: friction, for example, and a
// constant force that compensates it in one direction. With `limits`, only a pair that leaves no
// more is claimed, and the second effect is a listed one.
bool Search::add_pair(const std::vector<FittedCandidate>& firsts,
                      const std::optional<Limits>& limits) {
  std::vector<Pair> pairs;
  const std::size_t count = std::min(firsts.size(), data_.criteria.effort.pair_first_effects);
  for (std::size_t i = 0; i < count; ++i) {
    const double begin = 0.6 + 0.4 * static_cast<double>(i) / static_cast<double>(count);
    auto pair = pair_with(firsts, i, limits.has_value(), begin);
    if (pair) pairs.push_back(std::move(*pair));
  }
  if (pairs.empty()) return false;
  const std::size_t chosen = preferred_pair(pairs, firsts);
  complete_seconds(pairs[chosen]);
  const FittedCandidate& winner = pairs[chosen].seconds.front();
  if (!is_gain(current_.held_out, winner.held_out)) return false;
  if (limits && (winner.held_out.chi2 > limits->chi2 || winner.total_loss() > limits->loss)) {
    return false;
  }
  const FittedCandidate& first = firsts[pairs[chosen].first];
  claim_pair(std::move(pairs), chosen, first);
  return true;
}

// The declared model with all claimed effects but one, at their fitted parameters; none where the
// others cannot exist without it.
std::optional<FittedCandidate> Search::without(std::size_t dropped) const {
  FittedCandidate rest;
  rest.candidate = claims_[dropped == 0 ? 1 : 0].candidate;
  rest.hypothesis = declared_.hypothesis;
  const auto values = current_.hypothesis->parameters(current_.fitted.z);
  const auto terms = current_.hypothesis->trial_terms();
  for (std::size_t i = 0; i < claims_.size(); ++i) {
    if (i == dropped) continue;
    const CandidateEffect& kept = claims_[i].candidate;
    if (!physics::can_be_missing(*kept.effect, rest.hypothesis->model(), kept.place)) {
      return std::nullopt;
    }
    rest.hypothesis =
        rest.hypothesis->with(*kept.effect, kept.place, values_of(terms[i], values), {});
  }
  rest.fitted.z.assign(rest.hypothesis->unknowns().size(), 0.0);
  std::size_t to = 0;
  for (std::size_t u = 0; u < current_.fitted.z.size(); ++u) {
    if (current_.hypothesis->unknowns()[u].of_model) rest.fitted.z[to++] = current_.fitted.z[u];
  }
  rest.fitted.state = initial_states(data_.train, *rest.hypothesis);
  return rest;
}

// An effect that was claimed first may have imitated those found after it: one that the others do
// not need is dropped.
bool Search::drop_effect() {
  report("dropping redundant effects", 0.9);
  for (std::size_t i = 0; i < claims_.size(); ++i) {
    std::optional<FittedCandidate> rest = without(i);
    if (!rest) continue;
    fit_and_score(data_, current_.held_out, {&*rest, 1});
    if (is_gain(rest->held_out, current_.held_out)) continue;
    claims_.erase(claims_.begin() + static_cast<std::ptrdiff_t>(i));
    continue_from(*rest);
    claims_.front().chi2_before = declared_.held_out.chi2;
    claims_.back().chi2_after = current_.held_out.chi2;
    return true;
  }
  return false;
}

}  // namespace stickslip::diagnosis
