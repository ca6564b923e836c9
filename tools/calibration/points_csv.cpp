// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/points_csv.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>

#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::calibration {

namespace {

struct Column {
  std::string_view name;
  double config::CalibrationPoint::*value;
  bool needed;
};

constexpr std::array columns = {
    Column{"raw", &config::CalibrationPoint::raw, true},
    Column{"raw_std", &config::CalibrationPoint::raw_std, false},
    Column{"reference_si", &config::CalibrationPoint::reference_si, true},
    Column{"reference_sigma", &config::CalibrationPoint::reference_sigma, false}};

constexpr const char* expected_columns =
    "expected raw, reference_si and, if known, raw_std, reference_sigma";

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> out;
  while (true) {
    const auto comma = line.find(',');
    out.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

/// Text of a file, made printable for a message.
std::string shown(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string out;
  for (const char c : text.substr(0, longest)) {
    out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return text.size() > longest ? out + "..." : out;
}

std::optional<double> number_of(std::string_view cell) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  const bool all = error == std::errc{} && end == cell.data() + cell.size();
  return all && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

}  // namespace

std::vector<config::CalibrationPoint> parse_points(std::string_view text, const std::string& name) {
  std::vector<config::CalibrationPoint> points;
  std::vector<const Column*> header;
  int number = 0;
  const auto refuse = [&](const std::string& why) {
    return InputError(Problem{name, number, 0, why});
  };
  while (!text.empty()) {
    const auto end = text.find('\n');
    const std::string_view line = trimmed(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    ++number;
    if (line.empty() || line.front() == '#') continue;
    const std::vector<std::string_view> cells = cells_of(line);
    if (header.empty()) {
      for (const std::string_view cell : cells) {
        const Column* known = nullptr;
        for (const Column& column : columns) {
          if (column.name == cell) known = &column;
        }
        if (known == nullptr) {
          throw refuse("unknown column \"" + shown(cell) + "\": " + expected_columns);
        }
        for (const Column* other : header) {
          if (other == known) throw refuse("the column " + shown(cell) + " appears twice");
        }
        header.push_back(known);
      }
      for (const Column& column : columns) {
        bool there = !column.needed;
        for (const Column* each : header) there = there || each == &column;
        if (!there) {
          throw refuse("lacks the column " + std::string(column.name) + ": " + expected_columns);
        }
      }
      continue;
    }
    if (cells.size() != header.size()) {
      throw refuse("has " + physics::counted(cells.size(), "cell") + ", expected " +
                   std::to_string(header.size()) + " as in the header");
    }
    config::CalibrationPoint point;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const auto value = number_of(cells[i]);
      const std::string column(header[i]->name);
      if (!value) throw refuse(column + ": expected a number, found \"" + shown(cells[i]) + "\"");
      const bool spread = header[i]->value == &config::CalibrationPoint::raw_std ||
                          header[i]->value == &config::CalibrationPoint::reference_sigma;
      if (spread && *value < 0.0) {
        throw refuse(column + ": a standard deviation is 0 or more, found " + shown(cells[i]));
      }
      point.*(header[i]->value) = *value;
    }
    points.push_back(point);
  }
  number = 0;
  if (header.empty()) throw refuse(std::string("holds no header: ") + expected_columns);
  if (points.empty()) throw refuse("holds no points below its header");
  return points;
}

}  // namespace stickslip::calibration
