// SPDX-License-Identifier: Apache-2.0
// The file that a result came from, for its provenance.
#pragma once

#include <filesystem>

#include "diagnosis/report/provenance.h"
#include "protocol/sha256.h"
#include "tools/files/read_file.h"

namespace stickslip::commands {

/// Name and SHA-256 of a file, which is read whole.
inline report::Provenance::File checked_file(const std::filesystem::path& path) {
  return {path.filename().string(), protocol::sha256_of(files::content_of(path))};
}

}  // namespace stickslip::commands
