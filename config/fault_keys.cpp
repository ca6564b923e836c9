// SPDX-License-Identifier: Apache-2.0
// Keys of a fault script.
#include <array>

#include "config/key_binding.h"

namespace stickslip::config {

namespace {

constexpr double longest_script_s = 1.0e7;

void read_moment(Fault& fault, std::size_t, const Value& value) {
  fault.from_s = value.number();
  fault.to_s = fault.from_s;
}

void read_interval(Fault& fault, std::size_t, const Value& value) {
  fault.from_s = value.elements().at(0).number();
  fault.to_s = value.elements().at(1).number();
}

constexpr std::array script_table = {
    schema_key<FaultScript>(),
    bound<&FaultScript::seed>(Key{
        .path = "seed",
        .unit = "1",
        .sentence = "Seed of all random choices; the same seed and frames give the same faults.",
        .low = 0,
        .high = 9.0e15}),
    bound<&FaultScript::faults>(Key{.path = "fault",
                                    .sentence = "One [[fault]] table for each fault, 256 at most.",
                                    .without = "none"}),
};

constexpr std::array fault_table = {
    bound<&Fault::kind>(Key{.path = "kind", .sentence = "Kind of fault.", .need = Need::always}),
    bound<&Fault::channel>(
        Key{.path = "channel",
            .sentence = "The affected channel; noise, stick, drift, delay, saturate, nan only.",
            .without = "all channels of the device",
            .when = "kind=noise|stick|drift|delay|saturate|nan",
            .only_then = true}),
    read_by<Fault, read_moment>(Type::number,
                                Key{.path = "at_s",
                                    .unit = "s",
                                    .sentence = "Start, from the first frame; or between_s.",
                                    .low = 0,
                                    .high = longest_script_s}),
    read_by<Fault, read_interval>(
        Type::span,
        Key{.path = "between_s",
            .unit = "s",
            .sentence = "Limits of a random beginning, drawn again for each repetition; or at_s.",
            .low = 0,
            .high = longest_script_s}),
    bound<&Fault::duration_s>(
        Key{.path = "duration_s",
            .unit = "s",
            .sentence = "Duration; that of a stall is its amount.",
            .without = "to the end of the run",
            .when = "kind=noise|stick|drift|delay|drop|duplicate|reorder|saturate|nan|clock_jump|"
                    "unplug|emergency_stop|amplifier_fault|output_differs|"
                    "read_error|write_error",
            .only_then = true,
            .low = 0,
            .high = longest_script_s,
            .above_low = true}),
    bound<&Fault::every_s>(Key{.path = "every_s",
                               .unit = "s",
                               .sentence = "Period of repetition; needs a duration that fits.",
                               .without = "once",
                               .low = 1.0e-6,
                               .high = longest_script_s}),
    bound<&Fault::probability>(Key{
        .path = "probability",
        .unit = "1",
        .sentence =
            "Probability for each frame (read_error: each read, write_error: each write) during "
            "the fault; noise, nan, drop, duplicate, reorder, read_error, write_error only.",
        .when = "kind=noise|nan|drop|duplicate|reorder|read_error|write_error",
        .only_then = true,
        .low = 0,
        .high = 1,
        .above_low = true}),
    bound<&Fault::amount>(Key{.path = "amount",
                              .unit = "its kind's",
                              .sentence = "Size of the fault, by kind, as below.",
                              .need = Need::always,
                              .when = "kind=noise|drift|delay|saturate|clock_jump|stall",
                              .only_then = true}),
    bound<&Fault::reported>(
        Key{.path = "reported",
            .sentence = "delay only: true if the frame contains the channel's age.",
            .when = "kind=delay",
            .only_then = true}),
    bound<&Fault::stall_blocking>(Key{.path = "stall_blocking",
                                      .sentence = "stall only: true if one read blocks for all "
                                                  "that time, instead of many that return nothing.",
                                      .when = "kind=stall",
                                      .only_then = true}),
};

constexpr std::array fault_amount_table = {
    Key{.path = "noise",
        .unit = "the channel's",
        .sentence = "Standard deviation of the white noise.",
        .need = Need::always,
        .low = 0,
        .above_low = true},
    Key{.path = "drift",
        .unit = "the channel's, per s",
        .sentence = "Rate of the drift, which begins at 0; not 0.",
        .need = Need::always},
    Key{.path = "delay",
        .unit = "s",
        .sentence = "Age of the reading.",
        .need = Need::always,
        .low = 0,
        .high = 10,
        .above_low = true},
    Key{.path = "saturate",
        .unit = "the channel's",
        .sentence = "Largest magnitude of the reading.",
        .need = Need::always,
        .low = 0,
        .above_low = true},
    Key{.path = "clock_jump",
        .unit = "s",
        .sentence = "Error of the device's clock; positive: ahead; not 0.",
        .need = Need::always,
        .low = -1.0e6,
        .high = 1.0e6},
    Key{.path = "stall",
        .unit = "s",
        .sentence = "Time without data.",
        .need = Need::always,
        .low = 0,
        .high = 3600,
        .above_low = true},
};

}  // namespace

template <>
std::span<const Key> keys_of<FaultScript>() {
  static const std::vector<Key> keys = joined<FaultScript>({script_table});
  return keys;
}

template <>
std::span<const Key> keys_of<Fault>() {
  static const std::vector<Key> keys = joined<Fault>({fault_table});
  return keys;
}

std::span<const Key> fault_amount_keys() { return fault_amount_table; }

std::vector<Key> fault_keys_of(std::string_view kind) {
  const auto all = keys_of<Fault>();
  std::vector<Key> keys(all.begin(), all.end());
  const Key* amount = find_key(fault_amount_table, kind);
  if (amount == nullptr) return keys;
  for (Key& key : keys) {
    if (key.path != "amount") continue;
    key.unit = amount->unit;
    key.sentence = amount->sentence;
    key.low = amount->low;
    key.high = amount->high;
    key.above_low = amount->above_low;
  }
  return keys;
}

}  // namespace stickslip::config
