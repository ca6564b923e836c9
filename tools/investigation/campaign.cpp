// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/campaign.h"

#include <algorithm>
#include <limits>
#include <memory>

#include "config/model_file.h"
#include "diagnosis/report/headline.h"
#include "protocol/recording.h"

namespace stickslip::investigation {

namespace {

// All of them: in a run of another kind a combination that the last ones have determined well may
// matter more than all that they left open.
constexpr std::size_t posterior_axes = std::numeric_limits<std::size_t>::max();

std::shared_ptr<const physics::Campaign> campaign_of(const Study& study, std::size_t count) {
  if (count < 2) return nullptr;
  auto out = std::make_shared<physics::Campaign>();
  for (std::size_t i = 0; i < count; ++i) {
    physics::Run run;
    run.name = study.steps[i].name;
    run.remarks["drive"] = study.steps[i].question.words;
    out->runs.push_back(run);
  }
  return out;
}

}  // namespace

diagnosis::Diagnosis diagnosed(const Study& study, const std::filesystem::path& folder,
                               std::size_t count, const DiagnosisOptions& wanted) {
  std::vector<protocol::Recording> recordings;
  for (std::size_t i = 0; i < count; ++i) {
    recordings.push_back(protocol::read_recording(recording_file(folder, study.steps[i])));
  }
  diagnosis::Options options;
  options.seed = study.settings.seed;
  options.threads = wanted.threads;
  options.posterior_axes = posterior_axes;
  options.campaign = campaign_of(study, count);
  options.stop = wanted.stop;
  options.progress = wanted.progress;
  return diagnosis::diagnose(recordings, config::load_model(model_file(folder)), options);
}

std::string campaign_text(const Study& study) {
  std::string out =
      "# Recordings of this study: stickslip diagnose --campaign campaign.toml\n"
      "schema = 1\nmodel = \"model.toml\"\n";
  for (const Step& step : study.steps) {
    out += "\n[[recording]]\nname = \"" + step.name + "\"\nfile = \"" + step.name +
           "/recording.csv\"\ndrive = \"" + step.question.words + "\"\n";
  }
  return out;
}

Step answered(Step step, const diagnosis::Diagnosis& result) {
  step.answered = true;
  step.verdict = diagnosis::name_of(result.verdict);
  step.partial = report::answer_of(result) == report::Answer::partial;
  step.chi2 =
      result.augmented ? result.augmented->chi2_per_sample : result.baseline.chi2_per_sample;
  step.least_probability = 1.0;
  step.findings.clear();
  for (const diagnosis::Finding& finding : result.findings) {
    step.findings.push_back(finding.name());
    step.least_probability = std::min(step.least_probability, finding.probability);
  }
  step.standing.clear();
  for (const diagnosis::OpenHypothesis& each : result.open_hypotheses) {
    step.standing.push_back({each.id, each.name, each.statement, each.probability});
  }
  // Alone it has the probability of its finding, not that of a set without the improbable ones.
  if (step.standing.size() == 1) {
    double& alone = step.standing.front().probability;
    alone = std::min(alone, step.least_probability);
  }
  return step;
}

}  // namespace stickslip::investigation
