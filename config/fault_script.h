// A fault script: what befalls a device, and when, so that what the daemon makes of it can be seen.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"

namespace stickslip::config {

/// What befalls a device; docs/faults.md says what each does. In the order of the key's choices.
enum class FaultKind : std::uint8_t {
  noise,            ///< white noise is added to a channel
  stick,            ///< a channel keeps the value that it had when it began
  drift,            ///< a channel walks away
  delay,            ///< a channel shows what it was some time ago
  drop,             ///< frames are lost
  duplicate,        ///< frames come twice
  reorder,          ///< frames change places with their successors
  saturate,         ///< a channel's magnitude is limited
  nan,              ///< a channel is not a number
  clock_jump,       ///< the device's clock is ahead or behind
  unplug,           ///< the device is gone, until it is opened again
  stall,            ///< no data comes
  emergency_stop,   ///< the emergency stop is pressed
  amplifier_fault,  ///< the amplifier's own protection has tripped
  read_error,       ///< reads fail, but might work the next time
  write_error,      ///< writes fail, but might work the next time
};

inline constexpr std::size_t fault_kind_count = 16;

/// One [[fault]]: it begins at a moment drawn from from_s to to_s and, where `every_s` says so,
/// from each such span again, every_s later. Times are of the script: 0 at the first frame.
struct Fault {
  FaultKind kind = FaultKind::noise;
  std::optional<Channel> channel;    ///< absent: all that the device yields
  double from_s = 0.0;               ///< 0 or more
  double to_s = 0.0;                 ///< from_s or more; equal: at that moment
  std::optional<double> duration_s;  ///< above 0; absent: to the end of the run
  std::optional<double> every_s;     ///< to_s - from_s + duration_s or more; absent: once
  double probability = 1.0;          ///< above 0 to 1; of each frame, read or write, by kind
  double amount = 0.0;               ///< unit and range by kind: fault_amount_keys()
  bool reported = false;             ///< delay: frames carry the age of the channel
  bool stall_blocking = false;       ///< stall: one read takes all of it

  friend bool operator==(const Fault&, const Fault&) = default;
};

/// A whole script, sound in itself. Without a fault it changes nothing.
struct FaultScript {
  std::filesystem::path file;
  std::string text;  ///< the file as read
  std::uint64_t seed = 1;
  std::vector<Fault> faults;
};

/// Reads a fault script. Throws InputError with every problem that was found, each with file, line
/// and column.
FaultScript load_fault_script(const std::filesystem::path& file);

/// The same for text in memory; `name` stands for the file in messages.
FaultScript parse_fault_script(std::string_view text, const std::string& name);

/// A fault in words: "noise on velocity, standard deviation 0.01: at 2 s for 3 s, every 10 s".
std::string in_words(const Fault& fault);

}  // namespace stickslip::config
