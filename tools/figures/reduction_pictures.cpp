// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/reduction_pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "physics/number_text.h"

namespace stickslip::figures {

namespace {

constexpr double mm = 1.0e3;  // per metre
constexpr double missing = std::numeric_limits<double>::quiet_NaN();
// More points would hide one another.
constexpr std::size_t max_points = 6000;

using Rows = std::vector<std::vector<double>>;

template <typename Row>
Rows rows_of(const reduction::Reduction& reduced, Row row) {
  Rows rows;
  const std::size_t stride = 1 + reduced.samples.size() / max_points;
  for (std::size_t i = 0; i < reduced.samples.size(); i += stride) {
    rows.push_back(row(reduced.samples[i]));
  }
  return rows;
}

// The cells as gnuplot's grid of a surface: a block of rows per displacement, NaN for empty cells.
Rows grid_of(const std::vector<reduction::Cell>& cells) {
  std::set<double> xs;
  std::set<double> vs;
  for (const auto& cell : cells) {
    xs.insert(cell.displacement_m);
    vs.insert(cell.velocity_m_s);
  }
  Rows rows;
  auto cell = cells.begin();  // in the order of the grid
  for (const double x : xs) {
    for (const double v : vs) {
      const bool there =
          cell != cells.end() && cell->displacement_m == x && cell->velocity_m_s == v;
      rows.push_back({x * mm, v, there ? cell->mu : missing});
      if (there) ++cell;
    }
    rows.push_back({});
  }
  return rows;
}

// Half of the smallest distance between neighbours.
double half_width_of(const std::set<double>& centres) {
  double width = std::numeric_limits<double>::infinity();
  double former = missing;
  for (const double centre : centres) {
    if (std::isfinite(former)) width = std::min(width, centre - former);
    former = centre;
  }
  return std::isfinite(width) ? 0.5 * width : 0.5;
}

}  // namespace

Picture mu_surface(const reduction::Reduction& reduced, const std::string& stem) {
  Picture out;
  out.stem = stem;
  out.width = 720;
  out.height = 560;
  Rows scatter;
  for (const auto& cell : reduced.surface) {
    if (cell.samples < 2) continue;
    const double x = cell.displacement_m * mm;
    scatter.push_back({x, cell.velocity_m_s, cell.mu - cell.scatter});
    scatter.push_back({x, cell.velocity_m_s, cell.mu + cell.scatter});
    scatter.push_back({});
    scatter.push_back({});
  }
  if (scatter.empty()) scatter.push_back({0, 0, missing});
  out.tables = {
      {"samples", rows_of(reduced,
                          [](const auto& s) {
                            return std::vector<double>{s.displacement_m * mm, s.velocity_m_s, s.mu};
                          })},
      {"cells", grid_of(reduced.surface)},
      {"scatter", scatter}};
  out.commands =
      "set view 58,320\nset xlabel 'x [mm]'\nset ylabel 'v [m/s]'\nset zlabel 'mu' rotate\n"
      "set xtics offset 0.4,-0.3\nset ytics offset -0.6,-0.3\n"
      "set ticslevel 0\nset grid x y z lc rgb '#dddddd'\nset cblabel 'mu'\n"
      "set key top right\n"
      "splot $cells using 1:2:3 with pm3d title '', "
      "$samples using 1:2:3 with points pt 7 ps 0.22 lc rgb '#606060' title 'samples', "
      "$scatter using 1:2:3 with lines lc rgb '#c8502a' lw 0.8 title 'scatter in a cell'";
  return out;
}

Picture mu_map(const reduction::Reduction& reduced, const std::string& stem) {
  std::set<double> xs;
  std::set<double> vs;
  double largest = 0.0;
  for (const auto& cell : reduced.surface) {
    xs.insert(cell.displacement_m);
    vs.insert(cell.velocity_m_s);
    largest = std::max(largest, std::abs(cell.mu));
  }
  const double half_x = half_width_of(xs) * mm;
  const double half_v = half_width_of(vs);
  Table cells{"cells", {}};
  for (const auto& cell : reduced.surface) {
    cells.rows.push_back({cell.displacement_m * mm, cell.velocity_m_s, half_x, half_v, cell.mu});
  }
  if (cells.rows.empty()) cells.rows.push_back({0, 0, half_x, half_v, missing});
  Picture out;
  out.stem = stem;
  out.width = 720;
  out.height = 560;
  out.tables = {cells};
  const std::string end = physics::number_text(largest > 0.0 ? largest : 1.0, 2);
  out.commands =
      "set xlabel 'x [mm]'\nset ylabel 'v [m/s]'\nset cblabel 'mu, mean of the cell'\nunset key\n"
      "set palette defined (-1 '#8a3a10', -0.5 '#e39a5f', 0 '#ffffff', 0.5 '#7fb2dd', 1 "
      "'#10467f')\n"
      "set cbrange [-" +
      end + ":" + end +
      "]\nset style fill solid noborder\nset object 1 rectangle from graph 0,0 to graph 1,1 behind "
      "fc rgb '#e8e8e8' fs solid noborder\n"
      "plot $cells using 1:2:3:4:5 with boxxyerror lc palette";
  return out;
}

Picture phase_sweep(const reduction::Reduction& reduced, const std::string& stem) {
  Picture out;
  out.stem = stem;
  out.tables = {{"samples", rows_of(reduced, [](const auto& s) {
                   return std::vector<double>{s.displacement_m * mm, s.velocity_m_s};
                 })}};
  out.commands =
      "set xlabel 'x [mm]'\nset ylabel 'v [m/s]'\nset grid lc rgb '#dddddd'\nunset key\n"
      "plot $samples using 1:2 with lines lc rgb '#1f5a99' lw 0.6";
  return out;
}

Picture mu_against_velocity(const reduction::Reduction& reduced, const std::string& stem) {
  Picture out;
  out.stem = stem;
  out.tables = {{"samples", rows_of(reduced, [](const auto& s) {
                   return std::vector<double>{s.velocity_m_s, s.mu};
                 })}};
  out.commands =
      "set xlabel 'v [m/s]'\nset ylabel 'mu'\nset grid lc rgb '#dddddd'\nunset key\n"
      "set xzeroaxis lc rgb '#888888'\nset yzeroaxis lc rgb '#888888'\n"
      "plot $samples using 1:2 with lines lc rgb '#1f5a99' lw 0.6";
  return out;
}

Picture mu_against_displacement(const reduction::Reduction& reduced, const std::string& stem) {
  Picture out;
  out.stem = stem;
  out.tables = {{"samples", rows_of(reduced, [](const auto& s) {
                   return std::vector<double>{s.displacement_m * mm, s.mu};
                 })}};
  out.commands =
      "set xlabel 'x [mm]'\nset ylabel 'mu'\nset grid lc rgb '#dddddd'\nunset key\n"
      "set xzeroaxis lc rgb '#888888'\n"
      "plot $samples using 1:2 with lines lc rgb '#1f5a99' lw 0.6";
  return out;
}

Picture load_against_displacement(const reduction::Reduction& reduced, const std::string& stem) {
  Picture out;
  out.stem = stem;
  out.tables = {{"samples", rows_of(reduced, [](const auto& s) {
                   return std::vector<double>{s.displacement_m * mm, s.normal_load_n};
                 })}};
  const std::string load = physics::number_text(reduced.load_n, 4);
  const std::string slope = physics::number_text(reduced.load_n * reduced.slope_per_m / mm, 6);
  out.commands =
      "set xlabel 'x [mm]'\nset ylabel 'N [N]'\nset grid lc rgb '#dddddd'\nset key top left\n"
      "set yrange [0:*]\n"
      "plot $samples using 1:2 with points pt 7 ps 0.25 lc rgb '#1f5a99' title 'samples', " +
      load + " + (" + slope + ") * x with lines lc rgb '#c8502a' lw 1.5 title '" + load + " N (1 " +
      (reduced.slope_per_m < 0.0 ? "- " : "+ ") +
      physics::number_text(std::abs(reduced.slope_per_m)) + "/m x)'";
  return out;
}

std::vector<Picture> reduction_pictures(const reduction::Reduction& reduced) {
  return {mu_surface(reduced, "surface"),
          mu_map(reduced, "map"),
          phase_sweep(reduced, "sweep"),
          mu_against_velocity(reduced, "mu-v"),
          mu_against_displacement(reduced, "mu-x"),
          load_against_displacement(reduced, "n-x")};
}

std::string samples_csv(const reduction::Reduction& reduced) {
  using physics::number_text;
  std::string out =
      "time_s,displacement_m,velocity_m_s,base_displacement_m,friction_force_n,normal_load_n,mu\n";
  for (const auto& s : reduced.samples) {
    out += physics::fixed_text(s.time_s, 9) + ',';
    for (const double each : {s.displacement_m, s.velocity_m_s, s.base_displacement_m,
                              s.friction_force_n, s.normal_load_n}) {
      out += number_text(each, 9) + ',';
    }
    if (std::isfinite(s.mu)) out += number_text(s.mu, 9);
    out += '\n';
  }
  return out;
}

std::string surface_csv(const reduction::Reduction& reduced) {
  using physics::number_text;
  std::string out = "displacement_m,velocity_m_s,mu,scatter,standard_error,samples,visits\n";
  for (const auto& cell : reduced.surface) {
    for (const double each :
         {cell.displacement_m, cell.velocity_m_s, cell.mu, cell.scatter, cell.standard_error}) {
      out += number_text(each, 9) + ',';
    }
    out += std::to_string(cell.samples) + ',' + std::to_string(cell.visits) + '\n';
  }
  return out;
}

}  // namespace stickslip::figures
