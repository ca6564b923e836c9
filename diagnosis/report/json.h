// SPDX-License-Identifier: Apache-2.0
// A diagnosis and scores of a model as JSON (docs/formats.md, section 5).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/provenance.h"

namespace stickslip::report {

/// Numbers are finite; the same diagnosis and provenance give the same bytes.
nlohmann::ordered_json report_json(const diagnosis::Diagnosis& diagnosis,
                                   const Provenance& provenance);

/// {"version": ..., "seed": ..., "command": ..., "sha256": {...}}
nlohmann::ordered_json provenance_json(const Provenance& provenance);

/// {"chi2_per_sample": ..., "nll_per_sample": ..., "nrmse": {...}} and, on request, "rmse".
nlohmann::ordered_json score_json(const diagnosis::Score& score, bool with_rmse);

/// {"rmse": {"displacement_m": ...}, "nrmse": {"displacement": ...}}
nlohmann::ordered_json free_run_json(const diagnosis::FreeRun& run);

}  // namespace stickslip::report
