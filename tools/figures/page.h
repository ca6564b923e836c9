// The page that shows the figures, each beside what the paper says of it and our number for that.
#pragma once

#include <string>
#include <vector>

namespace stickslip::figures {

/// A statement of the paper and the number that stands for it here.
struct Comparison {
  std::string statement;
  std::string paper;  ///< its number or words
  std::string ours;
};

struct Figure {
  int number = 0;
  std::string title;
  std::string parameters;                  ///< of what is shown
  std::vector<std::string> panels = {};    ///< stems of the pictures, "figure-4a"
  std::vector<std::string> captions = {};  ///< one per panel
  std::vector<Comparison> comparisons = {};
};

/// One HTML file, without a script or anything from elsewhere; the pictures lie beside it.
std::string page(const std::vector<Figure>& figures, const std::string& command);

}  // namespace stickslip::figures
