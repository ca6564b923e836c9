// SPDX-License-Identifier: Apache-2.0
// The next run of a study.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>

#include "diagnosis/design/best_run.h"
#include "diagnosis/diagnosis.h"
#include "physics/model.h"
#include "tools/investigation/study.h"

namespace stickslip::investigation {

struct QuestionOptions {
  int threads = 1;
  std::stop_token stop = {};
  std::function<void(double done)> progress = {};
};

struct NextRun {
  Question question;
  design::Drive drive;
};

/// The first run: the first usual one, as large as the ranges allow for the declared model and what
/// its standard deviations admit. Nothing where no run stays within the ranges.
std::optional<NextRun> first_run(const Study& study, const physics::Model& model,
                                 const QuestionOptions& options);

/// The run after `steps` of the study, which left the hypotheses of `result`: the best one, or,
/// where one hypothesis is left, the next usual one of another family that was not made. With
/// `usual_runs`, the next usual one.
std::optional<NextRun> next_run(const Study& study, std::size_t steps,
                                const diagnosis::Diagnosis& result, const QuestionOptions& options);

}  // namespace stickslip::investigation
