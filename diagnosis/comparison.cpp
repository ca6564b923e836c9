// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/comparison.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "physics/declared_value.h"

namespace stickslip::diagnosis {

namespace {

constexpr double normal_975 = 1.959964;
// Probability below which recordings do not agree.
constexpr double disagreement_level = 0.05;

using physics::SharedNumber;
using physics::Sharing;

const std::string& path_of(const Hypothesis& hypothesis, std::size_t unknown) {
  return hypothesis.rig().parameter_paths()[hypothesis.unknowns()[unknown].parameter];
}

std::optional<std::size_t> unknown_at(const Hypothesis& hypothesis, const std::string& path) {
  const auto& unknowns = hypothesis.unknowns();
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    if (path_of(hypothesis, u) == path) return u;
  }
  return std::nullopt;
}

// The hypothesis with a number of its own in each recording, without what is declared of it.
Hypothesis with_own(const Hypothesis& hypothesis, const std::string& path) {
  SharedNumber number = hypothesis.campaign()->sharing_of(path);
  if (!physics::has_coefficient(number)) number.condition.clear();
  number.sharing = Sharing::own;
  const std::size_t first = *unknown_at(hypothesis, path);
  const bool declared = hypothesis.unknowns()[first].of_model;
  const Hypothesis shared = hypothesis.sharing(number);
  return declared ? shared.freeing(hypothesis.unknowns()[first].parameter) : shared;
}

double value_in(const Hypothesis& hypothesis, std::vector<double> z, std::size_t unknown,
                double by) {
  z[unknown] += by;
  const Unknown& each = hypothesis.unknowns()[unknown];
  return hypothesis.parameters(z, *each.recording)[each.parameter];
}

bool takes_part(const SearchData& data, std::size_t recording) {
  return std::any_of(data.train.windows.begin(), data.train.windows.end(),
                     [&](const WindowRef& each) { return each.experiment == recording; });
}

// A condition's reference, or that of its unit, for a trend.
Trend trend_of(const FittedCandidate& result, std::size_t first, const SharedNumber& number) {
  const Hypothesis& hypothesis = *result.hypothesis;
  Trend out;
  if (number.sharing == Sharing::proportional) {
    const double reference = hypothesis.campaign()->reference(number.condition);
    const double half = result.fitted.half_width_95(first);
    const double z = result.fitted.z[first];
    out.value = hypothesis.value(first, z) / reference;
    std::tie(out.low, out.high) = std::minmax(hypothesis.value(first, z - half) / reference,
                                              hypothesis.value(first, z + half) / reference);
    return out;
  }
  for (std::size_t u = first; u < hypothesis.unknowns().size(); ++u) {
    const Unknown& each = hypothesis.unknowns()[u];
    if (each.parameter != hypothesis.unknowns()[first].parameter || each.part != Part::slope) {
      continue;
    }
    const double half = each.scale * result.fitted.half_width_95(u);
    out.value = each.scale * result.fitted.z[u];
    out.low = out.value - half;
    out.high = out.value + half;
    out.exponent = each.logarithmic;
  }
  return out;
}

Eigen::MatrixXd design_of(const Hypothesis& hypothesis, const SharedNumber& number,
                          const OwnFit& own) {
  const auto rows = static_cast<Eigen::Index>(own.recording.size());
  Eigen::MatrixXd out = common_design(rows);
  if (number.sharing != Sharing::power && number.sharing != Sharing::linear) return out;
  out.conservativeResize(rows, 2);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const auto& run = hypothesis.campaign()->runs[own.recording[static_cast<std::size_t>(i)]];
    out(i, 1) = hypothesis.campaign()->weight(number, run);
  }
  return out;
}

// A spread of logarithms, or of values, in the unit of the number.
Spread in_unit(Spread spread, const OwnFit& own) {
  if (!own.logarithmic) return spread;
  spread.mean = own.centre * std::exp(spread.mean);
  for (double* each : {&spread.mean_error, &spread.value, &spread.low, &spread.high}) {
    *each *= spread.mean;
  }
  return spread;
}

std::optional<Comparison> comparison_of(const SearchData& data, const FittedCandidate& result,
                                        std::size_t first) {
  const Hypothesis& hypothesis = *result.hypothesis;
  const std::string& path = path_of(hypothesis, first);
  const auto own = own_fit(data, result, path);
  if (!own) return std::nullopt;
  Comparison out;
  out.number = hypothesis.campaign()->sharing_of(path);
  out.unit = physics::unit_of(path, hypothesis.model());
  out.own = own->value;
  const Heterogeneity found =
      heterogeneity_of(own->estimates, design_of(hypothesis, out.number, *own), disagreement_level);
  out.q = found.q;
  out.freedom = found.freedom;
  out.p = found.p;
  for (const std::size_t each : found.disagreeing) out.own[each].disagrees = true;
  out.value = hypothesis.parameters(result.fitted.z)[hypothesis.unknowns()[first].parameter];
  const double half = result.fitted.half_width_95(first);
  const double z = result.fitted.z[first];
  std::tie(out.low, out.high) =
      std::minmax(hypothesis.value(first, z - half), hypothesis.value(first, z + half));
  if (out.number.sharing == Sharing::own) {
    // Each recording's own: the plain mean. One weighted by correlated errors may lie outside.
    const double mean = own->estimates.value.mean();
    const double error = normal_975 * std::sqrt(own->estimates.covariance.mean());
    const auto back = [&](double value) {
      return own->logarithmic ? own->centre * std::exp(value) : value;
    };
    out.value = back(mean);
    out.low = back(mean - error);
    out.high = back(mean + error);
  }
  if (physics::follows(out.number.sharing)) out.trend = trend_of(result, first, out.number);
  if (out.number.sharing == Sharing::varies) {
    out.spread = in_unit(spread_of(own->estimates), *own);
    out.value = out.spread->mean;
    out.low = out.value - normal_975 * out.spread->mean_error;
    out.high = out.value + normal_975 * out.spread->mean_error;
  }
  return out;
}

// Holm's step-down procedure: what is tenable among all comparisons together.
void judge(std::vector<Comparison>& all) {
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return all[a].p < all[b].p; });
  bool tenable = false;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const double left = static_cast<double>(order.size() - i);
    Comparison& each = all[order[i]];
    tenable = tenable || each.p * left >= disagreement_level;
    each.tenable = tenable;
    if (!tenable) continue;
    for (OwnValue& value : each.own) value.disagrees = false;
  }
}

}  // namespace

std::optional<OwnFit> own_fit(const SearchData& data, const FittedCandidate& result,
                              const std::string& path) {
  const Hypothesis own = with_own(*result.hypothesis, path);
  FitOptions options;
  options.iterations = 8;
  options.tolerance = 1.0e-4;
  options.multistart = false;
  const Fit fitted = fit(data.train, own, carried_over(*result.hypothesis, result.fitted.z, own),
                         result.fitted.state, options);
  OwnFit out;
  std::vector<std::size_t> level;
  for (std::size_t u = 0; u < own.unknowns().size(); ++u) {
    const Unknown& each = own.unknowns()[u];
    if (path_of(own, u) != path || !takes_part(data, *each.recording)) continue;
    level.push_back(u);
    out.recording.push_back(*each.recording);
    out.logarithmic = each.logarithmic;
    out.centre = each.centre;
  }
  const auto size = static_cast<Eigen::Index>(level.size());
  if (size < 2) return std::nullopt;
  out.estimates.value.resize(size);
  out.estimates.covariance.resize(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const std::size_t u = level[static_cast<std::size_t>(i)];
    const Unknown& each = own.unknowns()[u];
    const double half = fitted.half_width_95(u);
    out.estimates.value[i] =
        each.logarithmic ? each.scale * fitted.z[u] : each.centre + each.scale * fitted.z[u];
    OwnValue value{*each.recording, value_in(own, fitted.z, u, 0.0)};
    std::tie(value.low, value.high) =
        std::minmax(value_in(own, fitted.z, u, -half), value_in(own, fitted.z, u, half));
    out.value.push_back(value);
    for (Eigen::Index k = 0; k < size; ++k) {
      const std::size_t v = level[static_cast<std::size_t>(k)];
      const auto a = static_cast<Eigen::Index>(u);
      const auto b = static_cast<Eigen::Index>(v);
      // Correlations are of the curvature, standard deviations those of the intervals.
      const double correlation =
          fitted.covariance(a, b) / std::sqrt(fitted.covariance(a, a) * fitted.covariance(b, b));
      out.estimates.covariance(i, k) = correlation * each.scale * each.scale * half *
                                       fitted.half_width_95(v) / (normal_975 * normal_975);
    }
  }
  return out;
}

void estimate_spreads(SearchData& data, FittedCandidate& result) {
  const Hypothesis before = *result.hypothesis;
  bool any = false;
  for (std::size_t u = 0; u < before.unknowns().size(); ++u) {
    if (before.unknown_of(before.unknowns()[u].parameter) != u) continue;
    const std::string& path = path_of(before, u);
    SharedNumber number = before.campaign()->sharing_of(path);
    if (number.sharing != Sharing::varies) continue;
    const auto own = own_fit(data, result, path);
    if (!own) continue;
    const Unknown& level = before.unknowns()[u];
    const Spread spread = spread_of(own->estimates);
    const double by_z =
        own->logarithmic && !level.logarithmic ? own->centre / level.scale : 1.0 / level.scale;
    // A spread of 0 would be no prior at all.
    const double least = 1.0e-2 * std::sqrt(own->estimates.covariance.diagonal().minCoeff());
    number.spread = by_z * std::max(spread.value, least);
    result.hypothesis = result.hypothesis->sharing(number);
    any = true;
  }
  if (!any) return;
  result.fitted.z = carried_over(before, result.fitted.z, *result.hypothesis);
  settle(data, result);
}

std::vector<Comparison> comparisons_of(const SearchData& data, const FittedCandidate& result) {
  const Hypothesis& hypothesis = *result.hypothesis;
  std::vector<Comparison> out;
  for (std::size_t u = 0; u < hypothesis.unknowns().size(); ++u) {
    const Unknown& each = hypothesis.unknowns()[u];
    if (hypothesis.unknown_of(each.parameter) != u || each.refinement) continue;
    // Zeros that are each recording's own by default are no question.
    const auto instrument = physics::instrument_parameter(path_of(hypothesis, u));
    if (instrument && each.recording && each.of_model) continue;
    if (auto comparison = comparison_of(data, result, u)) out.push_back(std::move(*comparison));
  }
  judge(out);
  return out;
}

}  // namespace stickslip::diagnosis
