// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/bifurcation_picture.h"

#include <cstdio>

namespace stickslip::figures {

namespace {

// gnuplot reads '_' and '^' as markup, and a quote as the end of the text.
std::string quoted(const std::string& label) {
  std::string out = "'";
  for (const char c : label) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "' noenhanced";
}

std::string range_of(const std::vector<dynamics::BifurcationColumn>& columns, double factor) {
  if (columns.size() < 2) return "";
  char text[80];
  std::snprintf(text, sizeof text, "set xrange [%.9g:%.9g]\n", factor * columns.front().value,
                factor * columns.back().value);
  return text;
}

}  // namespace

Picture bifurcation_picture(const std::vector<dynamics::BifurcationColumn>& columns,
                            bool with_exponents, const BifurcationAxes& axes,
                            const std::string& stem) {
  Picture out;
  out.stem = stem;
  out.width = 900;
  out.height = with_exponents ? 760 : 560;
  Table sections{"sections", {}};
  Table exponents{"exponents", {}};
  for (const auto& column : columns) {
    const double at = axes.parameter_factor * column.value;
    for (const dynamics::Point& point : column.section) {
      sections.rows.push_back({at, axes.displacement_factor * point.x()});
    }
    exponents.rows.push_back({at, column.exponent_per_s});
  }
  out.tables = {sections};
  const std::string below = "set xlabel " + quoted(axes.parameter) + "\n";
  const std::string diagram =
      "set ylabel " + quoted(axes.displacement) +
      "\nplot $sections using 1:2 with points pt 7 ps 0.12 lc rgb '#1f5a99'\n";
  out.commands =
      "set grid lc rgb '#dddddd'\nunset key\n" + range_of(columns, axes.parameter_factor);
  if (!with_exponents) {
    out.commands += below + diagram;
    return out;
  }
  out.tables.push_back(exponents);
  // Equal margins at the left align the panels.
  out.commands +=
      "set multiplot\nset lmargin 11\nset origin 0,0.36\nset size 1,0.64\nunset xlabel\n" +
      diagram + "set origin 0,0\nset size 1,0.38\n" + below + "set ylabel " +
      quoted(axes.exponent) +
      "\nset xzeroaxis lc rgb '#c8502a' lw 1.6\n"
      "plot $exponents using 1:2 with lines lc rgb '#1f5a99' lw 1.2\nunset multiplot\n";
  return out;
}

}  // namespace stickslip::figures
