// SPDX-License-Identifier: Apache-2.0
// A study of a simulated rig without a person, for examinations.
#pragma once

#include <filesystem>

#include "tools/investigation/investigation.h"

namespace stickslip::rig_access {

struct SealedStudy {
  investigation::Study study;
  /// Largest share of a limit of the drive or of a range of a channel that the readings of any run
  /// reached: 1 is at the limit.
  double used_share = 0.0;
};

/// Makes every run that the study asks for on the rig of `rig_file`, in simulated time, until it
/// ends. A study that `folder` held before is replaced; throws InputError where it holds anything
/// else.
SealedStudy study_of_sealed_rig(const std::filesystem::path& rig_file,
                                const std::filesystem::path& model_file,
                                const std::filesystem::path& folder,
                                const investigation::StudySettings& settings,
                                const investigation::InvestigationOptions& options);

/// The share of one recording.
double used_share(const protocol::Recording& recording, const investigation::RigFacts& facts);

}  // namespace stickslip::rig_access
