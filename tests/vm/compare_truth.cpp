// SPDX-License-Identifier: Apache-2.0
// Comparison of a recording of a bench with the truth (of bench_devices):
//
//   compare_truth RECORDING TRUTH CARRIER_HZ FROM_NS TO_NS
//
// prints, as JSON, for each channel the delay of the readings, their RMS error after its removal
// and the slope of the truth, the number of gaps, and the true amplitude of the base at the carrier
// between the two times.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "physics/frame.h"
#include "protocol/recording.h"

namespace stickslip {
namespace {

struct Row {
  std::int64_t time_ns;
  std::array<double, channel_count> value;
};

std::vector<Row> read_truth(const char* file) {
  std::ifstream in(file, std::ios::binary);
  std::vector<Row> rows;
  for (Row row{}; in.read(reinterpret_cast<char*>(&row), sizeof row);) rows.push_back(row);
  if (rows.size() < 2) throw std::runtime_error(std::string(file) + " contains no rows");
  return rows;
}

/// NaN outside of the recorded range.
double truth_at(const std::vector<Row>& rows, std::size_t channel, double time_ns) {
  const double step = static_cast<double>(rows[1].time_ns - rows[0].time_ns);
  const double at = (time_ns - static_cast<double>(rows.front().time_ns)) / step;
  if (at < 0.0 || at + 1.0 >= static_cast<double>(rows.size())) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const auto i = static_cast<std::size_t>(at);
  const double part = at - static_cast<double>(i);
  return rows[i].value[channel] + part * (rows[i + 1].value[channel] - rows[i].value[channel]);
}

struct Point {
  double time_ns;
  double value;
};

/// Each reading once: that of a gauge is repeated in the frames until the next one.
std::vector<Point> readings_of(const protocol::Recording& recording, Channel channel) {
  std::vector<Point> out;
  for (const Frame& frame : recording.frames) {
    if (!frame.has(channel)) continue;
    const double time_ns =
        static_cast<double>(frame.time_ns) - 1e3 * frame.age_us[index_of(channel)];
    // Ages are whole microseconds.
    if (!out.empty() && std::abs(time_ns - out.back().time_ns) < 5e3) continue;
    out.push_back({time_ns, frame[channel]});
  }
  return out;
}

double rms_at(const std::vector<Point>& points, const std::vector<Row>& rows, std::size_t channel,
              double delay_ns) {
  double squares = 0.0;
  std::size_t count = 0;
  for (const Point& point : points) {
    const double truth = truth_at(rows, channel, point.time_ns - delay_ns);
    if (!std::isfinite(truth)) continue;
    squares += (point.value - truth) * (point.value - truth);
    ++count;
  }
  return count == 0 ? std::numeric_limits<double>::infinity()
                    : std::sqrt(squares / static_cast<double>(count));
}

/// The delay with the smallest error of these readings, to 10 us, within -20 to 60 ms.
double lateness_ns(const std::vector<Point>& points, const std::vector<Row>& rows,
                   std::size_t channel) {
  double best_ns = 0.0;
  double low = -20e6;
  double high = 60e6;
  for (double step = 2e6; step >= 1e4; step /= 5.0) {
    double best = std::numeric_limits<double>::infinity();
    for (double late = low; late <= high; late += step) {
      const double rms = rms_at(points, rows, channel, late);
      if (rms < best) {
        best = rms;
        best_ns = late;
      }
    }
    low = best_ns - step;
    high = best_ns + step;
  }
  return best_ns;
}

/// RMS slope of the truth at the readings [1/s].
double slope_at(const std::vector<Point>& points, const std::vector<Row>& rows,
                std::size_t channel) {
  constexpr double step_ns = 1e6;
  double squares = 0.0;
  std::size_t count = 0;
  for (const Point& point : points) {
    const double rise = truth_at(rows, channel, point.time_ns + 0.5 * step_ns) -
                        truth_at(rows, channel, point.time_ns - 0.5 * step_ns);
    if (!std::isfinite(rise)) continue;
    squares += rise * rise / (1e-18 * step_ns * step_ns);
    ++count;
  }
  return count == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(count));
}

double amplitude(const std::vector<Row>& rows, double carrier_hz, std::int64_t from_ns,
                 std::int64_t to_ns) {
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Row& row : rows) {
    if (row.time_ns < from_ns || row.time_ns > to_ns) continue;
    const double phase_rad =
        2.0 * std::numbers::pi * carrier_hz * static_cast<double>(row.time_ns - from_ns) * 1e-9;
    const Eigen::Vector3d basis(1.0, std::sin(phase_rad), std::cos(phase_rad));
    products += basis * basis.transpose();
    right += basis * row.value[index_of(Channel::base_displacement)];
  }
  const Eigen::Vector3d found = products.ldlt().solve(right);
  return std::hypot(found[1], found[2]);
}

int run(char** argv) {
  const protocol::Recording recording = protocol::read_recording(argv[1]);
  const std::vector<Row> rows = read_truth(argv[2]);
  std::uint64_t missing = 0;
  std::uint64_t gaps = 0;
  for (std::size_t i = 1; i < recording.frames.size(); ++i) {
    const std::uint64_t step = recording.frames[i].sequence - recording.frames[i - 1].sequence;
    missing += step - 1;
    if (step != 1) ++gaps;
  }
  std::printf("{\"frames\": %zu, \"missing\": %llu, \"gaps\": %llu, \"amplitude_m\": %.9g",
              recording.frames.size(), static_cast<unsigned long long>(missing),
              static_cast<unsigned long long>(gaps),
              amplitude(rows, std::atof(argv[3]), std::atoll(argv[4]), std::atoll(argv[5])));
  for (const Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    const std::vector<Point> points = readings_of(recording, channel);
    if (points.empty()) continue;
    // A few thousand readings, spread over the recording, determine the delay.
    std::vector<Point> subset;
    for (std::size_t k = 0; k < points.size(); k += 1 + points.size() / 4000) {
      subset.push_back(points[k]);
    }
    const double delay_ns = lateness_ns(subset, rows, i);
    std::printf(
        ", \"%s\": {\"readings\": %zu, \"late_ms\": %.3f, \"rms\": %.6g, \"slope_per_s\": %.6g}",
        info(channel).stem.data(), points.size(), delay_ns * 1e-6,
        rms_at(points, rows, i, delay_ns), slope_at(points, rows, i));
  }
  std::puts("}");
  return 0;
}

}  // namespace
}  // namespace stickslip

int main(int argc, char** argv) {
  if (argc != 6) {
    std::fprintf(stderr, "usage: compare_truth RECORDING TRUTH CARRIER_HZ FROM_NS TO_NS\n");
    return 2;
  }
  try {
    return stickslip::run(argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "compare_truth: %s\n", error.what());
    return 1;
  }
}
