// SPDX-License-Identifier: Apache-2.0
// An acceptance for people: a page, and the delays as lines of a model.
#pragma once

#include <string>

#include "tools/commissioning/record.h"

namespace stickslip::commissioning {

/// HTML without external resources; steps that were not begun are listed as not done.
std::string page_of(const Record& record);

/// The measured delays as [sensors.CHANNEL] tables of a model, with their standard uncertainties;
/// empty if there are none.
std::string delays_toml(const Record& record);

/// One line per step, and what is left to do.
std::string summary_of(const Record& record);

}  // namespace stickslip::commissioning
