// SPDX-License-Identifier: Apache-2.0
// A diagnosis as one self-contained, printable page for readers outside the project: it loads
// nothing, runs no script, and states what is needed to reproduce it.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/html_elements.h"
#include "diagnosis/report/provenance.h"
#include "physics/result_units.h"

namespace stickslip::report {

/// HTML that is also well-formed XML; the same diagnosis and provenance give the same bytes.
std::string report_html(const diagnosis::Diagnosis& diagnosis, const Provenance& provenance);

/// A page of that style: what comes first, HTML, the contents and the sections.
std::string html_page(const std::string& title, const std::string& first,
                      const std::vector<Section>& sections);

/// How to get the same numbers again.
Section reproduction_section(const diagnosis::WindowCount& windows, double horizon_s,
                             const physics::ResultUnits& units, const Provenance& provenance);

}  // namespace stickslip::report
