// SPDX-License-Identifier: Apache-2.0
// A fault script: faults of a device and their times, injected to test the reaction of the daemon.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/names.h"

#include "physics/frame.h"

namespace stickslip::config {

/// Fault of a device; docs/faults.md describes each.
enum class FaultKind : std::uint8_t {
  noise,            ///< white noise is added to a channel
  stick,            ///< a channel keeps its value
  drift,            ///< a channel drifts
  delay,            ///< a channel is delayed
  drop,             ///< frames are lost
  duplicate,        ///< frames are duplicated
  reorder,          ///< frames swap places with their successors
  saturate,         ///< a channel's magnitude is limited
  nan,              ///< a channel is not a number
  clock_jump,       ///< the device's clock is ahead or behind
  unplug,           ///< the device is disconnected until it is reopened
  stall,            ///< no data arrives
  emergency_stop,   ///< the emergency stop is pressed
  amplifier_fault,  ///< the amplifier's own protection has tripped
  output_differs,   ///< the drive does not read back as commanded
  read_error,       ///< reads fail temporarily
  write_error,      ///< writes fail temporarily
};

template <>
inline constexpr auto names<FaultKind> = std::to_array<Name<FaultKind>>({
    {FaultKind::noise, "noise"},
    {FaultKind::stick, "stick"},
    {FaultKind::drift, "drift"},
    {FaultKind::delay, "delay"},
    {FaultKind::drop, "drop"},
    {FaultKind::duplicate, "duplicate"},
    {FaultKind::reorder, "reorder"},
    {FaultKind::saturate, "saturate"},
    {FaultKind::nan, "nan"},
    {FaultKind::clock_jump, "clock_jump"},
    {FaultKind::unplug, "unplug"},
    {FaultKind::stall, "stall"},
    {FaultKind::emergency_stop, "emergency_stop"},
    {FaultKind::amplifier_fault, "amplifier_fault"},
    {FaultKind::output_differs, "output_differs"},
    {FaultKind::read_error, "read_error"},
    {FaultKind::write_error, "write_error"},
});

inline constexpr std::size_t fault_kind_count = names<FaultKind>.size();

/// One [[fault]]: it begins at a time drawn between from_s and to_s and, with `every_s`, again
/// after each such period. Times are relative to the first frame.
struct Fault {
  FaultKind kind = FaultKind::noise;
  std::optional<Channel> channel;    ///< absent: all channels of the device
  double from_s = 0.0;               ///< 0 or more
  double to_s = 0.0;                 ///< from_s or more; equal: exactly then
  std::optional<double> duration_s;  ///< above 0; absent: to the end of the run
  std::optional<double> every_s;     ///< to_s - from_s + duration_s or more; absent: once
  double probability = 1.0;          ///< above 0 to 1; of each frame, read or write, by kind
  double amount = 0.0;               ///< unit and range by kind: fault_amount_keys()
  bool reported = false;             ///< delay: frames contain the age of the channel
  bool stall_blocking = false;       ///< stall: one read blocks for all of it

  friend bool operator==(const Fault&, const Fault&) = default;
};

/// A whole, consistent script. Without faults it has no effect.
struct FaultScript {
  std::filesystem::path file;
  std::string text;  ///< the file as read
  std::uint64_t seed = 1;
  std::vector<Fault> faults;
};

/// Reads a fault script. Throws InputError with every problem found, each with file, line, column.
FaultScript load_fault_script(const std::filesystem::path& file);

/// The same for text in memory; messages name the file as `name`.
FaultScript parse_fault_script(std::string_view text, const std::string& name);

/// Description of a fault: "noise on velocity, standard deviation 0.01: at 2 s for 3 s, every 10
/// s".
std::string in_words(const Fault& fault);

}  // namespace stickslip::config
