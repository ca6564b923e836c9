// SPDX-License-Identifier: Apache-2.0
// The loop of a study: a run is designed, shown, made, recorded and diagnosed with all before it,
// until the study ends.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "diagnosis/diagnosis.h"
#include "tools/investigation/rig.h"
#include "tools/investigation/study.h"

namespace stickslip::investigation {

/// The side of a study that faces a person.
struct Dialogue {
  std::function<void(const std::string& text)> show;
  /// True if the run that was shown may be made.
  std::function<bool()> confirm;
  std::function<void(const std::string& step, double done)> progress;
};

struct InvestigationOptions {
  int threads = 1;
  std::stop_token stop = {};
};

/// A new study in a folder that is new or empty, with the model's text; or the one that the folder
/// holds, taken up again: its settings but the budget stay. Throws InputError where the folder
/// holds something else, or a study of another model or rig.
Study opened(const std::filesystem::path& folder, const std::string& model_text,
             const RigFacts& facts, const StudySettings& settings);

/// Goes on until the study ends. Whatever ends it before (Interrupted, a fault) leaves a folder
/// that can be taken up again.
Study investigate(Study study, const std::filesystem::path& folder, Rig& rig,
                  const Dialogue& dialogue, const InvestigationOptions& options);

/// Diagnoses and designs everything again from the recordings of the folder; the differences from
/// the numbers of study.json, a line each.
std::vector<std::string> differences(const std::filesystem::path& folder, const Dialogue& dialogue,
                                     const InvestigationOptions& options);

}  // namespace stickslip::investigation
