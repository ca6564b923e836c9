// SPDX-License-Identifier: Apache-2.0
// Plots as inline SVG: lines, maps and intervals. Colours are classes of the page's style sheet
// (s0 to s3 for series, m0 to m8 for the shades of a map), so that light, dark and print each have
// their own. Every plot carries a description for readers who cannot see it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stickslip::report {

struct Series {
  std::string name;  ///< for the legend; empty: not listed
  std::vector<double> x;
  std::vector<double> y;
  int style = 0;      ///< class of the line
  bool dots = false;  ///< points, not joined
};

/// A cycle that returns on its own way, drawn once: dashes on dashes would be a line.
Series without_way_back(Series cycle);

/// An area between two curves.
struct Band {
  std::string name;
  std::vector<double> x;
  std::vector<double> low;
  std::vector<double> high;
  int style = 0;
};

/// A reference line across the plot.
struct Mark {
  double at = 0.0;
  std::string label;
};

struct LinePlot {
  std::string title;
  std::string description;
  std::string x_label;
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  bool asinh_y = false;  ///< linear near 0, logarithmic beyond about 2
  std::vector<Series> series;
  std::vector<Band> bands;
  std::vector<Mark> marks;   ///< at values of x
  std::vector<Mark> levels;  ///< at values of y
  double width = 490.0;
  double height = 250.0;
};

/// Values that are not finite, or not positive on a logarithmic axis, are omitted; long series are
/// drawn as the minimum and the maximum of each pixel column, so that no spike is lost. Empty if
/// nothing can be drawn.
std::string line_plot_svg(const LinePlot& plot);

/// A rectangle of a map, in the units of its axes.
struct Cell {
  double x_low = 0.0, x_high = 1.0, y_low = 0.0, y_high = 1.0;
  double value = 0.0;  ///< omitted if not finite
};
struct Dot {
  double x = 0.0, y = 0.0;
  double value = 0.0;
};

struct MapPlot {
  std::string title;
  std::string description;
  std::string x_label;
  std::string y_label;
  std::string value_label;
  double x_low = 0.0, x_high = 1.0, y_low = 0.0, y_high = 1.0;
  std::vector<std::string> rows;              ///< names instead of numbers: row i from i to i + 1
  double value_low = 1.0, value_high = 10.0;  ///< colour scale, logarithmic
  std::vector<Cell> cells;
  std::vector<Dot> dots;
  double width = 490.0;
  double height = 300.0;
};
/// Cells of one shade share one path, so that a map of hundreds of cells takes a few kilobytes.
std::string map_plot_svg(const MapPlot& plot);

struct IntervalRow {
  std::string name;
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};
struct IntervalPlot {
  std::string title;
  std::string description;
  std::string x_label;
  std::vector<IntervalRow> rows;
  std::vector<Mark> marks;
  double width = 490.0;
};
/// One row per value, over an axis that spans all intervals and marks.
std::string interval_plot_svg(const IntervalPlot& plot);

}  // namespace stickslip::report
