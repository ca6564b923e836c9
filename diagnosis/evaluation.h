// How well a model, as it stands, predicts a recording.
#pragma once

#include <functional>
#include <optional>

#include "diagnosis/score.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

struct EvaluationOptions {
  std::optional<double> horizon_s;  ///< of a prediction; absent: what suits the model
  bool free_run = false;
  int threads = 1;
  /// Told the share of the work that is done, 0 to 1, from the threads that do it; may be empty.
  std::function<void(double share)> progress = {};
};

struct Evaluation {
  Score score;
  double horizon_s = 0.0;
  std::size_t windows = 0;
  std::optional<FreeRun> free_run;
};

/// No parameter is fitted: what is uncertain is taken at its value. Throws InputError where the
/// recording does not fit the model or is too short for one window.
Evaluation evaluate(const protocol::Recording& recording, const physics::Model& model,
                    const EvaluationOptions& options = {});

}  // namespace stickslip::diagnosis
