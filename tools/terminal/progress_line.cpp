// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/progress_line.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tools/terminal/text.h"

namespace stickslip::terminal {

namespace {

// Carriage return, then erase to the end of the line.
constexpr const char* erase_line = "\r\033[K";

// Below this share the rate is not yet meaningful.
constexpr double min_share = 1e-3;

}  // namespace

std::string duration_text(double seconds) {
  if (!std::isfinite(seconds) || seconds > 1e9) return "very long";
  constexpr double rounding = 1e-6;  // rounding error of a whole number of seconds
  const auto all = static_cast<std::int64_t>(std::ceil(std::max(0.0, seconds - rounding)));
  const auto two_units = [](std::int64_t large, const char* unit, std::int64_t small,
                            const char* smaller) {
    std::string text = std::to_string(large) + ' ' + unit;
    return small == 0 ? text : text + ' ' + std::to_string(small) + ' ' + smaller;
  };
  if (all < 60) return std::to_string(all) + " s";
  if (all < 3600) return two_units(all / 60, "min", all % 60, "s");
  if (all < 86400) return two_units(all / 3600, "h", all % 3600 / 60, "min");
  return two_units(all / 86400, "d", all % 86400 / 3600, "h");
}

std::string progress_text(const Status& status, double elapsed_s, std::size_t columns) {
  if (columns < 2) return "";
  const std::size_t width = columns - 1;  // a full line would wrap
  const std::string label = printable(status.label);
  std::string before;
  std::string after = ", " + duration_text(std::floor(elapsed_s));
  std::string alone = after.substr(2);
  if (status.done) {
    const double done = std::clamp(*status.done, 0.0, 1.0);
    std::string percent = std::to_string(static_cast<int>(std::floor(100.0 * done))) + " %";
    before = padded_left(percent, 5) + "  ";
    after =
        done >= min_share ? ", " + duration_text(elapsed_s * (1.0 - done) / done) + " left" : "";
    alone = percent + after;
    if (columns_in(alone) > width) alone = std::move(percent);
  }
  // The label is omitted rather than shortened below this length.
  constexpr std::size_t shortest_label = 8;
  const std::size_t taken = columns_in(before) + columns_in(after);
  if (width >= taken + std::min(shortest_label, columns_in(label)) && !label.empty()) {
    return before + cut_to(label, width - taken) + after;
  }
  return columns_in(alone) <= width ? alone : "";
}

std::string ProgressLine::draw(double now_s, const Status& status, std::size_t columns) {
  if (now_s - start_s_ < display_delay_s) return "";
  if (drawn_s_ && now_s - *drawn_s_ < period_s) return "";
  std::string text = progress_text(status, now_s - start_s_, columns);
  if (text == shown_) return "";
  drawn_s_ = now_s;
  shown_ = std::move(text);
  return erase_line + shown_;
}

std::string ProgressLine::erase() {
  if (shown_.empty()) return "";
  shown_.clear();
  return erase_line;
}

}  // namespace stickslip::terminal
