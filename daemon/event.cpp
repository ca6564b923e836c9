#include "daemon/event.h"

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace stickslip::daemon {
namespace {

std::string milliseconds(std::int64_t ns) {
  const std::int64_t us = (ns + 500) / 1000;
  std::string fraction = std::to_string(us % 1000);
  return std::to_string(us / 1000) + '.' + std::string(3 - fraction.size(), '0') + fraction + " ms";
}

std::string channel_name(std::uint64_t index) {
  return index < channel_count ? std::string(channel_table[index].stem) : "unknown channel";
}

}  // namespace

Event event_of(const Notice& notice) {
  Event out;
  out.time_ns = notice.time_ns;
  out.sequence = notice.sequence;
  const std::string count = std::to_string(notice.count);
  const std::string cause = notice.text.data();
  const auto say = [&out](Severity severity, const char* code, std::string message) {
    out.severity = severity;
    out.code = code;
    out.message = std::move(message);
  };
  switch (notice.kind) {
    case Notice::Kind::fault:
      say(Severity::error, "fault", "amplifier off: " + cause);
      break;
    case Notice::Kind::state:
      say(Severity::info, "state", "the rig is " + cause);
      break;
    case Notice::Kind::device_back:
      say(Severity::warning, "device_back",
          "the device is back; the fault stays until a person clears it");
      break;
    case Notice::Kind::left_on:
      say(Severity::error, "left_on", cause.empty() ? "the last \"off\" was not confirmed" : cause);
      break;
    case Notice::Kind::clock_parted:
      say(Severity::warning, "clock_parted",
          "the clocks of device and host have parted; their correction begins anew");
      break;
    case Notice::Kind::read_failed:
      say(Severity::warning, "read_failed", "the device did not answer a read: " + cause);
      break;
    case Notice::Kind::write_failed:
      say(Severity::warning, "write_failed", "the device did not take a drive value: " + cause);
      break;
    case Notice::Kind::frames_missing:
      say(Severity::warning, "frames_missing", "the source lost " + count + " frames");
      break;
    case Notice::Kind::sequence_repeated:
      say(Severity::warning, "sequence_repeated",
          "the source's sequence number did not grow: " + count + " after " +
              std::to_string(notice.sequence));
      break;
    case Notice::Kind::not_finite:
      say(Severity::warning, "not_finite",
          channel_name(notice.count) + " is not a finite number; invalid until it is one");
      break;
    case Notice::Kind::beyond_calibration:
      say(Severity::warning, "beyond_calibration",
          channel_name(notice.count) + " is beyond the range in which it was calibrated");
      break;
    case Notice::Kind::overrun:
      say(Severity::warning, "overrun",
          "a cycle came " + milliseconds(notice.duration_ns) + " late, " + count +
              " periods skipped");
      break;
    case Notice::Kind::end_of_data:
      say(Severity::info, "end_of_data", "the source has no more data");
      break;
    case Notice::Kind::estimate_restarted:
      say(Severity::warning, "estimate_restarted", "the observer diverged and began anew");
      break;
    case Notice::Kind::model_broken:
      say(Severity::warning, "model_broken", observer::words_for(notice.verdict));
      break;
    case Notice::Kind::model_follows:
      say(Severity::info, "model_follows", "the rig follows its model again");
      break;
  }
  return out;
}

Event with_times(Event event, const ModelVerdict& verdict, std::int64_t utc_us) {
  constexpr std::int64_t us_per_s = 1'000'000;
  const std::int64_t since_us = utc_us - (verdict.reported_ns - verdict.since_ns) / 1000;
  const std::int64_t second = since_us / us_per_s % 86400;
  const auto seconds = [](std::int64_t time_ns) {
    const std::int64_t tenths = time_ns / 100'000'000;
    return std::to_string(tenths / 10) + '.' + std::to_string(std::abs(tenths % 10)) + " s";
  };
  std::array<char, 16> clock{};
  std::snprintf(clock.data(), clock.size(), "%02d:%02d:%02d", static_cast<int>(second / 3600),
                static_cast<int>(second / 60 % 60), static_cast<int>(second % 60));
  event.message += ", since " + std::string(clock.data()) + " UTC; diagnose the recording from " +
                   seconds(verdict.from_ns) + " to " + seconds(verdict.to_ns) + " of its time_ns";
  return event;
}

Event event_of(const Notice& sum, std::uint64_t notices) {
  Event out = event_of(sum);
  const std::string times = std::to_string(notices);
  const std::string count = std::to_string(sum.count);
  switch (sum.kind) {
    case Notice::Kind::frames_missing:
      out.message = "the source lost " + count + " frames more, in " + times + " gaps";
      break;
    case Notice::Kind::sequence_repeated:
      out.message = "the source's sequence number did not grow, " + times + " times more";
      break;
    case Notice::Kind::overrun:
      out.message = times + " cycles more came late, by up to " + milliseconds(sum.duration_ns) +
                    ", " + count + " periods skipped";
      break;
    case Notice::Kind::estimate_restarted:
      out.message += ", " + times + " times more";
      break;
    default:
      break;
  }
  return out;
}

}  // namespace stickslip::daemon
