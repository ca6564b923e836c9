// SPDX-License-Identifier: Apache-2.0
// A recording as Python holds it.
#pragma once

#include <memory>
#include <string>

#include "diagnosis/report/provenance.h"
#include "protocol/recording.h"

namespace stickslip::python {

/// Never changed, since arrays in Python lead into its frames.
struct RecordingHolder {
  protocol::Recording recording;
  std::string sha256;  ///< of its file; empty where it was not read from one

  /// Name and digest in a report: of the file, or of the recording as CSV.
  report::Provenance::File provenance() const;
};

using SharedRecording = std::shared_ptr<RecordingHolder>;

/// A recording of these frames. Throws InputError where they are not one.
SharedRecording recording_of(std::vector<Frame> frames, const std::string& source);

}  // namespace stickslip::python
