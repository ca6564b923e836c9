// SPDX-License-Identifier: Apache-2.0
// Comparison of the laws of friction by name on recordings: each is fitted in place of the model's
// own law, and scored where nothing was fitted.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnosis.h"
#include "diagnosis/law_curves.h"

namespace stickslip::diagnosis {

struct FittedLaw {
  std::string id;    ///< as [friction] law names it
  std::string name;  ///< "LuGre law"
  /// Of the law, from the recording alone; empty for "none".
  std::vector<Estimate> parameters;
  std::string statement;
  /// Log predictive density of the windows that select, over that of the first law [nat].
  ScoreGain over_first;
  double probability = 0.0;  ///< relative to the other laws
  bool determined = true;    ///< the recording determines what the law needs
  /// The first law predicts better by Criteria::preference_errors standard errors; false for
  /// itself.
  bool distinguished = false;
  /// Of a law that is not distinguished from the first: the run that would do it.
  std::optional<std::string> separating_run;
  Score held_out;  ///< on windows that had no part in fit or choice
  physics::Model model;
  std::optional<LawCurves> curves;  ///< of the first laws, where Options::evidence is set
};

struct LawComparison {
  std::vector<FittedLaw> laws;  ///< the preferred one first
  std::string conclusion;       ///< which are distinguished, in sentences
  double horizon_s = 0.0;
  WindowCount windows;
  bool noise_is_known = false;  ///< scores are log-likelihoods; otherwise of predictions ahead
  std::vector<Integrity> integrity;
  std::optional<RecordedFriction> recorded;  ///< where the friction force was measured
  bool dimensionless = false;
};

/// Fits every law to the recordings; what `model` declares of its own law only sets where the
/// estimates begin. Throws as diagnose() does. Deterministic for a seed.
LawComparison compare_laws(const std::vector<protocol::Recording>& recordings,
                           const physics::Model& model, const Options& options = {});

}  // namespace stickslip::diagnosis
