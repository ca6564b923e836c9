// SPDX-License-Identifier: Apache-2.0
// Frames as NumPy arrays of records.
#pragma once

#include <pybind11/numpy.h>

#include <string>
#include <vector>

#include "physics/frame.h"

namespace stickslip::python {

/// The memory of a Frame as a record: time_ns, sequence, the channels by their columns, valid,
/// age_us.
pybind11::dtype frame_dtype();

/// The frames themselves, not a copy: shape (n,), read-only. `owner` keeps them alive.
pybind11::array array_of(const std::vector<Frame>& frames, const pybind11::object& owner);

/// An array that owns the frames.
pybind11::array array_of(std::vector<Frame> frames);

/// A copy of the frames of an array of records. Fields that it lacks are not measured; time_ns is
/// needed. Throws InputError with `name` for other arrays.
std::vector<Frame> frames_of(const pybind11::array& array, const std::string& name);

/// Throws InputError with `name` unless there are frames, with finite values and increasing times.
void check_frames(const std::vector<Frame>& frames, const std::string& name);

}  // namespace stickslip::python
