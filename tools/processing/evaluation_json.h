// SPDX-License-Identifier: Apache-2.0
// Scores of a model on a recording as JSON (docs/formats.md).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "diagnosis/evaluation.h"
#include "physics/model.h"

namespace stickslip::processing {

/// {"schema": 1, "fit": {...}, "horizon_s": ..., "free_run": null or {...}}
nlohmann::ordered_json evaluation_json(const diagnosis::Evaluation& evaluation,
                                       const physics::Model& model);

}  // namespace stickslip::processing
