// SPDX-License-Identifier: Apache-2.0
// Figures drawn by gnuplot, as SVG and PNG. The script with its data is written next to each
// figure, to be edited and run again.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stickslip::figures {

/// Data of a plot; an empty row breaks a line.
struct Table {
  std::string name;  ///< "$name" in the commands
  std::vector<std::vector<double>> rows;
};

struct Picture {
  std::string stem;  ///< of the files: stem.gp, stem.svg, stem.png
  int width = 640;
  int height = 480;
  std::vector<Table> tables;
  std::string commands;  ///< from `set` to `plot`; the tables precede them
};

/// Throws InputError if gnuplot is not installed, and Failure with its message if it
/// rejects the script.
void draw(const Picture& picture, const std::filesystem::path& folder);

}  // namespace stickslip::figures
