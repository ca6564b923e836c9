// Figures 2 to 10 of Feeny and Moon, from the presets.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tools/figures/page.h"

namespace stickslip::figures {

struct FigureOptions {
  /// Folder of the rig files beam-1.toml, beam-2.toml, beam-3-paper.toml, beam-3-titanium.toml,
  /// beam-4.toml and motivational.toml, and of models/paper-figure-9.toml and -10.toml.
  std::filesystem::path presets;
  std::filesystem::path out;  ///< folder of the pictures and recordings; it exists
  std::vector<int> numbers;   ///< which figures; empty: all, 2 to 10
  int periods = 2000;         ///< drive periods behind each exponent and each share of time
  int threads = 1;
  /// Told of each figure that is ready, and how many are; may be empty. Not called concurrently.
  std::function<void(int number, std::size_t ready, std::size_t all)> progress;
};

/// Draws them and says what to put beside them, in the order of their numbers. Beside the pictures
/// of Figures 3 to 8 it writes the recordings that they were reduced from, "figure-4.csv" and so
/// on. Throws InputError where a preset or gnuplot is missing, or a number is not of 2 to 10.
std::vector<Figure> draw_paper_figures(const FigureOptions& options);

}  // namespace stickslip::figures
