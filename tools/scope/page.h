// The page's files, as they stand in the program.
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

/// Every file, put into the program when it was built (tools/scope/CMakeLists.txt).
std::span<const PageFile> page_files();

}  // namespace stickslip::scope
