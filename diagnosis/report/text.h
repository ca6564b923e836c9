// SPDX-License-Identifier: Apache-2.0
// A diagnosis as text for the terminal.
#pragma once

#include <string>

#include "diagnosis/diagnosis.h"

namespace stickslip::report {

/// Several lines, ending with a line break.
std::string report_text(const diagnosis::Diagnosis& diagnosis);

/// With enough digits to differ from the parameter's neutral value.
std::string limit_text(const diagnosis::DetectionLimit& limit);

/// "Of 20 synthetic recordings ... 1 raised a false alarm ..."
std::string false_alarm_text(const diagnosis::FalseAlarms& alarms);

}  // namespace stickslip::report
