// SPDX-License-Identifier: Apache-2.0
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
  std::filesystem::path out;  ///< existing folder for pictures and recordings
  std::vector<int> numbers;   ///< figures to draw; empty: all, 2 to 10
  int periods = 2000;         ///< drive periods for each exponent and each share of time
  int threads = 1;
  /// Called after each figure with the number finished so far; may be empty. Not called
  /// concurrently.
  std::function<void(int number, std::size_t ready, std::size_t all)> progress;
};

/// Draws the figures and returns their captions and comparisons, in the order of their numbers.
/// Also writes the recordings behind Figures 3 to 8, "figure-4.csv" and so on. Throws InputError if
/// a preset or gnuplot is missing, or a number is not in 2 to 10.
std::vector<Figure> draw_paper_figures(const FigureOptions& options);

}  // namespace stickslip::figures
