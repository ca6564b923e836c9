// SPDX-License-Identifier: Apache-2.0
// Accuracy of a model's predictions of a recording, without fitting a parameter.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>

#include "diagnosis/score.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

struct EvaluationOptions {
  std::optional<double> horizon_s;  ///< of a prediction; absent: default_horizon_s
  bool free_run = false;
  int threads = 1;
  /// Called with the completed share of the work, 0 to 1, from the working threads; may be empty.
  std::function<void(double share)> progress = {};
  /// Once this is requested, from any thread, the evaluation soon ends with Interrupted.
  std::stop_token stop = {};
};

struct Evaluation {
  Score score;
  double horizon_s = 0.0;
  std::size_t windows = 0;
  std::optional<FreeRun> free_run;
};

/// Uncertain parameters keep their declared values. Throws InputError where the recording does not
/// fit the model or is too short for one window.
Evaluation evaluate(const protocol::Recording& recording, const physics::Model& model,
                    const EvaluationOptions& options = {});

}  // namespace stickslip::diagnosis
