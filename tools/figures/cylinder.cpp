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

  Picture out;
  out.stem = stem;
  out.width = 720;
  out.height = 600;
  out.tables = {forth, back, rings};
  char radial[160];
  std::snprintf(radial, sizeof radial, "radius: %s, %.3g to %.3g", labels.displacement.c_str(),
                x.low, x.high);
  out.commands =
      "set origin 0.05,0\nset view 62,25,1.35\nset ticslevel 0\nunset border\nunset xtics\nunset "
      "ytics\n"
      "set view equal xy\nset zlabel '" +
      labels.velocity + "' rotate\nset xzeroaxis\nset key at screen 0.97,0.13\nset label 1 '" +
      radial +
      "; around: drive phase, clockwise' at screen 0.5,0.96 center\n"
      "splot $rings using 1:2:3 with lines lc rgb '#c8502a' lw 1.6 title 'zero velocity', "
      "$forth using 1:2:3 with lines lc rgb '#1f5a99' lw 0.5 title 'v > 0', "
      "$back using 1:2:3 with lines lc rgb '#8a8a8a' lw 0.5 title 'v <= 0'";
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
