// SPDX-License-Identifier: Apache-2.0
// Recordings that commands write.
#pragma once

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "physics/failure.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "tools/files/outputs.h"

namespace stickslip::command_line {

/// As protocol::write_recording, or in the format "csv" or "lcm" if it is not empty.
inline void write_recording(const files::Outputs& outputs, const protocol::Recording& recording,
                            const std::string& name, const std::string& format = "",
                            const protocol::ProgressCallback& done = {}) {
  outputs.write(name, [&](const std::filesystem::path& path) {
    if (path == "-" || format.empty()) {
      protocol::write_recording(recording, path, done);
    } else if (format == "lcm") {
      protocol::write_log(recording, path, 10, done);
    } else {
      std::ofstream out(path, std::ios::binary);
      protocol::write_csv(recording, out, done);
      out.close();
      if (!out) throw Failure(name + ": is incomplete; is the disk full?");
    }
  });
}

}  // namespace stickslip::command_line
