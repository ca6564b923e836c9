// SPDX-License-Identifier: Apache-2.0
// The quality of the observer over recordings, as tables in Markdown by world.
#pragma once

#include <string>
#include <vector>

#include "tests/benchmark/observer_quality.h"

namespace stickslip::quality {

/// Errors, coverage and events of recordings without hidden effects. Every recording is counted:
/// those that the observer does not support with the reason.
std::string quality_tables(const std::vector<RecordingQuality>& recordings);

/// Alarms and explanations of the live check for effects that are present from the beginning.
std::string live_check_table(const std::vector<RecordingQuality>& recordings);

/// False alarms of the live check on recordings without hidden effects.
std::string false_alarm_table(const std::vector<RecordingQuality>& recordings);

/// The document with the lines between its marks `<!-- observer_table --kind KIND -->` and
/// `<!-- end -->` replaced by the tables. Throws std::invalid_argument where it has no such marks.
std::string renewed(const std::string& document, const std::string& kind,
                    const std::string& tables);

/// One row per recording, CSV.
std::string rows_of(const std::vector<RecordingQuality>& recordings);

}  // namespace stickslip::quality
