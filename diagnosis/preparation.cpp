// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/preparation.h"

#include <algorithm>

#include "diagnosis/channel_faults.h"
#include "diagnosis/outliers.h"
#include "diagnosis/score.h"
#include "physics/campaign.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::diagnosis {

namespace {

std::size_t& count_of(Use use, WindowCount& windows) {
  switch (use) {
    case Use::fit:
      break;
    case Use::select:
      return windows.select;
    case Use::report:
      return windows.report;
  }
  return windows.fit;
}

// Nothing of a recording that is held out is fitted or selects.
void hold_out(Experiment& e, const physics::Run& run) {
  if (!run.held_out) return;
  for (Window& window : e.windows) window.use = Use::report;
}

// Each recording has its own place, and its own noise.
void as_campaign(std::vector<Experiment>& experiments) {
  const auto noisiest = noise_sigma(experiments);
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    Experiment& e = experiments[i];
    e.recording = i;
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (e.noise_std[c] > 0.0) e.noise_ratio[c] = e.noise_std[c] / noisiest[c];
    }
  }
}

}  // namespace

Prepared prepare(const std::vector<protocol::Recording>& recordings, const physics::Model& model,
                 const Options& options) {
  Prepared out;
  std::vector<Experiment>& experiments = out.experiments;
  for (const protocol::Recording& recording : recordings) {
    const physics::Model own =
        options.campaign ? physics::model_of(options.campaign->runs[experiments.size()], model)
                         : model;
    experiments.push_back(make_experiment(recording, own));
    refuse_faulty_channels(Cleaned(recording).recording(), own);
    out.integrity.push_back(integrity_of(recording, own, options.criteria));
  }
  if (options.campaign) as_campaign(experiments);
  out.horizon_s = options.horizon_s.value_or(default_horizon_s(model, experiments.front()));
  for (Experiment& e : experiments) {
    cut_windows(e, model, out.horizon_s);
    if (options.campaign) hold_out(e, options.campaign->runs[e.recording]);
    for (const Window& window : e.windows) ++count_of(window.use, out.windows);
  }
  const WindowCount& windows = out.windows;
  if (std::min(windows.fit, windows.select) < 2 || windows.report == 0) {
    throw InputError(Problem{recordings.front().source, 0, 0,
                             "is too short: it gives " + physics::counted(windows.fit, "window") +
                                 " of " + physics::number_text(out.horizon_s) + " s to fit, " +
                                 std::to_string(windows.select) + " to select a model, and " +
                                 std::to_string(windows.report) +
                                 " to report; 2, 2 and 1 are needed"});
  }
  return out;
}

Task windows_for(const SearchData& data, std::initializer_list<Use> uses) {
  Task out = data.held_out;
  out.windows.clear();
  for (const Use use : uses) {
    const Task each = task_for(data.experiments, use, data.threads);
    out.windows.insert(out.windows.end(), each.windows.begin(), each.windows.end());
  }
  return out;
}

}  // namespace stickslip::diagnosis
