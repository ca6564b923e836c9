// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/open_hypotheses.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "diagnosis/search.h"
#include "diagnosis/selection.h"

namespace stickslip::diagnosis {

namespace {

constexpr std::size_t most_open = 5;
// A parameter that the recordings leave open is varied within its plausible range, not by a normal
// distribution that is no longer that of a linear problem [z].
constexpr double widest_step = 1.0;

// Standard deviation of an unknown after the fit, in z.
double deviation_of(const FittedCandidate& each, std::size_t unknown) {
  const double sigma = each.fitted.standard_deviation(unknown);
  return std::isfinite(sigma) ? std::min(sigma, widest_step) : 0.0;
}

// Covariance of the unknowns, with deviations that are limited as above and the correlations of the
// fit; without those where the fit has none.
Eigen::MatrixXd limited_covariance(const FittedCandidate& each, Eigen::Index size) {
  Eigen::VectorXd deviation(size);
  for (Eigen::Index u = 0; u < size; ++u) {
    deviation(u) = deviation_of(each, static_cast<std::size_t>(u));
  }
  const Eigen::MatrixXd& covariance = each.fitted.covariance;
  if (covariance.rows() != size) return deviation.cwiseAbs2().asDiagonal();
  const Eigen::VectorXd scale =
      deviation.cwiseQuotient(covariance.diagonal().cwiseMax(1.0e-300).cwiseSqrt());
  return scale.asDiagonal() * covariance * scale.asDiagonal();
}

// The fit with its covariance: candidates that do not win have none.
FittedCandidate with_posterior(const SearchData& data, FittedCandidate each) {
  const auto size = static_cast<Eigen::Index>(each.hypothesis->unknowns().size());
  if (each.fitted.covariance.rows() == size) return each;
  each.fitted = fit(data.train, *each.hypothesis, each.fitted.z, each.fitted.state, {});
  return each;
}

// Steps by one standard deviation along the principal axes of the posterior, the widest first.
std::vector<physics::Model> models_of(const FittedCandidate& each, std::size_t axes) {
  const Hypothesis& hypothesis = *each.hypothesis;
  std::vector<physics::Model> out{hypothesis.model_at(each.fitted.z)};
  const auto size = static_cast<Eigen::Index>(hypothesis.unknowns().size());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> posterior(limited_covariance(each, size));
  for (Eigen::Index k = size - 1; k >= 0 && out.size() <= axes; --k) {
    const double deviation = std::sqrt(std::max(0.0, posterior.eigenvalues()(k)));
    if (!(deviation > 0.0)) break;
    std::vector<double> z = each.fitted.z;
    for (Eigen::Index u = 0; u < size; ++u) {
      z[static_cast<std::size_t>(u)] += deviation * posterior.eigenvectors()(u, k);
    }
    out.push_back(hypothesis.model_at(z));
  }
  return out;
}

struct Rivals {
  std::vector<FittedCandidate> candidates;
  std::vector<double> probability;
};

// Those of the claim whose best hypothesis is the least certain, or of the step that claimed
// nothing. The best need not be the claim: a free-form curve may follow the readings better.
Rivals open_question(const Search& search, std::uint64_t seed) {
  const Criteria& criteria = search.data().criteria;
  if (search.claims().empty()) {
    Rivals out{search.unclaimed(), {}};
    if (out.candidates.empty()) out.candidates.push_back(search.declared());
    out.probability = probabilities(out.candidates, criteria, seed);
    return out;
  }
  Rivals out;
  double least = 1.0;
  for (std::size_t i = 0; i < search.claims().size(); ++i) {
    const std::vector<FittedCandidate>& rivals = search.claims()[i].rivals;
    std::vector<double> probability = probabilities(rivals, criteria, seed + i);
    const double best = *std::max_element(probability.begin(), probability.end());
    if (!out.probability.empty() && best >= least) continue;
    least = best;
    out = {rivals, std::move(probability)};
  }
  return out;
}

OpenHypothesis hypothesis_of(const FittedCandidate& each, double probability) {
  OpenHypothesis out;
  out.probability = probability;
  if (each.candidate.effect == nullptr) {
    out.id = "nothing";
    out.name = "nothing is missing";
    out.statement = "The declared model, calibrated, is complete.";
    return out;
  }
  out.id = each.candidate.is_number() ? each.candidate.parameter : each.candidate.effect->card().id;
  out.name = each.candidate.name();
  out.statement = statement_of(each);
  return out;
}

}  // namespace

std::vector<OpenHypothesis> open_hypotheses_of(const Search& search, std::size_t axes,
                                               std::uint64_t seed) {
  const Rivals open = open_question(search, seed);
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < open.candidates.size(); ++k) {
    const bool probable =
        open.probability[k] >= search.data().criteria.least_alternative_probability;
    if (probable || k == 0) order.push_back(k);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return open.probability[a] > open.probability[b];
  });
  order.resize(std::min(order.size(), most_open));
  double sum = 0.0;
  for (const std::size_t k : order) sum += open.probability[k];
  std::vector<OpenHypothesis> out;
  for (const std::size_t k : order) {
    out.push_back(hypothesis_of(open.candidates[k], open.probability[k] / sum));
    out.back().models = models_of(with_posterior(search.data(), open.candidates[k]), axes);
  }
  return out;
}

}  // namespace stickslip::diagnosis
