// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/bootstrap.h"

#include <algorithm>
#include <mutex>

#include "diagnosis/experiment.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/rerun.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

FalseAlarms false_alarms(const std::vector<protocol::Recording>& recordings,
                         const physics::Model& declared, const Diagnosis& result, std::size_t count,
                         const Options& options) {
  std::vector<Experiment> experiments;
  for (const protocol::Recording& recording : recordings) {
    experiments.push_back(make_experiment(recording, declared));
  }
  std::vector<Diagnosis> diagnoses(count);
  std::mutex progress_mutex;
  std::size_t done = 0;
  parallel::for_each(count, options.threads, [&](std::size_t i) {
    if (options.stop.stop_requested()) throw Interrupted();
    std::vector<protocol::Recording> simulated;
    for (const Experiment& experiment : experiments) {
      const std::uint64_t seed = options.seed + 1 + i * experiments.size() + simulated.size();
      simulated.push_back(rerun(experiment, result.baseline_model, {}, seed));
    }
    Options own;
    own.criteria = options.criteria;
    own.horizon_s = result.horizon_s;
    own.seed = options.seed + i;
    own.stop = options.stop;
    diagnoses[i] = diagnose(simulated, declared, own);
    if (!options.progress) return;
    const std::scoped_lock lock(progress_mutex);
    options.progress("diagnosing recordings of the declared model",
                     static_cast<double>(++done) / static_cast<double>(count));
  });
  FalseAlarms out;
  out.recordings = count;
  for (const Diagnosis& diagnosis : diagnoses) {
    if (diagnosis.verdict != Verdict::consistent) ++out.alarms;
    out.chi2.push_back(diagnosis.baseline.chi2_per_sample);
  }
  std::sort(out.chi2.begin(), out.chi2.end());
  return out;
}

}  // namespace stickslip::diagnosis
