// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/plot_svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <tuple>
#include <utility>

#include "diagnosis/report/formatting.h"
#include "diagnosis/report/html_elements.h"
#include "physics/number_text.h"

namespace stickslip::report {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double left_margin = 66.0;
constexpr double right_margin = 14.0;
constexpr double character_width = 6.7;  // mean, in the legend
constexpr int shades = 9;

std::string tick_text(double value) { return with_minus(physics::number_text(value, 4)); }
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

// Tick spacing of 1, 2 or 5 times a power of ten, for about `count` intervals.
double round_step(double range, double count) {
  const double raw = range / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double digit : {1.0, 2.0, 5.0}) {
    if (digit * power >= raw) return digit * power;
  }
  return 10.0 * power;
}

// Map from data to pixels.
struct Axis {
  double low = 0.0, high = 1.0, from = 0.0, to = 1.0;
  bool logarithmic = false;
  bool is_asinh = false;
  double at(double value) const {
    const double share =
        logarithmic ? std::log(value / low) / std::log(high / low)
        : is_asinh  ? (std::asinh(value) - std::asinh(low)) / (std::asinh(high) - std::asinh(low))
                    : (value - low) / (high - low);
    return from + share * (to - from);
  }
  std::vector<double> ticks(double count) const {
    std::vector<double> list;
    if (is_asinh) {
      for (double each = std::pow(10.0, std::floor(std::log10(-std::min(low, -1.0)))); each > 5.0;
           each /= 10.0) {
        list.push_back(-each);
      }
      list.insert(list.end(), {-2.0, 0.0, 2.0});
      for (double each = 10.0; each <= high; each *= 10.0) list.push_back(each);
      return list;
    }
    if (logarithmic) {
      const double decades = std::log10(high / low);
      const double step = std::max(1.0, std::ceil(decades / count));
      for (double e = std::ceil(std::log10(low) - 1.0e-9); e <= std::log10(high) + 1.0e-9;
           e += step) {
        list.push_back(std::pow(10.0, e));
      }
      if (list.size() < 2) list = {low, high};
      if (list.size() > 3 || step > 1.0) return list;
      // Few decades: 2 and 5 of each as well.
      std::vector<double> finer;
      for (double e = std::floor(std::log10(low)); e <= std::log10(high); e += 1.0) {
        for (const double digit : {1.0, 2.0, 5.0}) {
          const double tick = digit * std::pow(10.0, e);
          if (tick >= low * (1.0 - 1.0e-9) && tick <= high * (1.0 + 1.0e-9)) finer.push_back(tick);
        }
      }
      return finer;
    }
    const double step = round_step(high - low, count);
    for (double k = std::ceil(low / step - 1.0e-9); k * step <= high + 1.0e-9 * step; k += 1.0) {
      list.push_back(std::abs(k) < 0.5 ? 0.0 : k * step);
    }
    return list;
  }
};

std::string text_at(double x, double y, const char* anchor, const std::string& text,
                    const char* style = "tick") {
  return std::string("<text class=\"") + style + "\" x=\"" + pixel(x) + "\" y=\"" + pixel(y) +
         "\" text-anchor=\"" + anchor + "\">" + escape_html(text) + "</text>\n";
}

std::string line(double x1, double y1, double x2, double y2, const std::string& style) {
  return "<line class=\"" + style + "\" x1=\"" + pixel(x1) + "\" y1=\"" + pixel(y1) + "\" x2=\"" +
         pixel(x2) + "\" y2=\"" + pixel(y2) + "\"/>\n";
}

std::string opening(double width, double height, const std::string& title,
                    const std::string& description) {
  return "<svg viewBox=\"0 0 " + pixel(width) + " " + pixel(height) + "\" width=\"" + pixel(width) +
         "\" height=\"" + pixel(height) + "\" role=\"img\">\n<title>" + escape_html(title) +
         "</title>\n" +
         (description.empty() ? std::string() : "<desc>" + escape_html(description) + "</desc>\n") +
         text_at(4.0, 15.0, "start", title, "title");
}

std::string vertical_label(double middle, const std::string& text) {
  return "<text class=\"label\" transform=\"translate(13 " + pixel(middle) +
         ") rotate(-90)\" text-anchor=\"middle\">" + escape_html(text) + "</text>\n";
}

std::string x_axis(const Axis& x, double top, double bottom, const std::string& label,
                   double ticks) {
  std::string out;
  for (const double tick : x.ticks(ticks)) {
    out += line(x.at(tick), bottom, x.at(tick), top, "grid");
    out += text_at(x.at(tick), bottom + 15.0, "middle", tick_text(tick));
  }
  return out + text_at(0.5 * (x.from + x.to), bottom + 32.0, "middle", label, "label");
}

std::string y_axis(const Axis& y, double left, double right, const std::string& label,
                   double ticks) {
  std::string out;
  for (const double tick : y.ticks(ticks)) {
    out += line(left, y.at(tick), right, y.at(tick), "grid");
    out += text_at(left - 5.0, y.at(tick) + 4.0, "end", tick_text(tick));
  }
  return out + vertical_label(0.5 * (y.from + y.to), label);
}

// Path through the points; a dense series is reduced to the minimum and maximum of each pixel
// column.
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
    if (!std::isfinite(value) || (y.logarithmic && !(value > 0.0)) ||
        (x.logarithmic && !(series.x[i] > 0.0))) {
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

// A stroke of no length at each point, whose round ends are a dot.
std::string dots_of(const Series& series, const Axis& x, const Axis& y) {
  std::string path;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (!std::isfinite(series.x[i]) || !std::isfinite(series.y[i])) continue;
    path.append("M").append(pixel(x.at(series.x[i]))).append(" ");
    path.append(pixel(y.at(std::clamp(series.y[i], y.low, y.high)))).append("h0");
  }
  return path;
}

std::string area_of(const Band& band, const Axis& x, const Axis& y) {
  std::string path;
  const auto to = [&](double at, double value) {
    path += path.empty() ? 'M' : 'L';
    path += pixel(x.at(at));
    path += ' ';
    path += pixel(y.at(std::clamp(value, y.low, y.high)));
  };
  for (std::size_t i = 0; i < band.x.size(); ++i) {
    if (std::isfinite(band.high[i])) to(band.x[i], band.high[i]);
  }
  for (std::size_t i = band.x.size(); i-- > 0;) {
    if (std::isfinite(band.low[i])) to(band.x[i], band.low[i]);
  }
  return path.empty() ? path : path + 'Z';
}

// Range of the data.
struct Extent {
  double x_low = infinite, x_high = -infinite, y_low = infinite, y_high = -infinite;

  void include_y(double value) {
    y_low = std::min(y_low, value);
    y_high = std::max(y_high, value);
  }
  void include(double x, double y, const LinePlot& plot) {
    if (!std::isfinite(x) || !std::isfinite(y)) return;
    if ((plot.log_y && !(y > 0.0)) || (plot.log_x && !(x > 0.0))) return;
    x_low = std::min(x_low, x);
    x_high = std::max(x_high, x);
    include_y(y);
  }
};

Extent extent_of(const LinePlot& plot) {
  Extent out;
  for (const Series& series : plot.series) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      out.include(series.x[i], series.y[i], plot);
    }
  }
  for (const Band& band : plot.bands) {
    for (std::size_t i = 0; i < band.x.size(); ++i) {
      out.include(band.x[i], band.low[i], plot);
      out.include(band.x[i], band.high[i], plot);
    }
  }
  if (!(out.x_high > out.x_low)) return out;
  for (const Mark& level : plot.levels) {
    if (!plot.log_y || level.at > 0.0) out.include_y(level.at);
  }
  if (plot.log_y) {
    out.y_low = std::pow(10.0, std::floor(std::log10(std::max(out.y_low, 1.0e-6 * out.y_high))));
    out.y_high = std::pow(10.0, std::ceil(std::log10(out.y_high) + 1.0e-9));
  } else {
    const double margin =
        out.y_high > out.y_low ? 0.05 * (out.y_high - out.y_low) : std::abs(out.y_high) + 1.0e-12;
    out.y_low -= margin;
    out.y_high += margin;
  }
  return out;
}

// Legend in one row below the title.
std::string legend_of(const LinePlot& plot) {
  std::string out;
  double left = left_margin;
  const auto name = [&](const std::string& text) {
    out += text_at(left + 24.0, 34.0, "start", text);
    left += 40.0 + character_width * static_cast<double>(text.size());
  };
  for (const Series& series : plot.series) {
    if (series.name.empty()) continue;
    out += series.dots ? "<path class=\"points " + series_class(series.style) + "\" d=\"M" +
                             pixel(left + 4.0) + " 30h0m6 0h0m6 0h0\"/>\n"
                       : line(left, 30.0, left + 19.0, 30.0, "line " + series_class(series.style));
    name(series.name);
  }
  for (const Band& band : plot.bands) {
    if (band.name.empty()) continue;
    out += "<rect class=\"area " + series_class(band.style) + "\" x=\"" + pixel(left) +
           "\" y=\"25\" width=\"19\" height=\"10\"/>\n";
    name(band.name);
  }
  return out;
}

std::string marks_of(const LinePlot& plot, const Axis& x, const Axis& y) {
  std::string out;
  int row = 0;
  for (const Mark& mark : plot.marks) {
    if (!(mark.at >= x.low && mark.at <= x.high)) continue;
    out += line(x.at(mark.at), y.from, x.at(mark.at), y.to, "mark");
    if (mark.label.empty()) continue;
    const bool right = x.at(mark.at) > 0.6 * x.to;
    out += text_at(x.at(mark.at) + (right ? -3.0 : 3.0), y.to + 11.0 + 13.0 * (row++ % 3),
                   right ? "end" : "start", mark.label, "note");
  }
  for (const Mark& level : plot.levels) {
    out += line(x.from, y.at(level.at), x.to, y.at(level.at), "level");
    if (level.label.empty()) continue;
    out += text_at(x.to - 3.0, y.at(level.at) - 4.0, "end", level.label, "note");
  }
  return out;
}

// Shades of equal steps in lightness, so that they remain distinct in greyscale print.
int shade_of(double value, const MapPlot& plot) {
  const double share = std::log(std::max(value, plot.value_low) / plot.value_low) /
                       std::log(plot.value_high / plot.value_low);
  return std::clamp(static_cast<int>(std::floor(share * shades)), 0, shades - 1);
}

std::string colour_scale(const MapPlot& plot, const Axis& y) {
  std::string out;
  const double left = plot.width - 58.0;
  const double step = (y.from - y.to) / shades;
  for (int i = 0; i < shades; ++i) {
    out += "<rect class=\"" + map_class(i) + "\" x=\"" + pixel(left) + "\" y=\"" +
           pixel(y.from - step * (i + 1)) + "\" width=\"12\" height=\"" + pixel(step + 0.4) +
           "\"/>\n";
  }
  constexpr double text_height = 12.0;
  for (const int i : {0, 3, 6, 9}) {
    const bool inner = i != 0 && i != shades;
    if (inner && 3 * step < text_height) continue;
    const double value = plot.value_low * std::pow(plot.value_high / plot.value_low,
                                                   i / static_cast<double>(shades));
    char text[32];
    std::snprintf(text, sizeof text, "%.2g", value);
    if (value >= 100.0) std::snprintf(text, sizeof text, "%.0f", value);
    out += text_at(left + 16.0, y.from - step * i + 4.0, "start", with_minus(text));
  }
  return out + text_at(plot.width - 4.0, 34.0, "end", plot.value_label);
}

// One path per shade.
std::string cells_of(const MapPlot& plot, const Axis& x, const Axis& y) {
  std::array<std::string, shades> path;
  for (const Cell& cell : plot.cells) {
    if (!std::isfinite(cell.value)) continue;
    const double left = x.at(cell.x_low);
    const double top = y.at(cell.y_high);
    const double width = x.at(cell.x_high) - left + 0.3;
    path[static_cast<std::size_t>(shade_of(cell.value, plot))]
        .append("M")
        .append(pixel(left))
        .append(" ")
        .append(pixel(top))
        .append("h")
        .append(pixel(width))
        .append("V")
        .append(pixel(y.at(cell.y_low) + 0.3))
        .append("h")
        .append(pixel(-width))
        .append("z");
  }
  std::string out;
  for (int i = 0; i < shades; ++i) {
    const std::string& each = path[static_cast<std::size_t>(i)];
    if (!each.empty()) out += "<path class=\"" + map_class(i) + "\" d=\"" + each + "\"/>\n";
  }
  return out;
}

double change_along(const std::vector<double>& values) {
  double out = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) out += std::abs(values[i] - values[i - 1]);
  return out;
}

}  // namespace

Series without_way_back(Series cycle) {
  std::vector<std::pair<double, double>> points;
  for (std::size_t i = 0; i < cycle.x.size(); ++i) points.emplace_back(cycle.x[i], cycle.y[i]);
  std::stable_sort(points.begin(), points.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  Series once = cycle;
  for (std::size_t i = 0; i < points.size(); ++i) std::tie(once.x[i], once.y[i]) = points[i];
  // One way is half of there and back; over a loop the sorted points jump between its branches.
  constexpr double most = 0.6;
  return change_along(once.y) <= most * change_along(cycle.y) ? once : cycle;
}

std::string line_plot_svg(const LinePlot& plot) {
  const Extent extent = extent_of(plot);
  if (!(extent.x_high > extent.x_low)) return "";
  const Axis x{extent.x_low, extent.x_high, left_margin, plot.width - right_margin, plot.log_x};
  const Axis y{extent.y_low, extent.y_high, plot.height - 40.0, 44.0, plot.log_y, plot.asinh_y};
  std::string out = opening(plot.width, plot.height, plot.title, plot.description);
  out += x_axis(x, y.to, y.from, plot.x_label, plot.width / 90.0);
  out += y_axis(y, x.from, x.to, plot.y_label, plot.height / 45.0);
  for (const Band& band : plot.bands) {
    const std::string area = area_of(band, x, y);
    if (area.empty()) continue;
    out += "<path class=\"area " + series_class(band.style) + "\" d=\"" + area + "\"/>\n";
  }
  out += marks_of(plot, x, y);
  for (const Series& series : plot.series) {
    const std::string path = series.dots ? dots_of(series, x, y) : path_of(series, x, y);
    if (path.empty()) continue;
    out += "<path class=\"" + std::string(series.dots ? "points " : "line ") +
           series_class(series.style) + "\" d=\"" + path + "\"/>\n";
  }
  return out + legend_of(plot) + "</svg>\n";
}

std::string map_plot_svg(const MapPlot& plot) {
  if (plot.cells.empty() && plot.dots.empty()) return "";
  if (!(plot.x_high > plot.x_low) || !(plot.y_high > plot.y_low)) return "";
  double left = left_margin;
  for (const std::string& row : plot.rows) {
    left = std::max(left, 14.0 + character_width * static_cast<double>(row.size()));
  }
  const Axis x{plot.x_low, plot.x_high, left, plot.width - 70.0, false};
  const Axis y{plot.y_low, plot.y_high, plot.height - 40.0, 44.0, false};
  std::string out = opening(plot.width, plot.height, plot.title, plot.description);
  out += x_axis(x, y.to, y.from, plot.x_label, 4.0);
  if (plot.rows.empty()) out += y_axis(y, x.from, x.to, plot.y_label, 5.0);
  for (std::size_t i = 0; i < plot.rows.size(); ++i) {
    out += text_at(x.from - 5.0, y.at(static_cast<double>(i) + 0.5) + 4.0, "end", plot.rows[i]);
  }
  out += cells_of(plot, x, y);
  for (const Dot& dot : plot.dots) {
    if (!std::isfinite(dot.value)) continue;
    out += "<circle class=\"spot " + map_class(shade_of(dot.value, plot)) + "\" r=\"4.5\" cx=\"" +
           pixel(x.at(dot.x)) + "\" cy=\"" + pixel(y.at(dot.y)) + "\"/>\n";
  }
  return out + colour_scale(plot, y) + "</svg>\n";
}

std::string interval_plot_svg(const IntervalPlot& plot) {
  if (plot.rows.empty()) return "";
  double low = infinite;
  double high = -infinite;
  double left = left_margin;
  const auto include = [&](double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  };
  for (const IntervalRow& row : plot.rows) {
    include(row.value);
    include(row.low);
    include(row.high);
    left = std::max(left, 14.0 + character_width * static_cast<double>(row.name.size()));
  }
  for (const Mark& mark : plot.marks) include(mark.at);
  if (!(high > low)) return "";
  const double margin = 0.06 * (high - low);
  const double top = 30.0;
  const double bottom = top + 22.0 * static_cast<double>(plot.rows.size()) + 6.0;
  const Axis x{low - margin, high + margin, left, plot.width - right_margin, false};
  std::string out = opening(plot.width, bottom + 40.0, plot.title, plot.description);
  out += x_axis(x, top, bottom, plot.x_label, 5.0);
  for (const Mark& mark : plot.marks) {
    out += line(x.at(mark.at), bottom, x.at(mark.at), top, "level");
    if (!mark.label.empty()) {
      out += text_at(x.at(mark.at), top - 3.0, "middle", mark.label, "note");
    }
  }
  for (std::size_t i = 0; i < plot.rows.size(); ++i) {
    const IntervalRow& row = plot.rows[i];
    const double middle = top + 22.0 * static_cast<double>(i) + 14.0;
    out += text_at(left - 8.0, middle + 4.0, "end", row.name);
    if (!std::isfinite(row.value)) continue;
    if (std::isfinite(row.low) && std::isfinite(row.high)) {
      out += line(x.at(row.low), middle, x.at(row.high), middle, "line s2");
    }
    out += "<circle class=\"dot s2\" r=\"4\" cx=\"" + pixel(x.at(row.value)) + "\" cy=\"" +
           pixel(middle) + "\"/>\n";
  }
  return out + "</svg>\n";
}

}  // namespace stickslip::report
