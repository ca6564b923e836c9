// SPDX-License-Identifier: Apache-2.0
#include "daemon/event.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

std::string milliseconds(std::int64_t ns) {
  const std::int64_t us = (ns + 500) / 1000;
  std::string fraction = std::to_string(us % 1000);
  return std::to_string(us / 1000) + '.' + std::string(3 - fraction.size(), '0') + fraction + " ms";
}

std::string count_of(const Notice& notice) { return std::to_string(notice.count); }
std::string text_of(const Notice& notice) { return notice.text.data(); }

std::string channel_of(const Notice& notice) {
  return notice.count < channel_count ? std::string(channel_table[notice.count].stem)
                                      : "unknown channel";
}

struct Description {
  Notice::Kind kind;
  Severity severity;
  const char* code;
  std::string (*message)(const Notice&);
};

using enum Notice::Kind;
using enum Severity;

/// In the order of Notice::Kind.
constexpr std::array descriptions = {
    Description{fault, error, "fault",
                [](const Notice& notice) { return "amplifier off: " + text_of(notice); }},
    Description{state, info, "state",
                [](const Notice& notice) { return "the rig is " + text_of(notice); }},
    Description{left_on, error, "left_on",
                [](const Notice& notice) {
                  return notice.text.front() == '\0'
                             ? std::string("the last \"off\" was not acknowledged")
                             : text_of(notice);
                }},
    Description{device_back, warning, "device_back",
                [](const Notice&) {
                  return std::string(
                      "the device is back; the fault stays latched until an operator clears it");
                }},
    Description{clock_jumped, warning, "clock_jumped",
                [](const Notice& notice) {
                  const std::string by = milliseconds(std::abs(notice.duration_ns));
                  return notice.duration_ns < 0
                             ? "the source's clock was set back by " + by +
                                   "; its later times are shifted, so that they increase"
                             : "the source's clock jumped ahead by " + by +
                                   " with no frame missing; the times of its frames have this step";
                }},
    Description{
        read_failed, warning, "read_failed",
        [](const Notice& notice) { return "reading the device failed: " + text_of(notice); }},
    Description{write_failed, warning, "write_failed",
                [](const Notice& notice) {
                  return "writing the drive to the device failed: " + text_of(notice);
                }},
    Description{
        frames_missing, warning, "frames_missing",
        [](const Notice& notice) { return "the source lost " + count_of(notice) + " frames"; }},
    Description{sequence_repeated, warning, "sequence_repeated",
                [](const Notice& notice) {
                  return "the source's sequence number did not increase: " + count_of(notice) +
                         " after " + std::to_string(notice.sequence);
                }},
    Description{not_finite, warning, "not_finite",
                [](const Notice& notice) {
                  return channel_of(notice) + " is not a finite number; invalid until it is";
                }},
    Description{beyond_calibration, warning, "beyond_calibration",
                [](const Notice& notice) {
                  return channel_of(notice) + " is outside its calibrated range";
                }},
    Description{overrun, warning, "overrun",
                [](const Notice& notice) {
                  return "a cycle was " + milliseconds(notice.duration_ns) + " late, " +
                         count_of(notice) + " periods skipped";
                }},
    Description{end_of_data, info, "end_of_data",
                [](const Notice&) { return std::string("the source has no more data"); }},
    Description{
        estimate_restarted, warning, "estimate_restarted",
        [](const Notice&) { return std::string("the observer diverged and was restarted"); }},
};

constexpr bool in_order() {
  for (std::size_t i = 0; i < descriptions.size(); ++i) {
    if (static_cast<std::size_t>(descriptions[i].kind) != i) return false;
  }
  return true;
}
static_assert(in_order() && descriptions.back().kind == estimate_restarted);

}  // namespace

Event event_of(const Notice& notice) {
  const Description& description = descriptions.at(static_cast<std::size_t>(notice.kind));
  const bool of_channel = notice.kind == not_finite || notice.kind == beyond_calibration;
  return {description.severity, description.code, description.message(notice),
          notice.time_ns,       notice.sequence,  of_channel ? channel_of(notice) : ""};
}

Event note_event(const std::string& text, std::int64_t time_ns, std::uint64_t sequence) {
  constexpr std::size_t longest = 500;
  const auto refuse = [](const std::string& why) {
    throw InputError(Problem{"", 0, 0, "a note " + why});
  };
  if (text.find_first_not_of(' ') == std::string::npos) refuse("must not be empty");
  if (text.size() > longest) {
    refuse("has at most " + std::to_string(longest) + " bytes, this one " +
           std::to_string(text.size()));
  }
  if (std::any_of(text.begin(), text.end(),
                  [](unsigned char c) { return c < 0x20 || c == 0x7f; })) {
    refuse("is one line without control characters");
  }
  return {info, "note", text, time_ns, sequence, ""};
}

Event event_of(const Notice& sum, std::uint64_t notices) {
  Event out = event_of(sum);
  const std::string times = std::to_string(notices);
  switch (sum.kind) {
    case frames_missing:
      out.message = "the source lost " + count_of(sum) + " more frames, in " + times + " gaps";
      break;
    case sequence_repeated:
      out.message = "the source's sequence number did not increase, " + times + " more times";
      break;
    case overrun:
      out.message = times + " more cycles were late, by up to " + milliseconds(sum.duration_ns) +
                    ", " + count_of(sum) + " periods skipped";
      break;
    default:
      out.message += ", " + times + " more times";
      break;
  }
  return out;
}

}  // namespace stickslip::daemon
