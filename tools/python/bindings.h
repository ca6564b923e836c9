// SPDX-License-Identifier: Apache-2.0
// The parts of the Python module, by topic. docs/python.md describes it, stickslip/__init__.pyi its
// types.
#pragma once

#include <pybind11/pybind11.h>

namespace stickslip::python {

namespace py = pybind11;

/// InputError (a ValueError with the problems found) and Failure (a RuntimeError).
void bind_errors(py::module_& module);
void bind_recording(py::module_& module);
void bind_model(py::module_& module);
/// simulate, evaluate, estimate and diagnose.
void bind_processing(py::module_& module);
void bind_live(py::module_& module);

}  // namespace stickslip::python
