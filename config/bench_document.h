// SPDX-License-Identifier: Apache-2.0
// The bench of real devices in a rig's file.
#pragma once

#include "config/bench.h"
#include "config/document.h"
#include "config/rig.h"

namespace stickslip::config {

/// Reads the register maps that the bench of a valid document names, copies settings that its
/// devices share with the rig, and checks the form of its inputs. Problems are reported in the
/// document.
void complete_bench(Document& document, Rig& rig);

/// Checks the bench's keys against each other and the rest of the rig.
void check_bench(Document& document, const Rig& rig);

/// Reports tables of a bench in the file of a rig with another driver.
void refuse_bench(Document& document);

}  // namespace stickslip::config
