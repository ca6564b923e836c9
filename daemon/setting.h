// SPDX-License-Identifier: Apache-2.0
// Parameters of the excitation that can be changed while it runs, and the check of a change.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "config/rig.h"

namespace stickslip::daemon {

enum class Tunable : std::uint8_t { carrier_hz, amplitude, modulation_hz, modulation_depth };

/// The parameter's key in [excitation], and back.
const char* name_of(Tunable tunable);
std::optional<Tunable> tunable_named(std::string_view name);

/// A new value of a parameter; trivially copyable, to pass through a ring.
struct Setting {
  Tunable tunable = Tunable::amplitude;
  double value = 0.0;  ///< in the unit of the key
};

/// True if the excitation has that parameter.
bool has_tunable(const config::Excitation& excitation, Tunable tunable);

/// The excitation after the setting.
config::Excitation with_setting(config::Excitation excitation, const Setting& setting);

/// Properties of the rig that bound a setting.
struct SettingBounds {
  config::Limits limits{};
  bool force = false;         ///< a force drives the rig
  double rate_hz = 1000.0;    ///< of the loop
  double control_gain = 1.0;  ///< present gain of the amplitude control
};

/// Why the setting is refused, in one sentence with the limit and the largest allowed value;
/// nothing if it is allowed. `excitation`: with all earlier settings. Not for the real-time thread.
std::optional<std::string> refusal(const config::Excitation& excitation,
                                   const SettingBounds& bounds, const Setting& setting);

}  // namespace stickslip::daemon
