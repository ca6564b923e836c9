// SPDX-License-Identifier: Apache-2.0
// The recordings of a study as a campaign, and their diagnosis.
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>

#include "diagnosis/diagnosis.h"
#include "tools/investigation/study.h"

namespace stickslip::investigation {

struct DiagnosisOptions {
  int threads = 1;
  std::stop_token stop = {};
  std::function<void(const std::string& step, double done)> progress = {};
};

/// One diagnosis over the first `count` recordings, read from the files of the study: of one model,
/// with the zeros of the sensors as each recording's own.
diagnosis::Diagnosis diagnosed(const Study& study, const std::filesystem::path& folder,
                               std::size_t count, const DiagnosisOptions& options);

/// campaign.toml, which `stickslip diagnose --campaign` reads.
std::string campaign_text(const Study& study);

/// The step with what the diagnosis says.
Step answered(Step step, const diagnosis::Diagnosis& result);

}  // namespace stickslip::investigation
