// SPDX-License-Identifier: Apache-2.0
#include "protocol/recording.h"

#include <algorithm>
#include <array>
#include <ctime>

#include "physics/number_text.h"

namespace stickslip::protocol {

std::string cut_off_warning(const Recording& recording) {
  if (recording.cut_off_line > 0) {
    return recording.source + ':' + std::to_string(recording.cut_off_line) +
           ": the last line is not read, since it has no newline and may be cut within a number; " +
           "append a newline if it is complete. " +
           physics::counted(recording.frames.size(), "frame") + " could be read before it";
  }
  const bool one = recording.cut_off_bytes == 1;
  return recording.source + ": truncated: its last " +
         physics::counted(recording.cut_off_bytes, "byte") + (one ? " is" : " are") +
         " an incomplete event, before which " +
         physics::counted(recording.frames.size(), "frame") + " could be read";
}

std::string model_change_note(const Recording& recording, const ModelChange& change) {
  return recording.source + ": after " +
         physics::fixed_text(static_cast<double>(change.time_ns) * 1e-9, 3) + " s, " +
         change.message;
}

std::string utc_text(std::int64_t utc_us) {
  if (utc_us <= 0) return "";
  const auto when = static_cast<std::time_t>(utc_us / 1'000'000);
  std::tm utc{};
  if (gmtime_r(&when, &utc) == nullptr) return "";
  std::array<char, 40> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc)};
}

double median_period_s(std::span<const Frame> frames) {
  std::vector<std::int64_t> steps;
  steps.reserve(frames.size());
  for (std::size_t i = 1; i < frames.size(); ++i) {
    steps.push_back(frames[i].time_ns - frames[i - 1].time_ns);
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return static_cast<double>(*middle) * 1.0e-9;
}

}  // namespace stickslip::protocol
