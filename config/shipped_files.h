// SPDX-License-Identifier: Apache-2.0
// The rigs, models, fault scripts, calibrations and register maps that are shipped with the
// programs.
#pragma once

#include <filesystem>
#include <string>

namespace stickslip::config {

/// share/stickslip next to the folder of the running program, in an installation and in a build
/// folder alike; empty if there is none.
std::filesystem::path shipped_folder();

/// The file that a person means by `name`: a file of that path; otherwise a shipped one, with or
/// without ".toml" and the folder "config/", in `folder` ("models", "faults", ...; empty: any, rigs
/// first) of `shipped`. `name` itself if there is none.
std::filesystem::path file_meant(const std::string& name, const std::string& folder,
                                 const std::filesystem::path& shipped = shipped_folder());

}  // namespace stickslip::config
