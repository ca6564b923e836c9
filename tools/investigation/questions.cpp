// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/questions.h"

#include <algorithm>
#include <random>

#include "physics/number_text.h"

namespace stickslip::investigation {

namespace {

using design::DesignRequest;
using diagnosis::OpenHypothesis;

// The declared model, and models drawn from what it admits.
OpenHypothesis declared_hypothesis(const physics::Model& model, std::uint64_t seed) {
  constexpr std::size_t draws = 3;
  OpenHypothesis out;
  out.id = "nothing";
  out.name = "nothing is missing";
  out.probability = 1.0;
  out.models.push_back(model);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < draws; ++i) {
    physics::Model drawn = model;
    for (const physics::NamedParameter& each : physics::parameters_of(drawn)) {
      each.parameter->value += normal(random) * each.parameter->sigma;
    }
    out.models.push_back(drawn);
  }
  return out;
}

DesignRequest request_for(const Study& study, const std::vector<OpenHypothesis>& hypotheses,
                          const QuestionOptions& options) {
  const StudySettings& settings = study.settings;
  DesignRequest out;
  out.hypotheses = hypotheses;
  out.range.shortest_s = settings.shortest_s;
  out.range.longest_s = settings.longest_s;
  out.range.limits = study.facts.limits;
  design::set_frequencies(hypotheses.front().models.front(), study.facts.rate_hz, out.range);
  out.motion = study.facts.ranges;
  out.separation.rate_hz = study.facts.rate_hz;
  out.overhead_s = settings.overhead_s;
  out.evaluations = settings.evaluations;
  out.threads = options.threads;
  out.stop = options.stop;
  out.progress = options.progress;
  return out;
}

NextRun run_of(const Study& study, const DesignRequest& request,
               const design::DesignedRun& designed) {
  NextRun out;
  out.drive = designed.drive;
  Question& q = out.question;
  q.plan = designed.run;
  q.words = design::words_for(designed.run, request.range, study.facts.force);
  if (designed.factor < 0.995) {
    q.words += ", reduced to " + physics::number_text(100.0 * designed.factor, 3) +
               " % for the ranges of the channels";
  }
  q.duration_s = designed.drive.duration_s();
  q.peaks = designed.peaks;
  q.extent = designed.extent;
  q.factor = designed.factor;
  q.gain = designed.gain;
  q.evaluations = designed.evaluations;
  for (const design::PairSeparation& pair : designed.separations) {
    q.expected.push_back({request.hypotheses[pair.truth].name, request.hypotheses[pair.other].name,
                          pair.expected, pair.error});
  }
  return out;
}

std::vector<design::RunPlan> made(const Study& study, std::size_t steps) {
  std::vector<design::RunPlan> out;
  for (std::size_t i = 0; i < steps; ++i) out.push_back(study.steps[i].question.plan);
  return out;
}

bool was_made(const design::RunPlan& run, const std::vector<design::RunPlan>& made) {
  return std::any_of(made.begin(), made.end(), [&](const design::RunPlan& other) {
    return other.family == run.family && other.amplitude == run.amplitude &&
           other.shape == run.shape;
  });
}

}  // namespace

std::optional<NextRun> first_run(const Study& study, const physics::Model& model,
                                 const QuestionOptions& options) {
  const DesignRequest request =
      request_for(study, {declared_hypothesis(model, study.settings.seed)}, options);
  const auto designed = design::evaluated(request, design::usual_runs().front());
  if (!designed) return std::nullopt;
  return run_of(study, request, *designed);
}

std::optional<NextRun> next_run(const Study& study, std::size_t steps,
                                const diagnosis::Diagnosis& result,
                                const QuestionOptions& options) {
  DesignRequest request = request_for(study, result.open_hypotheses, options);
  for (const auto& [channel, std] : result.noise_std) {
    request.separation.noise_std[index_of(channel)] = std;
  }
  request.separation.horizon_s = result.horizon_s;
  request.made = made(study, steps);
  std::optional<design::DesignedRun> designed;
  const bool usual = study.settings.usual_runs;
  if (request.hypotheses.size() > 1 && !usual) {
    designed = design::best_run(request);
  } else {
    for (const design::RunPlan& run : design::usual_runs()) {
      const bool is_like_last = run.family == request.made.back().family;
      if (was_made(run, request.made) || (is_like_last && !usual)) continue;
      designed = design::evaluated(request, run);
      if (designed) break;
    }
  }
  if (!designed) return std::nullopt;
  return run_of(study, request, *designed);
}

}  // namespace stickslip::investigation
