// Pictures as SVG inside a page: lines over an axis, and maps. Colours come from the page's style
// (classes s0 to s3 for series, m0 to m8 for the steps of a map), so that light, dark and paper
// each have their own. Every picture says what it shows to those who cannot see it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stickslip::diagnosis {

struct Series {
  std::string name;  ///< in the legend; empty: not in it
  std::vector<double> x;
  std::vector<double> y;
  int style = 0;  ///< class of the line
};

/// An area between two curves.
struct Band {
  std::string name;
  std::vector<double> x;
  std::vector<double> low;
  std::vector<double> high;
  int style = 0;
};

/// A line across the picture, at a value that means something.
struct Mark {
  double at = 0.0;
  std::string words;
};

struct LinePlot {
  std::string title;
  std::string says;  ///< what a person who cannot see it should know
  std::string x_label;
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  std::vector<Series> series;
  std::vector<Band> bands;
  std::vector<Mark> marks;   ///< at values of x
  std::vector<Mark> levels;  ///< at values of y
  double width = 490.0;
  double height = 250.0;
};

/// Values that are not finite, or not positive on a logarithmic axis, are left out; long series are
/// drawn by the least and the largest value in each pixel, so that no spike is lost. Empty where
/// there is nothing to draw.
std::string line_plot_svg(const LinePlot& plot);

/// A rectangle of a map, in the units of its axes.
struct Cell {
  double x_low = 0.0, x_high = 1.0, y_low = 0.0, y_high = 1.0;
  double value = 0.0;  ///< not finite: left out
};
struct Dot {
  double x = 0.0, y = 0.0;
  double value = 0.0;
};

struct MapPlot {
  std::string title;
  std::string says;
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
/// Cells of one colour are one path, so that a map of hundreds of cells costs a few kilobytes.
std::string map_plot_svg(const MapPlot& plot);

/// A value with its interval.
struct Ranged {
  std::string name;
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};
struct IntervalPlot {
  std::string title;
  std::string says;
  std::string x_label;
  std::vector<Ranged> rows;
  std::vector<Mark> marks;
  double width = 490.0;
};
/// One row for each, over an axis that holds them all and the marks.
std::string interval_plot_svg(const IntervalPlot& plot);

/// Text with the characters that mean something to HTML and XML replaced; control characters, which
/// neither can hold, become spaces.
std::string html_text(const std::string& text);

}  // namespace stickslip::diagnosis
