// SPDX-License-Identifier: Apache-2.0
// The resolution of coarse inputs, whose readings at rest may all be the same.
#pragma once

#include "config/rig.h"
#include "physics/frame.h"

namespace stickslip::commissioning {

/// Step between two readings of a channel [raw]: of a USB-1208FS-Plus, and of an integer register
/// of a Modbus unit. 0: unknown, or finer than the noise, as of LabJack boards and bridges.
double step_of(const config::Rig& rig, Channel channel);

}  // namespace stickslip::commissioning
