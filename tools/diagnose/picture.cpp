#include "tools/diagnose/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

namespace stickslip::diagnosis {

namespace {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}
std::string pixel(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

std::string numbered(char letter, int count) {
  std::string text(1, letter);
  text += std::to_string(count);
  return text;
}
std::string series_class(int style) { return numbered('s', style); }
std::string map_class(int step) { return numbered('m', step); }

// A step of 1, 2 or 5 times a power of ten that divides a range into about `count` parts.
double round_step(double range, double count) {
  const double raw = range / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double digit : {1.0, 2.0, 5.0}) {
    if (digit * power >= raw) return digit * power;
  }
  return 10.0 * power;
}

// An axis from data to pixels.
struct Axis {
  double low = 0.0, high = 1.0, from = 0.0, to = 1.0;
  bool logarithmic = false;
  double at(double value) const {
    const double share =
        logarithmic ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return from + share * (to - from);
  }
  std::vector<double> ticks(double count) const {
    std::vector<double> list;
    if (logarithmic) {
      const double decades = std::log10(high / low);
      const double step = std::max(1.0, std::ceil(decades / count));
      for (double e = std::ceil(std::log10(low) - 1.0e-9); e <= std::log10(high) + 1.0e-9;
           e += step) {
        list.push_back(std::pow(10.0, e));
      }
      if (list.size() < 2) list = {low, high};
      return list;
    }
    const double step = round_step(high - low, count);
    for (double k = std::ceil(low / step - 1.0e-9); k * step <= high + 1.0e-9 * step; k += 1.0) {
      list.push_back(std::abs(k) < 0.5 ? 0.0 : k * step);
    }
    return list;
  }
};

std::string text_at(double x, double y, const char* anchor, const std::string& words,
                    const char* style = "tick") {
  return std::string("<text class=\"") + style + "\" x=\"" + pixel(x) + "\" y=\"" + pixel(y) +
         "\" text-anchor=\"" + anchor + "\">" + html_text(words) + "</text>\n";
}

std::string line(double x1, double y1, double x2, double y2, const char* style) {
  return std::string("<line class=\"") + style + "\" x1=\"" + pixel(x1) + "\" y1=\"" + pixel(y1) +
         "\" x2=\"" + pixel(x2) + "\" y2=\"" + pixel(y2) + "\"/>\n";
}

std::string opening(double width, double height, const std::string& title) {
  return "<svg viewBox=\"0 0 " + pixel(width) + " " + pixel(height) + "\" width=\"" + pixel(width) +
         "\" role=\"img\" aria-label=\"" + html_text(title) + "\">\n";
}

std::string frame(const Axis& x, const Axis& y, const std::string& x_label,
                  const std::string& y_label, double x_ticks, double y_ticks, double height) {
  std::string out;
  for (const double tick : x.ticks(x_ticks)) {
    out += line(x.at(tick), y.from, x.at(tick), y.to, "grid");
    out += text_at(x.at(tick), y.from + 14.0, "middle", number(tick));
  }
  for (const double tick : y.ticks(y_ticks)) {
    out += line(x.from, y.at(tick), x.to, y.at(tick), "grid");
    out += text_at(x.from - 5.0, y.at(tick) + 4.0, "end", number(tick));
  }
  out += text_at(0.5 * (x.from + x.to), height - 4.0, "middle", x_label, "label");
  const double middle = 0.5 * (y.from + y.to);
  out += "<text class=\"label\" transform=\"translate(11 " + pixel(middle) +
         ") rotate(-90)\" text-anchor=\"middle\">" + html_text(y_label) + "</text>\n";
  return out;
}

// A path through the points; where there are more than two in a pixel, through the least and the
// largest of each.
std::string path_of(const Series& series, const Axis& x, const Axis& y) {
  std::string path;
  bool pen_down = false;
  const auto to = [&](double px, double py) {
    path += pen_down ? 'L' : 'M';
    path += pixel(px);
    path += ' ';
    path += pixel(py);
    pen_down = true;
  };
  const bool dense = static_cast<double>(series.x.size()) > 3.0 * (x.to - x.from);
  bool open = false;
  long column = 0;
  double low = 0.0;
  double high = 0.0;
  const auto flush = [&] {
    if (!open) return;
    to(static_cast<double>(column), y.at(low));
    if (high > low) to(static_cast<double>(column), y.at(high));
    open = false;
  };
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const double value = series.y[i];
    if (!std::isfinite(value) || (y.logarithmic && !(value > 0.0))) {
      flush();
      pen_down = false;
      continue;
    }
    const double inside = std::clamp(value, y.low, y.high);
    if (!dense) {
      to(x.at(series.x[i]), y.at(inside));
      continue;
    }
    const long here = std::lround(x.at(series.x[i]));
    if (open && column != here) flush();
    low = open ? std::min(low, inside) : inside;
    high = open ? std::max(high, inside) : inside;
    open = true;
    column = here;
  }
  flush();
  return path;
}

}  // namespace

std::string html_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string line_plot_svg(const LinePlot& plot) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  double x_low = infinite;
  double x_high = -infinite;
  double y_low = infinite;
  double y_high = -infinite;
  for (const Series& series : plot.series) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      const double value = series.y[i];
      if (!std::isfinite(value) || (plot.log_y && !(value > 0.0))) continue;
      x_low = std::min(x_low, series.x[i]);
      x_high = std::max(x_high, series.x[i]);
      y_low = std::min(y_low, value);
      y_high = std::max(y_high, value);
    }
  }
  if (!(x_high > x_low)) return "";
  if (plot.log_y) {
    y_low = std::pow(10.0, std::floor(std::log10(std::max(y_low, 1.0e-6 * y_high))));
    y_high = std::pow(10.0, std::ceil(std::log10(y_high) + 1.0e-9));
  } else {
    const double room = y_high > y_low ? 0.05 * (y_high - y_low) : std::abs(y_high) + 1.0e-12;
    y_low -= room;
    y_high += room;
  }
  const Axis x{x_low, x_high, 62.0, plot.width - 12.0, false};
  const Axis y{y_low, y_high, plot.height - 34.0, 26.0, plot.log_y};
  std::string out = opening(plot.width, plot.height, plot.title);
  out +=
      frame(x, y, plot.x_label, plot.y_label, plot.width / 90.0, plot.height / 45.0, plot.height);
  for (const double mark : plot.marks) {
    if (mark >= x_low && mark <= x_high) out += line(x.at(mark), y.from, x.at(mark), y.to, "mark");
  }
  for (const Series& series : plot.series) {
    const std::string style = series_class(series.style);
    if (series.dots) {
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        if (!std::isfinite(series.y[i]) || (plot.log_y && !(series.y[i] > 0.0))) continue;
        out += "<circle class=\"dot " + style + "\" r=\"2\" cx=\"" + pixel(x.at(series.x[i])) +
               "\" cy=\"" + pixel(y.at(std::clamp(series.y[i], y.low, y.high))) + "\"/>\n";
      }
    } else {
      out += "<path class=\"line " + style + "\" d=\"" + path_of(series, x, y) + "\"/>\n";
    }
  }
  out += text_at(x.from, 14.0, "start", plot.title, "title");
  // The legend, from the right.
  double right = x.to;
  for (auto series = plot.series.rbegin(); series != plot.series.rend(); ++series) {
    if (series->name.empty()) continue;
    const double width = 6.2 * static_cast<double>(series->name.size()) + 26.0;
    right -= width;
    out += "<line class=\"line " + series_class(series->style) + "\" x1=\"" + pixel(right) +
           "\" x2=\"" + pixel(right + 16.0) + "\" y1=\"10\" y2=\"10\"/>\n";
    out += text_at(right + 20.0, 14.0, "start", series->name);
  }
  return out + "</svg>\n";
}

std::string map_plot_svg(const MapPlot& plot) {
  if (plot.columns == 0 || plot.value.empty()) return "";
  const std::size_t rows = plot.value.size() / plot.columns;
  const Axis x{plot.x_low, plot.x_high, 62.0, plot.width - 50.0, false};
  const Axis y{plot.y_low, plot.y_high, plot.height - 34.0, 26.0, false};
  std::string out = opening(plot.width, plot.height, plot.title);
  // Nine steps from pale to dark, in equal steps of lightness, so that grey paper tells them apart.
  const auto shade = [&](double value) {
    const double share =
        std::log(value / plot.value_low) / std::log(plot.value_high / plot.value_low);
    return std::clamp(static_cast<int>(std::floor(share * 9.0)), 0, 8);
  };
  const double w = (x.to - x.from) / static_cast<double>(plot.columns);
  const double h = (y.from - y.to) / static_cast<double>(rows);
  out += frame(x, y, plot.x_label, plot.y_label, 4.0, 5.0, plot.height);
  for (std::size_t i = 0; i < plot.value.size(); ++i) {
    if (!std::isfinite(plot.value[i])) continue;
    const double left = x.from + w * static_cast<double>(i % plot.columns);
    const double top = y.from - h * static_cast<double>(i / plot.columns + 1);
    out += "<rect class=\"" + map_class(shade(std::max(plot.value[i], plot.value_low))) +
           "\" x=\"" + pixel(left) + "\" y=\"" + pixel(top) + "\" width=\"" + pixel(w + 0.4) +
           "\" height=\"" + pixel(h + 0.4) + "\"/>\n";
  }
  for (int step = 0; step < 9; ++step) {
    const double top = y.from - (y.from - y.to) / 9.0 * (step + 1);
    out += "<rect class=\"" + map_class(step) + "\" x=\"" + pixel(plot.width - 42.0) + "\" y=\"" +
           pixel(top) + "\" width=\"10\" height=\"" + pixel((y.from - y.to) / 9.0 + 0.4) + "\"/>\n";
  }
  out += text_at(plot.width - 30.0, y.from + 2.0, "start", number(plot.value_low));
  out += text_at(plot.width - 30.0, y.to + 8.0, "start", number(plot.value_high));
  out += text_at(x.from, 14.0, "start", plot.title, "title");
  out += text_at(plot.width - 4.0, 14.0, "end", plot.value_label);
  return out + "</svg>\n";
}

}  // namespace stickslip::diagnosis
