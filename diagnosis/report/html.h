// SPDX-License-Identifier: Apache-2.0
// A diagnosis as one self-contained, printable page for readers outside the project: it loads
// nothing, runs no script, and states what is needed to reproduce it.
#pragma once

#include <string>

#include "diagnosis/diagnosis.h"
#include "diagnosis/report/provenance.h"

namespace stickslip::report {

/// HTML that is also well-formed XML; the same diagnosis and provenance give the same bytes.
std::string report_html(const diagnosis::Diagnosis& diagnosis, const Provenance& provenance);

}  // namespace stickslip::report
