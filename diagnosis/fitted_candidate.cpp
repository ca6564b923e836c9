// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/fitted_candidate.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "physics/declared_value.h"
#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

std::size_t index_of_number(const Hypothesis& hypothesis, const std::string& path) {
  const auto& paths = hypothesis.rig().parameter_paths();
  return static_cast<std::size_t>(std::find(paths.begin(), paths.end(), path) - paths.begin());
}

// False for the number of a recording that nothing is fitted to.
bool is_fitted(const Hypothesis& hypothesis, const Unknown& unknown) {
  return !unknown.recording || !hypothesis.campaign()->runs[*unknown.recording].held_out;
}

const physics::BoundTerm& own_term(const FittedCandidate& each) {
  const auto terms = each.hypothesis->rig().terms();
  return *std::find_if(terms.begin(), terms.end(), [&](const physics::BoundTerm& term) {
    return term.effect == each.candidate.effect && term.place == each.candidate.place;
  });
}

// The candidate's own unknowns that are fitted to the recordings, with their positions on its card.
struct OwnUnknown {
  std::size_t position = 0;
  std::size_t unknown = 0;
};

std::vector<OwnUnknown> own_unknowns(const FittedCandidate& each) {
  const auto& unknowns = each.hypothesis->unknowns();
  const std::vector<OwnParameter> own = own_indices(each);
  std::vector<OwnUnknown> out;
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    if (unknowns[u].refinement || !is_fitted(*each.hypothesis, unknowns[u])) continue;
    const auto found =
        std::ranges::find(own, static_cast<int>(unknowns[u].parameter), &OwnParameter::index);
    if (found != own.end()) out.push_back({found->position, u});
  }
  return out;
}

}  // namespace

double complexity_of(const FittedCandidate& each, const Criteria& criteria) {
  double parameters = 0.0;
  for (const physics::BoundTerm& term : each.hypothesis->rig().terms()) {
    for (const physics::ParameterCard& card : term.effect->card().parameters) {
      if (!card.fixed_default) parameters += 1.0;
    }
    // One of several channels: a choice that the readings made, like a number.
    if (term.place.from) parameters += 1.0;
  }
  for (std::size_t u = 0; u < each.hypothesis->unknowns().size(); ++u) {
    const Unknown& unknown = each.hypothesis->unknowns()[u];
    if (!is_fitted(*each.hypothesis, unknown)) continue;
    // A term's own parameters are counted, one for all recordings.
    const bool another_recording = !unknown.of_model && unknown.part == Part::level &&
                                   each.hypothesis->unknown_of(unknown.parameter) != u;
    if (unknown.freed || unknown.part == Part::slope || another_recording) parameters += 1.0;
  }
  const bool listed = each.candidate.effect == nullptr ||  // the declared model
                      tier_of(each.candidate) == physics::Tier::listed;
  const bool contradicts =
      each.candidate.effect != nullptr && each.candidate.frees_what_is_declared();
  return each.fitted.states_per_window + parameters +
         (contradicts ? criteria.contradiction_complexity : 0.0) +
         (listed ? 0.0 : criteria.unlisted_complexity);
}

Hypothesis extended(const Hypothesis& base, const CandidateEffect& candidate,
                    std::span<const double> start, std::span<const double> fixed, Detail detail) {
  const auto joined = [&](const Hypothesis& to) {
    return candidate.is_number()
               ? to.freeing(index_of_number(base, candidate.parameter))
               : to.with(*candidate.effect, candidate.place, start, fixed, detail);
  };
  return joined(candidate.is_comparison() ? base.sharing(candidate.shared) : base);
}

std::vector<OwnParameter> own_indices(const FittedCandidate& each) {
  if (each.candidate.is_number()) {
    return {{0, static_cast<int>(index_of_number(*each.hypothesis, each.candidate.parameter))}};
  }
  const physics::BoundTerm& term = own_term(each);
  std::vector<OwnParameter> out;
  for (std::size_t k = 0; k < term.effect->card().parameters.size(); ++k) {
    out.push_back({k, term.parameter[k]});
  }
  return out;
}

std::vector<double> own_parameters(const FittedCandidate& each) {
  const std::vector<double> values = each.hypothesis->parameters(each.fitted.z);
  if (each.candidate.is_number()) {
    return {values[index_of_number(*each.hypothesis, each.candidate.parameter)]};
  }
  return values_of(own_term(each), values);
}

// "mu is 0.31 in a and 0.24 in b", by recording; empty where it is common.
std::string differences_in_words(const FittedCandidate& each) {
  if (!each.candidate.is_comparison()) return {};
  const Hypothesis& hypothesis = *each.hypothesis;
  const std::string& path = each.candidate.shared.path;
  const std::size_t index = index_of_number(hypothesis, path);
  std::string out;
  for (std::size_t i = 0; i < hypothesis.recordings(); ++i) {
    const physics::Run& run = hypothesis.campaign()->runs[i];
    if (run.held_out) continue;
    out += (out.empty() ? "" : ", ") +
           physics::number_text(hypothesis.parameters(each.fitted.z, i)[index]) + " in " + run.name;
  }
  const std::string name = path.substr(path.rfind('.') + 1);
  return name +
         (physics::follows(each.candidate.shared.sharing)
              ? " changes with " + each.candidate.shared.condition
              : " differs between the recordings") +
         ": " + out + ".";
}

std::string statement_of(const FittedCandidate& each) {
  const std::string differences = differences_in_words(each);
  if (each.candidate.is_number() && !differences.empty()) return differences;
  const std::vector<double> values = own_parameters(each);
  if (!each.candidate.is_number()) {
    const std::string words = each.candidate.effect->statement(values, each.candidate.place);
    return differences.empty() ? words : words + " " + differences;
  }
  const std::size_t index = index_of_number(*each.hypothesis, each.candidate.parameter);
  return physics::contradiction(each.candidate.parameter,
                                each.hypothesis->rig().parameter_values()[index], values.front()) +
         ".";
}

bool is_determined(const FittedCandidate& each, const Criteria& criteria) {
  const auto& unknowns = each.hypothesis->unknowns();
  const auto size = static_cast<Eigen::Index>(unknowns.size());
  if (each.fitted.covariance.rows() != size) return true;  // the fit was not continued to its end
  int of_either_sign = 0;
  int determined = 0;  // of those
  for (const OwnUnknown& one : own_unknowns(each)) {
    const Unknown& unknown = unknowns[one.unknown];
    const auto u = static_cast<Eigen::Index>(one.unknown);
    const double error = unknown.scale * std::sqrt(std::max(0.0, each.fitted.covariance(u, u)));
    if (unknown.logarithmic) {
      if (error > criteria.undetermined_log_std) return false;
    } else if (!each.candidate.is_number()) {
      const physics::ParameterCard& card = each.candidate.effect->card().parameters[one.position];
      ++of_either_sign;
      if (error <= card.high - card.low) ++determined;
    }
  }
  return of_either_sign == 0 || determined > 0;
}

std::vector<std::size_t> contradicted_rig_unknowns(const FittedCandidate& each,
                                                   const Criteria& criteria) {
  const auto& paths = each.hypothesis->rig().parameter_paths();
  std::vector<std::size_t> out;
  for (std::size_t u = 0; u < each.fitted.z.size(); ++u) {
    const Unknown& unknown = each.hypothesis->unknowns()[u];
    const bool is_of_rig =
        unknown.of_model && !physics::instrument_parameter(paths[unknown.parameter]);
    if (is_of_rig && std::abs(each.fitted.z[u]) > criteria.contradicted_sigmas) out.push_back(u);
  }
  return out;
}

bool acts_by_its_states_alone(const FittedCandidate& each, const Criteria& criteria) {
  const auto unknowns = static_cast<Eigen::Index>(each.hypothesis->unknowns().size());
  if (each.fitted.covariance.rows() != unknowns) return false;  // not fitted to its end
  if (each.candidate.is_number() || each.candidate.is_comparison()) return false;
  const physics::Card& card = each.candidate.effect->card();
  if (!card.strength || card.parameters[*card.strength].positive) return false;
  const std::vector<double> values = own_parameters(each);
  std::vector<Eigen::Index> of;
  std::vector<double> sizes;
  for (const OwnUnknown& one : own_unknowns(each)) {
    const Unknown& unknown = each.hypothesis->unknowns()[one.unknown];
    if (unknown.logarithmic) continue;
    of.push_back(static_cast<Eigen::Index>(one.unknown));
    sizes.push_back((values[one.position] - card.parameters[one.position].neutral) / unknown.scale);
  }
  if (of.empty()) return false;
  const Eigen::MatrixXd covariance = each.fitted.covariance(of, of);
  const Eigen::Map<const Eigen::VectorXd> size(sizes.data(), static_cast<Eigen::Index>(of.size()));
  // Gain of these sizes over none, to first order.
  return 0.5 * size.dot(covariance.ldlt().solve(size)) < criteria.claim_nats();
}

bool replaces_law(const Hypothesis& base, const Hypothesis& with) {
  const auto& a = base.rig().structure();
  const auto& b = with.rig().structure();
  return a.kinetics != b.kinetics || a.resonant != b.resonant || a.friction != b.friction ||
         with.rig().state_count() != base.rig().state_count();
}

}  // namespace stickslip::diagnosis
