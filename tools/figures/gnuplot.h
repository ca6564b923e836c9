// Pictures by gnuplot: a script with its data is written beside each picture and run once for SVG
// and once for PNG, so that anyone can change the script and draw it again.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stickslip::figures {

/// One set of rows of a plot; an empty row breaks a line.
struct Table {
  std::string name;  ///< "$name" in the commands
  std::vector<std::vector<double>> rows;
};

struct Picture {
  std::string stem;  ///< of the files: stem.gp, stem.svg, stem.png
  int width = 640;
  int height = 480;
  std::vector<Table> tables;
  std::string commands;  ///< everything from `set` to `plot`; the tables stand before it
};

/// Throws InputError where gnuplot is not there, and std::runtime_error with its message where it
/// does not take the script.
void draw(const Picture& picture, const std::filesystem::path& folder);

}  // namespace stickslip::figures
