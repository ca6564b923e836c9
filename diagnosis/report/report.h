// A diagnosis as JSON by the contract, and as text that a person reads first.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {

/// Section 5 of the contract. Numbers are finite; the same diagnosis gives the same bytes.
nlohmann::ordered_json report_json(const Diagnosis& diagnosis);

/// A readable summary, several lines, ending with a line break.
std::string report_text(const Diagnosis& diagnosis);

/// With as many digits as set it apart from no effect at all.
std::string value_text(const DetectionLimit& limit);

/// "Of 20 recordings ... 0 would have been accused ..."
std::string sentence_of(const FalseAlarms& alarms);

/// {"chi2_per_sample": ..., "nll_per_sample": ..., "nrmse": {...}} and, where wanted, "rmse".
nlohmann::ordered_json score_json(const Score& score, bool with_rmse);

/// {"rmse": {"displacement_m": ...}, "nrmse": {"displacement": ...}}
nlohmann::ordered_json free_run_json(const FreeRun& run);

}  // namespace stickslip::diagnosis
