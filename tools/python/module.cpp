// SPDX-License-Identifier: Apache-2.0
#include "tools/python/bindings.h"

PYBIND11_MODULE(_stickslip, module) {
  module.doc() = "The compiled part of the package stickslip.";
  module.attr("__version__") = STICKSLIP_VERSION;
  stickslip::python::bind_errors(module);
  stickslip::python::bind_recording(module);
  stickslip::python::bind_model(module);
  stickslip::python::bind_processing(module);
  stickslip::python::bind_live(module);
}
