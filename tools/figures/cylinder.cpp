// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/cylinder.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

namespace stickslip::figures {

namespace {

struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  double range() const { return high - low; }
};

Extent extent_of(const std::vector<PhasePoint>& points, double PhasePoint::*value) {
  Extent out;
  for (const PhasePoint& point : points) {
    out.low = std::min(out.low, point.*value);
    out.high = std::max(out.high, point.*value);
  }
  return out;
}

// Multiples of 1, 2 or 5 times a power of ten within the extent, two to six of them.
std::vector<double> round_values(const Extent& extent) {
  std::vector<double> out;
  if (!(extent.range() > 0.0)) return out;
  const double least = extent.range() / 5.0;
  double step = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {2.0, 5.0, 10.0}) {
    if (step >= least) break;
    step = factor * std::pow(10.0, std::floor(std::log10(least)));
  }
  for (double k = std::ceil(extent.low / step); k * step <= extent.high; k += 1.0) {
    out.push_back(k == 0.0 ? 0.0 : k * step);
  }
  return out;
}

// Axes of the portrait, which gnuplot cannot draw in cylindrical coordinates: their lines as a
// table, and their numbers as labels of the commands.
class CylinderAxes {
 public:
  CylinderAxes(const Extent& x, const Extent& v, double hole)
      : x_(x), v_(v), hole_(hole), outer_(x.range() + hole) {}

  // Along the radius at phase 0, in the plane of zero velocity.
  void add_displacement(const std::string& label) {
    for (const double value : round_values(x_)) {
      const double r = value - x_.low + hole_;
      tick({r, 0.0, 0.0}, {r, 0.05 * outer_, 0.0});
      number(value, {r, -0.09 * outer_, 0.0}, "center front boxed");
    }
    text(label, {1.06 * outer_, 0.0, 0.0}, "left front");
  }
  // Quarters of a turn around the outer ring.
  void add_phase() {
    for (const double turn : {0.25, 0.5, 0.75}) {
      tick(on_ring(turn, outer_, 0.0), on_ring(turn, 1.05 * outer_, 0.0));
      number(turn, on_ring(turn, 1.13 * outer_, 0.0), "center front boxed");
    }
  }
  // Vertical, outside the ring.
  void add_velocity(const std::string& label) {
    constexpr double half = 0.5;
    const double r = 1.28 * outer_;
    tick(on_ring(half, r, v_.low), on_ring(half, r, v_.high));
    for (const double value : round_values(v_)) {
      tick(on_ring(half, r, value), on_ring(half, 1.04 * r, value));
      number(value, on_ring(half, 1.07 * r, value), "right");
    }
    text(label, on_ring(half, r, v_.high + 0.1 * v_.range()), "center");
  }

  const Table& lines() const { return lines_; }
  const std::string& labels() const { return labels_; }

 private:
  static std::vector<double> on_ring(double turn, double r, double v) {
    const double angle = -2.0 * std::numbers::pi * turn;
    return {r * std::cos(angle), r * std::sin(angle), v};
  }
  void tick(const std::vector<double>& from, const std::vector<double>& to) {
    lines_.rows.push_back(from);
    lines_.rows.push_back(to);
    lines_.rows.emplace_back();
    lines_.rows.emplace_back();
  }
  void text(const std::string& words, const std::vector<double>& at, const char* style) {
    char place[120];
    std::snprintf(place, sizeof place, "' at %.6g,%.6g,%.6g ", at[0], at[1], at[2]);
    labels_ += "set label '" + words + place + style + "\n";
  }
  void number(double value, const std::vector<double>& at, const char* style) {
    char words[32];
    std::snprintf(words, sizeof words, "%.4g", value);
    text(words, at, style);
  }

  Extent x_;
  Extent v_;
  double hole_;
  double outer_;
  Table lines_{"axes", {}};
  std::string labels_;
};

}  // namespace

Picture cylindrical_portrait(const std::vector<PhasePoint>& points, const Labels& labels,
                             const std::string& stem) {
  const Extent x = extent_of(points, &PhasePoint::x);
  const double hole = 0.4 * x.range();
  const auto radius = [&](double value) { return value - x.low + hole; };
  const auto place = [&](double turn, double r, double v) {
    const double angle = -2.0 * std::numbers::pi * turn;  // clockwise from above
    return std::vector<double>{r * std::cos(angle), r * std::sin(angle), v};
  };

  Table forth{"forth", {}};  // v > 0
  Table back{"back", {}};
  const auto follow = [&](Table& table, bool mine, const PhasePoint& point) {
    if (mine) {
      table.rows.push_back(place(point.turn, radius(point.x), point.v));
    } else if (!table.rows.empty() && !table.rows.back().empty()) {
      // The first point of the other colour is included, so that the lines meet.
      table.rows.push_back(place(point.turn, radius(point.x), point.v));
      table.rows.emplace_back();
      table.rows.emplace_back();
    }
  };
  for (const PhasePoint& point : points) {
    follow(forth, point.v > 0.0, point);
    follow(back, point.v <= 0.0, point);
  }
  if (forth.rows.empty()) forth.rows.push_back(place(0.0, hole, 0.0));
  if (back.rows.empty()) back.rows.push_back(place(0.0, hole, 0.0));

  Table rings{"rings", {}};
  for (const double r : {hole, radius(x.high)}) {
    for (int i = 0; i <= 120; ++i) rings.rows.push_back(place(i / 120.0, r, 0.0));
    rings.rows.emplace_back();
    rings.rows.emplace_back();
  }
  rings.rows.push_back(place(0.0, hole, 0.0));
  rings.rows.push_back(place(0.0, radius(x.high), 0.0));

  CylinderAxes axes(x, extent_of(points, &PhasePoint::v), hole);
  axes.add_displacement(labels.displacement);
  axes.add_phase();
  axes.add_velocity(labels.velocity);

  Picture out;
  out.stem = stem;
  out.width = 720;
  out.height = 600;
  out.tables = {forth, back, rings, axes.lines()};
  out.commands =
      "set style textbox opaque noborder fillcolor '#ffffff' margins 0.5,0.3\n"
      "set origin 0.02,-0.02\nset view 62,25,1.3\nset view equal xy\nset ticslevel 0\n"
      "unset border\nunset tics\nset key at screen 0.97,0.13\n"
      "set label 'around: phase of the drive [turns], clockwise' at screen 0.5,0.96 center\n" +
      axes.labels() +
      "splot $rings using 1:2:3 with lines lc rgb '#c8502a' lw 1.6 title 'zero velocity', "
      "$forth using 1:2:3 with lines lc rgb '#1f5a99' lw 0.5 title 'v > 0', "
      "$back using 1:2:3 with lines lc rgb '#8a8a8a' lw 0.5 title 'v <= 0', "
      "$axes using 1:2:3 with lines lc rgb '#222222' lw 1 title ''";
  return out;
}

Picture near_rest(const std::vector<PhasePoint>& points, const Labels& labels, double share,
                  const std::string& stem) {
  const Extent v = extent_of(points, &PhasePoint::v);
  Table orbits{"orbits", {}};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double turn = std::floor(points[i].turn);
    if (i > 0 && turn != std::floor(points[i - 1].turn)) orbits.rows.emplace_back();
    orbits.rows.push_back({points[i].turn - turn, points[i].v});
  }
  Picture out;
  out.stem = stem;
  out.tables = {orbits};
  char range[80];
  std::snprintf(range, sizeof range, "set yrange [%.6g:%.6g]\n", -share * v.range(),
                share * v.range());
  out.commands = "set xlabel 'phase of the drive [turns]'\nset ylabel '" + labels.velocity +
                 "'\nset xrange [0:1]\n" + range +
                 "set xzeroaxis lc rgb '#c8502a' lw 1.6\nset grid lc rgb '#dddddd'\nunset key\n"
                 "plot $orbits using 1:2 with lines lc rgb '#1f5a99' lw 0.5";
  return out;
}

}  // namespace stickslip::figures
