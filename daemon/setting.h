// What can be turned while the rig runs, and whether it may be turned that far.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "config/rig.h"

namespace stickslip::daemon {

enum class Knob : std::uint8_t { carrier_hz, amplitude, modulation_hz, modulation_depth };

/// The knob's key in [excitation], and back.
const char* name_of(Knob knob);
std::optional<Knob> knob_named(std::string_view name);

/// One turn of a knob; trivially copyable, to travel through a ring.
struct Setting {
  Knob knob = Knob::amplitude;
  double value = 0.0;  ///< in the unit of the key
};

/// Whether a setting means anything to that excitation.
bool has_knob(const config::Excitation& excitation, Knob knob);

/// The excitation after the setting.
config::Excitation with_setting(config::Excitation excitation, const Setting& setting);

/// The rig around an excitation, as far as settings depend on it.
struct SettingBounds {
  config::Limits limits{};
  bool force = false;         ///< a force drives the rig
  double rate_hz = 1000.0;    ///< of the loop
  double control_gain = 1.0;  ///< what the amplitude control multiplies the drive with just now
};

/// Why the setting is refused, in one sentence that names the limit and the largest value that
/// would do; nothing where it may be made. `excitation` is as last set. Not for the hot path.
std::optional<std::string> refusal(const config::Excitation& excitation,
                                   const SettingBounds& bounds, const Setting& setting);

}  // namespace stickslip::daemon
