// Pictures as SVG inside a page: lines over an axis and maps. Colours come from the page's style
// (classes s0 to s3 for series), so that light, dark and paper each have their own.
#pragma once

#include <string>
#include <vector>

namespace stickslip::diagnosis {

struct Series {
  std::string name;
  std::vector<double> x;
  std::vector<double> y;
  int style = 0;  ///< class of the line
  bool dots = false;
};

struct LinePlot {
  std::string title;
  std::string x_label;
  std::string y_label;
  bool log_y = false;
  std::vector<Series> series;
  std::vector<double> marks;  ///< vertical lines
  double width = 640.0;
  double height = 220.0;
};

/// Values that are not finite, or not positive on a logarithmic axis, are left out; long series are
/// drawn by the least and the largest value in each pixel, so that no spike is lost.
std::string line_plot_svg(const LinePlot& plot);

struct MapPlot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::string value_label;
  std::size_t columns = 0;
  double x_low = 0.0, x_high = 1.0, y_low = 0.0, y_high = 1.0;
  double value_low = 0.1, value_high = 10.0;  ///< colour scale, logarithmic
  std::vector<double> value;                  ///< rows from y_low upwards; NaN: nothing there
  double width = 310.0;
  double height = 270.0;
};
std::string map_plot_svg(const MapPlot& plot);

/// Text with the characters that mean something to HTML replaced.
std::string html_text(const std::string& text);

}  // namespace stickslip::diagnosis
