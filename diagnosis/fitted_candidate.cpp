#include "diagnosis/fitted_candidate.h"

#include <algorithm>
#include <cmath>

namespace stickslip::diagnosis {

double complexity_of(const FittedCandidate& each, const Criteria& criteria) {
  double parameters = 0.0;
  for (const physics::BoundTerm& term : each.hypothesis->rig().terms()) {
    for (const physics::ParameterCard& card : term.effect->card().parameters) {
      if (!card.fixed_default) parameters += 1.0;
    }
  }
  const bool listed = each.candidate.effect == nullptr ||  // the declared model
                      tier_of(each.candidate) == physics::Tier::listed;
  return criteria.state_complexity * each.fitted.states_per_window + parameters +
         (listed ? 0.0 : criteria.unlisted_complexity);
}

const physics::BoundTerm& own_term(const FittedCandidate& each) {
  const auto terms = each.hypothesis->rig().terms();
  return *std::find_if(terms.begin(), terms.end(), [&](const physics::BoundTerm& term) {
    return term.effect == each.candidate.effect && term.place == each.candidate.place;
  });
}

std::vector<double> own_parameters(const FittedCandidate& each) {
  return values_of(own_term(each), each.hypothesis->parameters(each.fitted.z));
}

bool is_determined(const FittedCandidate& each, const Criteria& criteria) {
  const auto& unknowns = each.hypothesis->unknowns();
  const auto size = static_cast<Eigen::Index>(unknowns.size());
  if (each.fitted.covariance.rows() != size) return true;  // the fit was not continued to its end
  const physics::BoundTerm& term = own_term(each);
  const std::size_t count = term.effect->card().parameters.size();
  for (Eigen::Index u = 0; u < size; ++u) {
    const Unknown& unknown = unknowns[static_cast<std::size_t>(u)];
    if (!unknown.logarithmic || unknown.refinement) continue;
    const auto own = term.parameter.begin();
    if (std::find(own, own + static_cast<std::ptrdiff_t>(count),
                  static_cast<int>(unknown.parameter)) ==
        own + static_cast<std::ptrdiff_t>(count)) {
      continue;
    }
    const double error = std::sqrt(std::max(0.0, each.fitted.covariance(u, u)));
    if (unknown.scale * error > criteria.undetermined_log_std) return false;
  }
  return true;
}

bool replaces_law(const Hypothesis& base, const Hypothesis& with) {
  const auto& a = base.rig().structure();
  const auto& b = with.rig().structure();
  return a.kinetics != b.kinetics || a.resonant != b.resonant || a.friction != b.friction ||
         with.rig().state_count() != base.rig().state_count();
}

}  // namespace stickslip::diagnosis
