// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/finalists.h"

#include <algorithm>
#include <utility>

#include "diagnosis/selection.h"

namespace stickslip::diagnosis {

std::vector<FittedCandidate> finalists(
    const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base,
    const std::function<void(const std::string& step, double done)>& progress,
    const CandidateFilter& wanted) {
  const Effort& effort = data.criteria.effort;
  std::vector<FittedCandidate> out;
  std::size_t listed = 0;
  std::size_t unlisted = 0;
  std::size_t numbers = 0;
  std::size_t comparisons = 0;
  for (FittedCandidate& each : screen(data, features, base, wanted, progress)) {
    const bool chosen = each.candidate.is_comparison() ? comparisons++ < effort.number_finalists
                        : each.candidate.is_number()   ? numbers++ < effort.number_finalists
                        : tier_of(each.candidate) == physics::Tier::listed
                            ? listed++ < effort.listed_finalists
                            : unlisted++ < effort.unlisted_finalists;
    if (chosen) out.push_back(std::move(each));
  }
  return out;
}

void rank_determined(std::vector<FittedCandidate>& candidates, const SearchData& data,
                     const HeldOut& current, std::uint64_t seed) {
  const auto determined = [&](const FittedCandidate& each) {
    return is_determined(each, data.criteria);
  };
  if (std::any_of(candidates.begin(), candidates.end(), determined)) {
    std::erase_if(candidates, std::not_fn(determined));
  }
  rank(candidates, data, current, seed);
}

}  // namespace stickslip::diagnosis
