// SPDX-License-Identifier: Apache-2.0
// The page's files, compiled into the program.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::scope {

struct PageFile {
  std::string_view path;  ///< in the URL, "/scope.css"; the page itself is "/"
  std::string_view content_type;
  std::span<const std::uint8_t> content;
};

/// All files (see tools/scope/CMakeLists.txt); none in a program built without uPlot.
std::span<const PageFile> page_files();

}  // namespace stickslip::scope
