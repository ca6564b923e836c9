// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/evaluation.h"

#include <atomic>

#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::diagnosis {

namespace {

physics::Model without_uncertainty(physics::Model model) {
  for (const physics::NamedParameter& named : physics::parameters_of(model))
    named.parameter->sigma = 0.0;
  return model;
}

}  // namespace

Evaluation evaluate(const protocol::Recording& recording, const physics::Model& model,
                    const EvaluationOptions& options) {
  const physics::Model stated = without_uncertainty(model);
  std::vector<Experiment> experiments{make_experiment(recording, stated)};
  Experiment& e = experiments.front();
  Evaluation out;
  out.horizon_s = options.horizon_s.value_or(default_horizon_s(stated, e));
  cut_windows(e, stated, out.horizon_s);
  if (e.windows.empty()) {
    throw InputError(Problem{recording.source, 0, 0,
                             "is too short for a prediction window of " +
                                 physics::number_text(out.horizon_s) +
                                 " s; choose a smaller --horizon"});
  }
  out.windows = e.windows.size();
  const Hypothesis hypothesis(stated);
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  task.threads = options.threads;
  task.stop = options.stop;
  for (std::size_t w = 0; w < e.windows.size(); ++w) task.windows.push_back({0, w});
  constexpr double passes = 2.0;  // the states of the windows, and those before predictions ahead
  std::atomic<std::size_t> fitted = 0;
  if (options.progress) {
    task.window_done = [&] {
      options.progress(static_cast<double>(++fitted) / (passes * static_cast<double>(out.windows)));
    };
  }
  out.score = score(task, hypothesis, {});
  task.window_done = {};
  if (options.free_run) out.free_run = free_run(task, hypothesis, {});
  return out;
}

}  // namespace stickslip::diagnosis
