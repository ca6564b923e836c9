// SPDX-License-Identifier: Apache-2.0
// The head of the page: verdict, findings, location, confidence and fit, in one screen.
#pragma once

#include <string>

#include "diagnosis/report/html.h"

namespace stickslip::report {

std::string first_screen(const diagnosis::Diagnosis& diagnosis, const Provenance& provenance);

}  // namespace stickslip::report
