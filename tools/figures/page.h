// SPDX-License-Identifier: Apache-2.0
// The page of the figures, each with the statements of the paper and the computed numbers.
#pragma once

#include <string>
#include <vector>

namespace stickslip::figures {

/// A statement of the paper and the corresponding computed number.
struct Comparison {
  std::string statement;
  std::string paper;  ///< number or words
  std::string ours;
};

struct Figure {
  int number = 0;
  std::string title;
  std::string parameters;                  ///< of the rig and the drive
  std::vector<std::string> panels = {};    ///< file stems of the panels, "figure-4a"
  std::vector<std::string> captions = {};  ///< one per panel
  std::vector<Comparison> comparisons = {};
};

/// One self-contained HTML file without scripts; the images are in the same folder.
std::string page(const std::vector<Figure>& figures, const std::string& command);

}  // namespace stickslip::figures
