// SPDX-License-Identifier: Apache-2.0
// A model file that explains itself to the person who edits it.
#pragma once

#include <string>

#include "tools/interview/draft.h"

namespace stickslip::interview {

/// The model as a model file, with the meaning and the unit of each number, how it is measured and
/// its sigma. config::parse_model reads it back to an equal model.
std::string commented_model(const Draft& draft);

}  // namespace stickslip::interview
