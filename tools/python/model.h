// SPDX-License-Identifier: Apache-2.0
// A model as Python holds it.
#pragma once

#include <string>

#include "diagnosis/report/provenance.h"
#include "physics/model.h"

namespace stickslip::python {

struct ModelHolder {
  physics::Model model;
  std::string source;  ///< its file, or its name
  std::string sha256;  ///< of its file; empty where it was not read from one, or was changed since

  /// Name and digest in a report: of the file, or of the text of the model.
  report::Provenance::File provenance() const;
};

}  // namespace stickslip::python
