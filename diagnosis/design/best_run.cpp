// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/best_run.h"

#include <algorithm>
#include <cmath>
#include <nlopt.hpp>
#include <numbers>

#include "diagnosis/shooting.h"

namespace stickslip::design {

namespace {

// Few stiffnesses and one model while the search lasts, all of them for the run that it chose.
constexpr std::array search_factors = {1.0, 0.8, 1.25};
constexpr std::size_t most_compared = 3;  // hypotheses, in a search
constexpr std::size_t searched_families = 3;

std::vector<double> point_of(const RunPlan& run) {
  return {run.amplitude, run.duration, run.shape[0], run.shape[1], run.shape[2]};
}

RunPlan run_at(Family family, const std::vector<double>& x) {
  const auto inside = [](double value) { return std::clamp(value, 0.0, 1.0); };
  return {family, inside(x[0]), inside(x[1]), {inside(x[2]), inside(x[3]), inside(x[4])}};
}

// 1 far from the runs made before, 0 at one of them.
double novelty(const RunPlan& run, const std::vector<RunPlan>& made) {
  double least = 1.0;
  const std::vector<double> x = point_of(run);
  for (const RunPlan& other : made) {
    if (other.family != run.family) continue;
    const std::vector<double> y = point_of(other);
    double square = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) square += (x[i] - y[i]) * (x[i] - y[i]);
    least = std::min(least, std::sqrt(square) / 0.3);
  }
  return std::clamp(least, 0.3, 1.0);
}

struct Scope {
  std::vector<physics::Model> models;  // that have to stay within the ranges
  std::span<const double> factors;
  std::vector<diagnosis::OpenHypothesis> hypotheses;
};

Scope wide_scope(const DesignRequest& request) {
  Scope out{{}, stiffness_factors, request.hypotheses};
  for (const auto& each : request.hypotheses) {
    const std::size_t some = std::min<std::size_t>(each.models.size(), 3);
    out.models.insert(out.models.end(), each.models.begin(),
                      each.models.begin() + static_cast<std::ptrdiff_t>(some));
  }
  return out;
}

Scope narrow_scope(const DesignRequest& request) {
  Scope out{{request.hypotheses.front().models.front()}, search_factors, request.hypotheses};
  out.hypotheses.resize(std::min(out.hypotheses.size(), most_compared));
  return out;
}

std::optional<DesignedRun> evaluate(const DesignRequest& request, const Scope& scope,
                                    const RunPlan& run) {
  if (request.stop.stop_requested()) throw diagnosis::Interrupted();
  const std::optional<Bounded> bounded =
      within_ranges(scope.models, scope.factors, drive_of(run, request.range), request.motion,
                    used_share, request.threads);
  if (!bounded) return std::nullopt;
  DesignedRun out{run, bounded->drive, peaks_of(bounded->drive), bounded->extent, {},
                  0.0, bounded->factor};
  SeparationSettings settings = request.separation;
  settings.threads = request.threads;
  out.separations = separations(scope.hypotheses, out.drive, settings);
  out.gain = expected_gain(scope.hypotheses, out.separations) * novelty(run, request.made);
  return out;
}

// The search within one family, and what it has found so far.
class Search {
 public:
  explicit Search(const DesignRequest& request)
      : request_(request), scope_(narrow_scope(request)) {}

  double rate_of(const RunPlan& run) {
    ++evaluations_;
    if (request_.progress) {
      request_.progress(static_cast<double>(evaluations_) / request_.evaluations);
    }
    const auto found = evaluate(request_, scope_, run);
    return found ? found->rate(request_.overhead_s) : 0.0;
  }

  // From a run to a better one of its family, by NLopt's subplex search: rates have kinks where a
  // contact begins to stick.
  void improve(RunPlan& run, double& rate, int evaluations) {
    nlopt::opt search(nlopt::LN_SBPLX, run_numbers);
    search.set_lower_bounds(0.0);
    search.set_upper_bounds(1.0);
    search.set_initial_step(0.15);
    search.set_maxeval(evaluations);
    Call call{this, run.family, run, rate};
    search.set_max_objective(&Search::objective, &call);
    std::vector<double> x = point_of(run);
    double value = 0.0;
    try {
      search.optimize(x, value);
    } catch (const nlopt::roundoff_limited&) {  // as good as it gets
    }
    if (call.error) std::rethrow_exception(call.error);
    run = call.best;
    rate = call.rate;
  }

  int evaluations() const { return evaluations_; }

 private:
  struct Call {
    Search* search = nullptr;
    Family family = Family::modulated;
    RunPlan best;
    double rate = 0.0;
    std::exception_ptr error = {};
  };

  // Exceptions do not pass through NLopt's C code.
  static double objective(const std::vector<double>& x, std::vector<double>&, void* data) {
    Call& call = *static_cast<Call*>(data);
    if (call.error) return 0.0;
    try {
      const RunPlan run = run_at(call.family, x);
      const double rate = call.search->rate_of(run);
      if (rate > call.rate) {
        call.best = run;
        call.rate = rate;
      }
      return rate;
    } catch (...) {
      call.error = std::current_exception();
      return 0.0;
    }
  }

  const DesignRequest& request_;
  Scope scope_;
  int evaluations_ = 0;
};

struct Start {
  RunPlan run;
  double rate = 0.0;
};

// The best usual runs, no more than one of each family.
std::vector<Start> best_starts(Search& search) {
  std::vector<Start> all;
  for (const RunPlan& run : usual_runs()) all.push_back({run, search.rate_of(run)});
  std::stable_sort(all.begin(), all.end(),
                   [](const Start& a, const Start& b) { return a.rate > b.rate; });
  std::vector<Start> out;
  for (const Start& each : all) {
    const bool new_family = std::none_of(out.begin(), out.end(), [&](const Start& other) {
      return other.run.family == each.run.family;
    });
    if (new_family && out.size() < searched_families) out.push_back(each);
  }
  return out;
}

}  // namespace

std::optional<DesignedRun> evaluated(const DesignRequest& request, const RunPlan& run) {
  return evaluate(request, wide_scope(request), run);
}

std::optional<DesignedRun> best_run(const DesignRequest& request) {
  Search search(request);
  std::vector<Start> starts = best_starts(search);
  const int left = std::max(0, request.evaluations - search.evaluations());
  for (Start& each : starts) {
    const int share = left / static_cast<int>(starts.size());
    if (share > 0) search.improve(each.run, each.rate, share);
  }
  std::optional<DesignedRun> best;
  for (const Start& each : starts) {
    const auto found = evaluated(request, each.run);
    if (!found) continue;
    if (!best || found->rate(request.overhead_s) > best->rate(request.overhead_s)) best = found;
  }
  if (best) best->evaluations = search.evaluations();
  return best;
}

void set_frequencies(const physics::Model& model, double rate_hz, RunRange& range) {
  const physics::Oscillator& rig = model.oscillator;
  double natural_hz = 2.5;
  const auto of = [&](double stiffness) {
    return std::sqrt(stiffness / rig.mass_kg.value) / (2.0 * std::numbers::pi);
  };
  if (rig.two_well) {
    natural_hz = of(2.0 * rig.two_well->linear_n_m.value);
  } else if (rig.natural_frequency_hz) {
    natural_hz = rig.natural_frequency_hz->value;
  } else if (rig.stiffness_n_m) {
    natural_hz = of(rig.stiffness_n_m->value);
  }
  range.lowest_hz = std::max(0.3, 0.3 * natural_hz);
  range.highest_hz =
      std::max(2.0 * range.lowest_hz, std::min({3.0 * natural_hz, 15.0, 0.05 * rate_hz}));
}

}  // namespace stickslip::design
