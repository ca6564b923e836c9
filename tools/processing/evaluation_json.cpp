// SPDX-License-Identifier: Apache-2.0
#include "tools/processing/evaluation_json.h"

#include <nlohmann/json.hpp>

#include "diagnosis/report/json.h"

namespace stickslip::processing {

nlohmann::ordered_json evaluation_json(const diagnosis::Evaluation& evaluation,
                                       const physics::Model& model) {
  nlohmann::ordered_json json;
  json["schema"] = 1;
  if (model.dimensionless) json["dimensionless"] = true;
  json["fit"] = report::score_json(evaluation.score, true);
  json["horizon_s"] = evaluation.horizon_s;
  json["free_run"] = nullptr;
  if (evaluation.free_run) json["free_run"] = report::free_run_json(*evaluation.free_run);
  return json;
}

}  // namespace stickslip::processing
