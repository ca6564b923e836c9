// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "diagnosis/comparison.h"
#include "diagnosis/finalists.h"
#include "diagnosis/findings.h"
#include "diagnosis/screening.h"
#include "diagnosis/selection.h"
#include "diagnosis/significance.h"
#include "physics/catalogue.h"

namespace stickslip::diagnosis {

using physics::Tier;

namespace {

bool is_listed_effect(const CandidateEffect& each) {
  return !each.is_number() && tier_of(each) == Tier::listed;
}

// The hypothesis with an effect more; none where that cannot exist beside what it has.
std::optional<Hypothesis> with_effect(const Hypothesis& base, const CandidateEffect& effect,
                                      const std::vector<double>& parameters) {
  if (!effect.is_number() && !physics::can_be_missing(*effect.effect, base.model(), effect.place)) {
    return std::nullopt;
  }
  return extended(base, effect, parameters, {}, Detail::all);
}

SearchStage stage_of(const FittedCandidate& each) {
  return {*each.hypothesis, each.fitted.z, each.held_out.chi2};
}

}  // namespace

void Search::run(const physics::Model& model) {
  report("calibrating the declared model", 0.0);
  declared_ = calibrate(data_, model);
  if (data_.campaign) estimate_spreads(data_, declared_);
  declared_task_ = data_.train;
  set_current(declared_);
  features_ = features_of(current_);
  extend();
  while (!is_complete() && swap_effect()) extend();
  while (drop_effect(&Search::is_gain)) {
  }
  // Effects that were claimed one by one have to explain the recording together.
  while (!is_explained() && drop_effect(&Search::is_major_gain)) {
  }
  compare_beside_the_others();
  if (data_.campaign && !claims_.empty()) estimate_spreads(data_, current_);
}

// When an effect is claimed, others are still missing, and alternatives stand in for those: what
// each is compared with in the end are the models without it and with an alternative in its place.
void Search::compare_beside_the_others() {
  if (claims_.size() < 2) return;
  for (const Rest& rest : rests()) {
    report("comparing alternatives", 0.95);
    Claim& claim = claims_[rest.dropped];
    const FittedCandidate base = with_instruments_held(rest.fitted).value_or(rest.fitted);
    const auto weight = probabilities(claim.rivals, data_.criteria, seed());
    std::vector<FittedCandidate> rivals;
    for (std::size_t k = 0; k < weight.size(); ++k) {
      if (k > 0 && weight[k] < data_.criteria.least_alternative_probability) continue;
      auto each = paired(base, claim.rivals[k]);
      if (each) rivals.push_back(*std::move(each));
    }
    if (rivals.empty() || rivals.front().candidate != claim.candidate) continue;
    // Without an alternative nothing is compared.
    if (rivals.size() > 1) fit_and_score(data_, base, rivals);
    claim = {claim.candidate, std::move(rivals), stage_of(base), stage_of(current_),
             score_gain(base.held_out, current_.held_out)};
  }
}

void Search::extend() {
  const std::size_t most = data_.criteria.effort.most_effects;
  // An addition may make an earlier one needless; as many steps as lead to `most` twice.
  for (std::size_t step = 0; step < 2 * most && claims_.size() < most && add_effect(); ++step) {
    while (claims_.size() > 2 && drop_effect(&Search::is_gain)) {
    }
  }
}

void Search::report(const std::string& step, double share) const {
  if (!progress_) return;
  // How many effects there are is known at the end only: every step takes half of what is left.
  const double left = std::exp2(-static_cast<double>(claims_.size()));
  progress_(step, 0.05 + 0.85 * (1.0 - left * (1.0 - 0.5 * share)));
}

// Of the residuals in all windows, fitted and held out.
ResidualFeatures Search::features_of(const FittedCandidate& each) const {
  struct Placed {
    WindowRef window;
    const WindowState* state;
  };
  std::vector<Placed> placed;
  const auto place = [&placed](const Task& task, const Fit& fitted) {
    for (std::size_t w = 0; w < task.windows.size(); ++w) {
      placed.push_back({task.windows[w], &fitted.state[w]});
    }
  };
  place(data_.train, each.fitted);
  place(data_.held_out, each.held_out.fitted);
  std::ranges::sort(placed, {}, [](const Placed& one) {
    return std::pair(one.window.experiment, one.window.window);
  });
  Task whole = data_.train;
  whole.windows.clear();
  std::vector<WindowState> states;
  for (const Placed& one : placed) {
    whole.windows.push_back(one.window);
    states.push_back(*one.state);
  }
  FitOptions as_it_is;
  as_it_is.parameters_free = false;
  as_it_is.iterations = 0;
  as_it_is.multistart = false;
  const Fit fitted = fit(whole, *each.hypothesis, each.fitted.z, std::move(states), as_it_is);
  return residual_features(whole, *each.hypothesis, fitted);
}

// The fit with these declared numbers exact.
FittedCandidate Search::holding(const FittedCandidate& each,
                                std::span<const std::size_t> parameters) const {
  FittedCandidate held = each;
  held.hypothesis = each.hypothesis->holding(parameters);
  held.fitted.z = carried_over(*each.hypothesis, each.fitted.z, *held.hypothesis);
  fit_and_score(data_, current_, {&held, 1});
  return held;
}

// The fit with the instruments that it puts beyond what the model allows for held at their declared
// values, where there are any: a zero that is off stands for no force, nor a late channel for a
// mode. Effects are compared on the rest.
std::optional<FittedCandidate> Search::with_instruments_held(const FittedCandidate& each) const {
  std::optional<FittedCandidate> held;
  for (const FittedCandidate* now = &each;; now = &*held) {
    const Hypothesis& hypothesis = *now->hypothesis;
    const std::vector<std::size_t> beyond = instruments_beyond(hypothesis, now->fitted.z);
    if (beyond.empty()) return held;
    held = holding(*now, beyond);
  }
}

void Search::set_current(FittedCandidate next) {
  current_ = std::move(next);
  rests_.clear();
  detection_.reset();
}

// Other noise is another unit of chi-squared: that of earlier stages is found again.
void Search::continue_from(const FittedCandidate& next) {
  const auto sigma = data_.held_out.sigma;
  const auto colour = data_.held_out.colour;
  set_current(next);
  current_.hypothesis = next.hypothesis->with_uncertainties_of(declared_.hypothesis->model());
  current_.fitted.z = carried_over(*next.hypothesis, next.fitted.z, *current_.hypothesis);
  settle(data_, current_);
  if (data_.held_out.sigma == sigma && data_.held_out.colour == colour) return;
  const auto rescore = [this](SearchStage& each) {
    each.chi2 = held_out_score(data_.held_out, each.hypothesis, each.z, data_.noise_is_known).chi2;
  };
  for (Claim& each : claims_) {
    rescore(each.before);
    rescore(each.after);
  }
}

void Search::claim(const FittedCandidate& winner, std::vector<FittedCandidate> rivals) {
  adopt({winner.candidate, std::move(rivals), stage_of(current_), stage_of(winner),
         score_gain(current_.held_out, winner.held_out)},
        winner);
}

// Goes on with the fit that a claim is made for.
void Search::adopt(Claim claim, const FittedCandidate& winner) {
  claims_.push_back(std::move(claim));
  continue_from(winner);
  features_ = features_of(current_);
  claims_.back().after = stage_of(current_);
}

const Detection& Search::detection() {
  if (detection_) return *detection_;
  WindowSubset subset = window_subset(data_, current_);
  subset.task.threads = data_.threads;
  Fit fitted;
  fitted.z = current_.fitted.z;
  fitted.state = subset.state;
  std::vector<CandidateEffect> candidates =
      candidate_effects(current_.hypothesis->model(), data_.experiments, data_.campaign.get());
  std::erase_if(candidates,
                [](const CandidateEffect& each) { return tier_of(each) == Tier::free_form; });
  const auto scales = [&](const physics::Place& place) {
    return scales_of(data_.experiments, *current_.hypothesis, current_.fitted.z, features_, place);
  };
  // Whatever takes less than the formulas of claimed effects may leave is not claimed.
  Criteria criteria = data_.criteria;
  criteria.detection_chi2 = std::max(criteria.detection_chi2, least_gain());
  detection_ =
      detection_limits(subset.task, *current_.hypothesis, fitted, candidates, scales, criteria);
  return *detection_;
}

// Decrease of chi-squared per sample that an effect has to exceed beside the claimed ones: what the
// formulas of those may leave.
double Search::least_gain() const {
  double left = 0.0;
  for (const Claim& each : claims_) left += each.taken() * formula_residual(each.candidate);
  return left;
}

// The same for a claimed effect beside the others. These take all that is explained without it, in
// whichever order they were claimed.
double Search::least_gain(const Rest& rest) const {
  double taken = 0.0;
  double left = 0.0;
  for (std::size_t i = 0; i < claims_.size(); ++i) {
    if (i == rest.dropped) continue;
    taken += claims_[i].taken();
    left += claims_[i].taken() * formula_residual(claims_[i].candidate);
  }
  if (taken == 0.0) return 0.0;
  return left / taken * std::max(0.0, claims_.front().before.chi2 - rest.fitted.held_out.chi2);
}

// True if what is left shows a listed effect beyond chance and beyond what formulas may leave.
bool Search::listed_effect_remains() {
  if (!data_.noise_is_known) return false;
  const Detection& found = detection();
  const double least = least_gain();
  return std::any_of(found.limits.begin(), found.limits.end(), [&](const DetectionLimit& limit) {
    return tier_of(limit.candidate) == Tier::listed && limit.gain > least &&
           normal_chance(std::sqrt(limit.gain * found.samples)) < data_.criteria.claim_level();
  });
}

// True if a fit puts a calibrated number of the rig beyond what the model allows for: it may stand
// in for physics that is still missing, as damping does for a drag. Beside unlisted physics numbers
// make up for what its formula leaves.
bool Search::contradicts_rig(const FittedCandidate& each) const {
  const auto is_listed = [](const Claim& claim) {
    return tier_of(claim.candidate) == Tier::listed;
  };
  return std::ranges::all_of(claims_, is_listed) &&
         !contradicted_rig_unknowns(each, data_.criteria).empty();
}

bool Search::is_complete() {
  return !claims_.empty() && current_.held_out.chi2 < data_.criteria.noise_floor_chi2 &&
         !is_implausible() && !contradicts_rig(current_) && !listed_effect_remains();
}

void Search::add_trial(const FittedCandidate& each, std::size_t stage, const HeldOut& before) {
  const CandidateEffect& effect = each.candidate;
  trials_.push_back({effect.name(), std::string(effect.effect->card().id), static_cast<int>(stage),
                     each.gain_z, score_gain(before, each.held_out)});
}

void Search::fit_finalists(std::vector<FittedCandidate>& candidates) {
  report("scoring on held-out data", 0.55);
  fit_and_score(data_, current_, candidates);
  if (!is_near_noise(candidates, data_.criteria)) {
    // The cost of a drawn shape has no local minima of its own.
    restart_best(
        data_, *declared_.hypothesis, current_, candidates,
        [](const FittedCandidate& each) { return tier_of(each.candidate) != Tier::free_form; });
  }
  share_fit(candidates);
  if (data_.campaign) add_differences(candidates);
  for (const FittedCandidate& each : candidates) {
    add_trial(each, claims_.size(), current_.held_out);
  }
  rank_determined(candidates, data_, current_.held_out, seed());
}

// No candidate gains by what the present model, with its parameters and the states of its windows,
// could have found.
void Search::share_fit(std::vector<FittedCandidate>& candidates) {
  const auto best = std::min_element(candidates.begin(), candidates.end(),
                                     [](const FittedCandidate& a, const FittedCandidate& b) {
                                       return a.total_loss() < b.total_loss();
                                     });
  if (best == candidates.end()) return;
  improve_from(*best);
  current_.held_out =
      rescored_from(best->held_out, *best->hypothesis, data_.held_out, *current_.hypothesis,
                    current_.fitted.z, current_.held_out, data_.noise_is_known);
  for (FittedCandidate& each : candidates) each.gain_z = gain_z(current_.held_out, each.held_out);
}

// The listed effects with a size that differs between the recordings: in each, and, where that
// gains, with a condition. What is proportional to a condition needs no more parameters than what
// is common.
void Search::add_differences(std::vector<FittedCandidate>& candidates) const {
  std::vector<const FittedCandidate*> listed;
  for (const FittedCandidate& each : candidates) {
    if (each.candidate.is_comparison() || each.candidate.is_number()) continue;
    if (tier_of(each.candidate) == Tier::listed) listed.push_back(&each);
  }
  std::vector<FittedCandidate> found;
  for (const FittedCandidate* each : listed) {
    const auto more = differing(*each);
    found.insert(found.end(), more.begin(), more.end());
  }
  candidates.insert(candidates.end(), found.begin(), found.end());
}

// An effect with its first parameter in each recording; with a condition, where the former gains.
std::vector<FittedCandidate> Search::differing(const FittedCandidate& each) const {
  const Hypothesis& common = *each.hypothesis;
  const std::vector<OwnParameter> own = own_indices(each);
  if (own.empty() || own.front().index < 0) return {};
  const auto index = static_cast<std::size_t>(own.front().index);
  const std::string& path = common.rig().parameter_paths()[index];
  const auto unknown = common.unknown_of(index);
  std::vector<FittedCandidate> out;
  if (!unknown || common.campaign()->sharing_of(path).sharing != physics::Sharing::common) {
    return out;
  }
  std::vector<physics::SharedNumber> all = differences_of(path, *common.campaign());
  if (common.unknowns()[*unknown].logarithmic) {
    for (std::size_t i = 0, n = all.size(); i < n; ++i) {
      if (all[i].sharing != physics::Sharing::power) continue;
      all.push_back(all[i]);
      all.back().sharing = physics::Sharing::proportional;
    }
  }
  for (const physics::SharedNumber& shared : all) {
    FittedCandidate next = each;
    next.candidate.shared = shared;
    next.hypothesis = common.sharing(shared);
    next.fitted.z = carried_over(common, each.fitted.z, *next.hypothesis);
    fit_and_score(data_, current_, {&next, 1});
    const bool gains = is_gain(each.held_out, next.held_out);
    if (shared.sharing == physics::Sharing::own && !gains) break;
    if (gains) out.push_back(std::move(next));
  }
  return out;
}

// An explained recording needs no unlisted physics.
bool Search::is_needless(const FittedCandidate& best) const {
  return !claims_.empty() && is_explained(current_) && !is_implausible() &&
         tier_of(best.candidate) != Tier::listed;
}

// None once as many searches were made as a diagnosis may cost.
std::vector<FittedCandidate> Search::finalists_beside(const FittedCandidate& base,
                                                      const ResidualFeatures& features,
                                                      const CandidateFilter& wanted) {
  if (!may_search()) return {};
  ++searches_;
  return finalists(
      data_, features, base,
      [&](const std::string& step, double done) { report(step, 0.5 * done); }, wanted);
}

// True if the present model fits better from the parameters of `other`. Without claims it is the
// declared one, unless instruments are held.
bool Search::improve_from(const FittedCandidate& other) {
  FittedCandidate better = current_;
  if (!refit_from(data_, other, better)) return false;
  set_current(std::move(better));
  const auto unknowns = [](const FittedCandidate& each) {
    return each.hypothesis->unknowns().size();
  };
  if (claims_.empty() && unknowns(current_) == unknowns(declared_)) declared_ = current_;
  features_ = features_of(current_);
  return true;
}

bool Search::add_effect() {
  if (!may_search()) return false;
  // Of an explained recording an instrument that is off comes first: it hides and imitates others.
  if (!claims_.empty() && is_explained() && add_contradicted_instrument()) return true;
  if (is_complete()) return false;
  if (add_effect_beside_current()) return true;
  std::optional<FittedCandidate> held = with_instruments_held(current_);
  if (!held) return false;
  if (improve_from(*held)) return add_effect();
  FittedCandidate before = current_;
  set_current(std::move(*held));
  features_ = features_of(current_);
  if (add_effect_beside_current()) return true;
  set_current(std::move(before));
  features_ = features_of(current_);
  return false;
}

// The effects of instruments that the current fit puts beyond what the model allows for.
std::vector<CandidateEffect> Search::contradicted_instruments() const {
  const Hypothesis& hypothesis = *current_.hypothesis;
  const std::vector<std::size_t> beyond = instruments_beyond(hypothesis, current_.fitted.z);
  std::vector<CandidateEffect> out;
  if (beyond.empty()) return out;
  for (CandidateEffect& each : candidate_effects(hypothesis.model(), data_.experiments)) {
    const bool frees_one = std::any_of(beyond.begin(), beyond.end(), [&](std::size_t parameter) {
      const auto instrument =
          physics::instrument_parameter(hypothesis.rig().parameter_paths()[parameter]);
      return instrument && each.frees(*instrument);
    });
    if (frees_one) out.push_back(std::move(each));
  }
  return out;
}

// The present model with what the effect frees of an instrument at its declared value; nothing
// where none of it is calibrated.
std::optional<FittedCandidate> Search::with_held(const CandidateEffect& effect) const {
  const Hypothesis& hypothesis = *current_.hypothesis;
  std::vector<std::size_t> own;
  for (const Unknown& unknown : hypothesis.unknowns()) {
    if (!unknown.of_model) continue;
    const auto instrument =
        physics::instrument_parameter(hypothesis.rig().parameter_paths()[unknown.parameter]);
    if (instrument && effect.frees(*instrument)) own.push_back(unknown.parameter);
  }
  if (own.empty()) return std::nullopt;
  const FittedCandidate held = holding(current_, own);
  return with_instruments_held(held).value_or(held);
}

// Where only instruments beyond what the model allows are left, each is a finding.
bool Search::add_contradicted_instrument() {
  const std::vector<CandidateEffect> own = contradicted_instruments();
  return !own.empty() && add_instrument(own, *with_instruments_held(current_));
}

// An instrument that is off, with what it has absorbed held: its own effect, the same of another
// channel, since gains and delays are relative, or a rival that it stands for, such as a constant
// force for a zero that is off.
bool Search::add_instrument(const std::vector<CandidateEffect>& own, FittedCandidate held) {
  const CandidateFilter wanted = [&own](const CandidateEffect& each) {
    return std::any_of(own.begin(), own.end(), [&each](const CandidateEffect& one) {
      return each.effect == one.effect || are_rivals(each, one);
    });
  };
  const FittedCandidate before = current_;
  set_current(std::move(held));
  features_ = features_of(current_);
  std::vector<FittedCandidate> candidates = finalists_beside(current_, features_, wanted);
  if (!candidates.empty()) {
    fit_finalists(candidates);
    if (is_gain(current_.held_out, candidates.front().held_out)) {
      const FittedCandidate winner = candidates.front();
      claim(winner, std::move(candidates));
      return true;
    }
  }
  set_current(before);
  features_ = features_of(current_);
  return false;
}

bool Search::add_effect_beside_current() {
  std::vector<FittedCandidate> candidates = finalists_beside(current_, features_);
  if (candidates.empty()) return false;
  fit_finalists(candidates);
  add_rivals_of_lower_tier(candidates);
  if (!claims_.empty()) prefer_listed(candidates);
  const FittedCandidate& best = candidates.front();
  if (!relation_) relation_ = best.candidate.relation();
  if (claims_.empty()) {
    unclaimed_ = {current_};
    unclaimed_.insert(unclaimed_.end(), candidates.begin(), candidates.end());
  }
  if (!is_claimable(best)) {
    if (add_contradicted_number(candidates)) return true;
    if (is_explained() && !is_implausible()) return false;
    // Effects that such instruments have absorbed are compared with the instruments held.
    if (!instruments_beyond(*current_.hypothesis, current_.fitted.z).empty()) return false;
    if (is_needless(best)) return false;
    if (!is_gain(current_.held_out, best.held_out)) return add_with_second(candidates);
  }
  if (tier_of(best.candidate) != Tier::listed && add_listed_pair(candidates)) return true;
  const FittedCandidate winner = best;
  auto held = with_held(winner.candidate);
  if (held && add_instrument({winner.candidate}, *std::move(held))) return true;
  claim(winner, std::move(candidates));
  return true;
}

// Before unlisted physics is claimed, the listed effects of its relation have a search of their
// own, before a drawn shape the formulas, too, and the best of them begin anew: a shape has no
// local minima, and takes their place where a first step in chaotic motion has led nowhere.
void Search::add_rivals_of_lower_tier(std::vector<FittedCandidate>& candidates) {
  const FittedCandidate& best = candidates.front();
  const Tier tier = tier_of(best.candidate);
  if (tier == Tier::listed || !is_gain(current_.held_out, best.held_out)) return;
  const auto is_rival = [tier, relation = best.candidate.relation()](const CandidateEffect& each) {
    return !each.is_number() && tier_of(each) < tier && each.relation() == relation;
  };
  const auto is_new_rival = [&](const CandidateEffect& each) {
    return is_rival(each) &&
           std::ranges::find(candidates, each, &FittedCandidate::candidate) == candidates.end();
  };
  std::vector<FittedCandidate> more = finalists(
      data_, features_, current_, [](const std::string&, double) {}, is_new_rival);
  fit_and_score(data_, current_, more);
  for (const FittedCandidate& each : more) {
    add_trial(each, claims_.size(), current_.held_out);
  }
  candidates.insert(candidates.end(), more.begin(), more.end());
  restart_best(data_, *declared_.hypothesis, current_, candidates,
               [&](const FittedCandidate& each) { return is_rival(each.candidate); });
  rank_determined(candidates, data_, current_.held_out, seed());
}

// One candidate beside another, from what both have found by themselves.
std::optional<FittedCandidate> Search::paired(const FittedCandidate& first,
                                              const FittedCandidate& second) const {
  FittedCandidate out = second;
  out.hypothesis = with_effect(*first.hypothesis, second.candidate, own_parameters(second));
  if (!out.hypothesis) return std::nullopt;
  out.fitted.z = carried_over(*first.hypothesis, first.fitted.z, *out.hypothesis);
  out.fitted.state =
      warm_start_states(first.fitted.state, data_.train, *first.hypothesis, *out.hypothesis);
  return out;
}

// Two listed effects in place of the best candidate, which is unlisted, where they score as well:
// dry friction and drag are one shape over the velocity.
bool Search::add_listed_pair(const std::vector<FittedCandidate>& candidates) {
  std::vector<const FittedCandidate*> listed;
  for (const FittedCandidate& each : candidates) {
    if (is_listed_effect(each.candidate)) listed.push_back(&each);
  }
  std::vector<FittedCandidate> pairs;  // candidates of the second effects
  std::vector<const FittedCandidate*> first_of;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    for (std::size_t k = i + 1; k < listed.size(); ++k) {
      auto pair = paired(*listed[i], *listed[k]);
      if (!pair) continue;
      pairs.push_back(*std::move(pair));
      first_of.push_back(listed[i]);
    }
  }
  if (pairs.empty()) return false;
  fit_and_score(data_, current_, pairs);
  const auto score = [this](const FittedCandidate& each) {
    return each.total_loss() + complexity_of(each, data_.criteria);
  };
  const auto best = std::ranges::min_element(pairs, {}, score) - pairs.begin();
  const auto at = static_cast<std::size_t>(best);
  if (score(pairs[at]) > score(candidates.front())) return false;
  std::swap(pairs.front(), pairs[at]);
  std::swap(first_of.front(), first_of[at]);
  // Rivals of one effect are all that were tried beside the other.
  const auto beside = [&](const CandidateEffect& kept) {
    std::vector<FittedCandidate> out;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const bool is_second = pairs[i].candidate == kept;
      if (!is_second && first_of[i]->candidate != kept) continue;
      out.push_back(pairs[i]);
      if (is_second) out.back().candidate = first_of[i]->candidate;
    }
    return out;
  };
  const FittedCandidate first = *first_of.front();
  const FittedCandidate both = pairs.front();
  claim(first, beside(both.candidate));
  claim(both, beside(first.candidate));
  return true;
}

// The best candidate and a second one beside it, where it takes both to gain beyond chance: the
// first of several effects may make worse where the others act, as friction does, for example,
// without the constant force that compensates it in one direction.
bool Search::add_with_second(std::vector<FittedCandidate> firsts) {
  const FittedCandidate first = firsts.front();
  if (!(first.total_loss() < current_.total_loss())) return false;
  const FittedCandidate before = current_;
  claim(first, std::move(firsts));
  std::vector<FittedCandidate> seconds = finalists_beside(current_, features_);
  if (!seconds.empty()) {
    fit_finalists(seconds);
    const FittedCandidate second = seconds.front();
    if (is_gain(before.held_out, second.held_out) && is_gain(current_.held_out, second.held_out)) {
      claim(second, std::move(seconds));
      return true;
    }
  }
  claims_.pop_back();
  set_current(before);
  features_ = features_of(current_);
  return false;
}

// Beside effects that were claimed already, an unlisted one that leaves more than the noise stands
// for listed ones that are still missing.
void Search::prefer_listed(std::vector<FittedCandidate>& candidates) const {
  if (tier_of(candidates.front().candidate) == Tier::listed || is_explained(candidates.front())) {
    return;
  }
  for (std::size_t i = 1; i < candidates.size(); ++i) {
    if (tier_of(candidates[i].candidate) != Tier::listed) continue;
    if (is_gain(current_.held_out, candidates[i].held_out)) {
      move_to_front(candidates, i);
      return;
    }
  }
}

// True if the best candidate is claimed before a contradicted number. Beside effects that were
// claimed already a listed one may take little of what is left; anything else would only absorb it.
bool Search::is_claimable(const FittedCandidate& best) const {
  if (is_needless(best)) return false;
  const bool one_of_several = !claims_.empty() && tier_of(best.candidate) == Tier::listed;
  return one_of_several ? is_gain(current_.held_out, best.held_out)
                        : is_major_gain(current_.held_out, best.held_out);
}

// True for a number that the calibration, or the recording by itself, puts beyond what the model
// allows for, and that gains what such a distance costs.
bool Search::is_contradicted(const FittedCandidate& each) const {
  if (!each.candidate.is_number() || !data_.noise_is_known) return false;
  if (each.candidate.is_comparison()) return false;
  // Beside physics that is still missing, numbers are off because they stand in for it.
  if (!is_explained(each)) return false;
  const double most = data_.criteria.contradicted_sigmas;
  const auto index = static_cast<std::size_t>(own_indices(each).front().index);
  const auto calibrated = current_.hypothesis->unknown_of(index);
  if (!calibrated || !current_.hypothesis->unknowns()[*calibrated].of_model) return false;
  const double freed_z = current_.hypothesis->z_of(*calibrated, own_parameters(each).front());
  const double distance = std::min(std::abs(current_.fitted.z[*calibrated]), std::abs(freed_z));
  return distance > most && current_.total_loss() - each.total_loss() > 0.5 * most * most;
}

// A number that the recording contradicts is claimed, or the effect that ranks before it and leaves
// none contradicted.
bool Search::add_contradicted_number(std::vector<FittedCandidate> candidates) {
  const auto number = std::ranges::find_if(
      candidates, [this](const FittedCandidate& each) { return is_contradicted(each); });
  if (number == candidates.end()) return false;
  const auto cause = std::find_if(candidates.begin(), number, [this](const FittedCandidate& each) {
    return is_listed_effect(each.candidate) && !contradicts_rig(each);
  });
  move_to_front(candidates, static_cast<std::size_t>(cause - candidates.begin()));
  const FittedCandidate winner = candidates.front();
  claim(winner, std::move(candidates));
  return true;
}

// The declared model with all claimed effects but one, at their fitted parameters; none where the
// others cannot exist without it.
std::optional<FittedCandidate> Search::without(std::size_t dropped) const {
  FittedCandidate rest;
  if (claims_.size() > 1) rest.candidate = claims_[dropped == 0 ? 1 : 0].candidate;
  rest.hypothesis = declared_.hypothesis;
  FittedCandidate present = current_;
  for (std::size_t i = 0; i < claims_.size(); ++i) {
    if (i == dropped) continue;
    const CandidateEffect& kept = claims_[i].candidate;
    present.candidate = kept;
    rest.hypothesis = with_effect(*rest.hypothesis, kept, own_parameters(present));
    if (!rest.hypothesis) return std::nullopt;
  }
  // Terms start at their fitted parameters; numbers of the model are carried over.
  rest.fitted.z = carried_over(*current_.hypothesis, current_.fitted.z, *rest.hypothesis);
  for (std::size_t u = 0; u < rest.fitted.z.size(); ++u) {
    const Unknown& unknown = rest.hypothesis->unknowns()[u];
    if (!unknown.of_model && !unknown.freed) rest.fitted.z[u] = 0.0;
  }
  rest.fitted.state = initial_states(data_.train, *rest.hypothesis);
  return rest;
}

// The best candidate in place of a claimed effect, where it does better beside the others.
std::optional<std::pair<FittedCandidate, Claim>> Search::better_in_place_of(const Rest& rest) {
  const FittedCandidate base = with_instruments_held(rest.fitted).value_or(rest.fitted);
  const CandidateEffect& replaced = claims_[rest.dropped].candidate;
  std::vector<FittedCandidate> candidates = finalists_beside(base, features_of(base));
  std::erase_if(candidates, [&](const FittedCandidate& each) {
    return each.candidate == replaced || tier_of(each.candidate) > tier_of(replaced);
  });
  if (candidates.empty()) return std::nullopt;
  fit_and_score(data_, base, candidates);
  std::erase_if(candidates, [this](const FittedCandidate& each) {
    return acts_by_its_states_alone(each, data_.criteria);
  });
  if (candidates.empty()) return std::nullopt;
  rank_determined(candidates, data_, base.held_out, seed());
  const FittedCandidate& best = candidates.front();
  for (const FittedCandidate& each : candidates) {
    add_trial(each, claims_.size() - 1, base.held_out);
  }
  if (!is_gain(current_.held_out, best.held_out)) return std::nullopt;
  // Where the others do as well alone, the claimed effect is dropped, and nothing takes its place.
  if (!is_gain(base.held_out, best.held_out, least_gain(rest))) return std::nullopt;
  FittedCandidate winner = best;
  Claim claim{best.candidate, std::move(candidates), stage_of(base), stage_of(winner),
              score_gain(base.held_out, winner.held_out)};
  return std::pair(std::move(winner), std::move(claim));
}

// Without each of the claims, that which the others need least first.
const std::vector<Search::Rest>& Search::rests() {
  if (!rests_.empty()) return rests_;
  for (std::size_t i = 0; i < claims_.size(); ++i) {
    std::optional<FittedCandidate> rest = without(i);
    if (!rest) continue;
    fit_and_score(data_, current_, {&*rest, 1});
    rests_.push_back({i, std::move(*rest)});
  }
  std::stable_sort(rests_.begin(), rests_.end(), [](const Rest& a, const Rest& b) {
    return a.fitted.total_loss() < b.fitted.total_loss();
  });
  return rests_;
}

// An effect that was claimed when others were still missing may have stood in for them: it is
// replaced by one that gains more beside those found since.
bool Search::swap_effect() {
  if (claims_.size() < 2 || !may_search()) return false;
  for (const Rest& rest : rests()) {
    if (!may_search()) return false;
    std::optional<std::pair<FittedCandidate, Claim>> better = better_in_place_of(rest);
    if (!better) continue;
    claims_.erase(claims_.begin() + static_cast<std::ptrdiff_t>(rest.dropped));
    adopt(std::move(better->second), better->first);
    return true;
  }
  return false;
}

// True if the calibration without an effect costs more than what a contradiction starts from: that
// of a freed number, or of an effect without which a number of the rig is contradicted.
bool Search::is_contradiction(const Claim& claim, const FittedCandidate& without) const {
  const double least = 0.5 * std::pow(data_.criteria.contradicted_sigmas, 2);
  if (claim.candidate.is_number()) {
    return without.held_out.prior_penalty - current_.held_out.prior_penalty > least;
  }
  return without.total_loss() - current_.total_loss() > least && contradicts_rig(without) &&
         !contradicts_rig(current_);
}

// Drops an effect that the others do not need: it was claimed before them and imitated them.
bool Search::drop_effect(IsNeeded is_needed) {
  report("dropping redundant effects", 0.9);
  for (const Rest& each : rests()) {
    const auto is_kept = [&](const FittedCandidate& rest) {
      return (this->*is_needed)(rest.held_out, current_.held_out, least_gain(each)) ||
             is_contradiction(claims_[each.dropped], rest);
    };
    // An effect that is needed beside free instruments is needed all the more where they are held.
    if (is_kept(each.fitted)) continue;
    const FittedCandidate rest = with_instruments_held(each.fitted).value_or(each.fitted);
    if (is_kept(rest)) continue;
    claims_.erase(claims_.begin() + static_cast<std::ptrdiff_t>(each.dropped));
    if (claims_.empty()) {
      set_current(declared_);
      return true;
    }
    continue_from(rest);
    claims_.front().before = stage_of(declared_);
    claims_.back().after = stage_of(current_);
    return true;
  }
  return false;
}

}  // namespace stickslip::diagnosis
