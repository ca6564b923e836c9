// SPDX-License-Identifier: Apache-2.0
#include "daemon/setting.h"

#include <cmath>

#include "config/demand.h"
#include "config/key.h"

namespace stickslip::daemon {
namespace {

using config::ExcitationKind;

constexpr Tunable all_tunables[] = {Tunable::carrier_hz, Tunable::amplitude, Tunable::modulation_hz,
                                    Tunable::modulation_depth};

std::optional<config::Excess> excess_with(const config::Excitation& excitation,
                                          const SettingBounds& bounds, const Setting& setting) {
  config::Demand demand = config::demand_of(with_setting(excitation, setting));
  demand.displacement *= bounds.control_gain;
  demand.velocity *= bounds.control_gain;
  demand.acceleration *= bounds.control_gain;
  return config::excess_of(demand, bounds.limits, bounds.force);
}

/// By bisection: the demand grows with every parameter.
double largest_allowed(const config::Excitation& excitation, const SettingBounds& bounds,
                       const Setting& setting) {
  double low = 0.0;
  double high = setting.value;
  for (int i = 0; i < 50; ++i) {
    const double middle = (low + high) / 2.0;
    (excess_with(excitation, bounds, {setting.tunable, middle}) ? high : low) = middle;
  }
  // Rounded down, so that the reported value is allowed.
  if (low <= 0.0) return 0.0;
  const double digit = std::pow(10.0, std::floor(std::log10(low)) - 3.0);
  return std::floor(low / digit) * digit;
}

}  // namespace

const char* name_of(Tunable tunable) {
  switch (tunable) {
    case Tunable::carrier_hz:
      return "carrier_hz";
    case Tunable::amplitude:
      return "amplitude";
    case Tunable::modulation_hz:
      return "modulation_hz";
    case Tunable::modulation_depth:
      return "modulation_depth";
  }
  return "";
}

std::optional<Tunable> tunable_named(std::string_view name) {
  for (const Tunable tunable : all_tunables) {
    if (name == name_of(tunable)) return tunable;
  }
  return std::nullopt;
}

bool has_tunable(const config::Excitation& excitation, Tunable tunable) {
  const ExcitationKind kind = excitation.kind;
  const bool envelope = !excitation.envelope.empty();
  switch (tunable) {
    case Tunable::carrier_hz:
      return kind == ExcitationKind::modulated || kind == ExcitationKind::by_hand;
    case Tunable::amplitude:
      return kind != ExcitationKind::file && !envelope && excitation.multisine.lines.empty();
    case Tunable::modulation_hz:
    case Tunable::modulation_depth:
      return kind == ExcitationKind::modulated && !envelope;
  }
  return false;
}

config::Excitation with_setting(config::Excitation excitation, const Setting& setting) {
  switch (setting.tunable) {
    case Tunable::carrier_hz:
      excitation.carrier_hz = setting.value;
      break;
    case Tunable::amplitude:
      excitation.amplitude = setting.value;
      break;
    case Tunable::modulation_hz:
      excitation.modulation_hz = setting.value;
      break;
    case Tunable::modulation_depth:
      excitation.modulation_depth = setting.value;
      break;
  }
  return excitation;
}

std::optional<std::string> refusal(const config::Excitation& excitation,
                                   const SettingBounds& bounds, const Setting& setting) {
  const std::string name = name_of(setting.tunable);
  const std::string asked = name + " = " + config::short_number(setting.value);
  if (!has_tunable(excitation, setting.tunable)) {
    return name + " cannot be set: the excitation's kind is \"" +
           std::string(config::name_of(excitation.kind)) + "\"" +
           (excitation.envelope.empty() ? "" : " with an envelope");
  }
  const config::Key& key = *config::find_key(config::rig_keys(), "excitation." + name);
  const bool in_range = std::isfinite(setting.value) &&
                        (key.above_low ? setting.value > key.low : setting.value >= key.low) &&
                        setting.value <= key.high;
  if (!in_range) return asked + ": expected " + config::expectation(key);
  if (setting.tunable == Tunable::carrier_hz && setting.value > bounds.rate_hz / 4.0) {
    return asked + " is more than a quarter of loop.rate_hz: at most " +
           config::short_number(bounds.rate_hz / 4.0);
  }
  if (setting.tunable == Tunable::amplitude && excitation.kind == ExcitationKind::by_hand &&
      setting.value < excitation.by_hand.lowest) {
    return asked + " is below excitation.by_hand.lowest: at least " +
           config::short_number(excitation.by_hand.lowest);
  }
  if (const auto excess = excess_with(excitation, bounds, setting)) {
    return asked + " requires " + config::text_of(*excess) + ": at most " +
           config::short_number(largest_allowed(excitation, bounds, setting));
  }
  return std::nullopt;
}

}  // namespace stickslip::daemon
