// SPDX-License-Identifier: Apache-2.0
// Recordings made ready for a diagnosis or a comparison of laws: checked, on a uniform time grid,
// and cut into windows.
#pragma once

#include <initializer_list>
#include <vector>

#include "diagnosis/diagnosis.h"
#include "diagnosis/experiment.h"
#include "diagnosis/fitting.h"

namespace stickslip::diagnosis {

struct Prepared {
  std::vector<Experiment> experiments;
  std::vector<Integrity> integrity;  ///< by recording
  double horizon_s = 0.0;
  WindowCount windows;
};

/// Throws InputError where the recordings do not fit the model or are too short.
Prepared prepare(const std::vector<protocol::Recording>& recordings, const physics::Model& model,
                 const Options& options);

/// All windows of those uses, in units of the noise by which hypotheses were judged.
Task windows_for(const SearchData& data, std::initializer_list<Use> uses);

}  // namespace stickslip::diagnosis
