// SPDX-License-Identifier: Apache-2.0
// The recordings of a campaign side by side: each number, its value by every recording, and whether
// they agree.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/html_elements.h"

namespace stickslip::report {

/// Of a diagnosis of a campaign. In text: the findings' numbers, and what the recordings disagree
/// about; the other forms have all.
std::string campaign_text(const diagnosis::Diagnosis& diagnosis);
nlohmann::ordered_json campaign_json(const diagnosis::Diagnosis& diagnosis);
Section campaign_section(const diagnosis::Diagnosis& diagnosis);

}  // namespace stickslip::report
