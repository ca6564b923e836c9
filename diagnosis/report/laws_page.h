// SPDX-License-Identifier: Apache-2.0
// A comparison of laws of friction as text, JSON and one self-contained page with figures.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "diagnosis/laws.h"
#include "diagnosis/report/provenance.h"

namespace stickslip::report {

/// The table and what it says, several lines, ending with a line break.
std::string laws_text(const diagnosis::LawComparison& comparison);

/// Numbers are finite; the same comparison and provenance give the same bytes.
nlohmann::ordered_json laws_json(const diagnosis::LawComparison& comparison,
                                 const Provenance& provenance);

std::string laws_html(const diagnosis::LawComparison& comparison, const Provenance& provenance);

}  // namespace stickslip::report
