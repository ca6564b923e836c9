// SPDX-License-Identifier: Apache-2.0
// Keys of a campaign.
#include <array>

#include "config/key_binding.h"

namespace stickslip::config {

namespace {

using physics::SharedNumber;

constexpr std::array campaign_table = {
    schema_key<CampaignFile>(),
    bound<&CampaignFile::model>(
        Key{.path = "model", .sentence = "Model of the rig.", .without = "that of `--model`"}),
    bound<&CampaignFile::recordings>(Key{.path = "recording",
                                         .sentence = "One [[recording]] table for each, 2 to 100.",
                                         .need = Need::always,
                                         .most = 100}),
    bound<&CampaignFile::numbers>(
        Key{.path = "number",
            .sentence = "One [[number]] table for each number that is not simply common to all.",
            .without = "zeros of sensors are each recording's own, all else is common"}),
};

constexpr std::array recording_table = {
    bound<&CampaignRecording::name>(
        Key{.path = "name", .sentence = "Its name in reports.", .need = Need::always}),
    bound<&CampaignRecording::file>(
        Key{.path = "file", .sentence = "The recording.", .need = Need::always}),
    bound<&CampaignRecording::conditions>(Key{
        .path = "conditions",
        .sentence = "Conditions by name, which numbers may follow; `load_n` is also the model's "
                    "normal load in this recording, where it has one.",
        .without = "none"}),
    bound<&CampaignRecording::set>(
        Key{.path = "set",
            .sentence = "Numbers of the model that differ in this recording, by their paths.",
            .without = "none"}),
    bound<&CampaignRecording::material>(
        Key{.path = "material", .sentence = "Materials in contact.", .without = "not stated"}),
    bound<&CampaignRecording::drive>(
        Key{.path = "drive", .sentence = "The excitation, in words.", .without = "not stated"}),
    bound<&CampaignRecording::comment>(
        Key{.path = "comment", .sentence = "Anything else.", .without = "none"}),
    bound<&CampaignRecording::held_out>(
        Key{.path = "held_out",
            .sentence = "True: nothing is fitted to this recording; the result predicts it."}),
};

constexpr std::array number_table = {
    bound<&SharedNumber::path>(
        Key{.path = "path",
            .sentence = "Path of the number in the model, or of one of an effect that may be found "
                        "missing, as in \"physics.dry_friction.friction_force_n\".",
            .need = Need::always}),
    bound<&SharedNumber::sharing>(Key{
        .path = "sharing",
        .sentence = "common: one value. own: one in each recording. varies: one in each "
                    "recording, from a normal distribution. proportional: a coefficient times "
                    "the condition. power: changes with the logarithm of the condition. linear: "
                    "changes with the condition.",
        .need = Need::always}),
    bound<&SharedNumber::condition>(
        Key{.path = "condition",
            .sentence = "The condition that it follows; with own and varies, its coefficient does.",
            .need = Need::always,
            .without = "none",
            .when = "sharing=proportional|power|linear"}),
};

}  // namespace

template <>
std::span<const Key> keys_of<CampaignFile>() {
  static const std::vector<Key> keys = joined<CampaignFile>({campaign_table});
  return keys;
}

template <>
std::span<const Key> keys_of<CampaignRecording>() {
  static const std::vector<Key> keys = joined<CampaignRecording>({recording_table});
  return keys;
}

template <>
std::span<const Key> keys_of<SharedNumber>() {
  static const std::vector<Key> keys = joined<SharedNumber>({number_table});
  return keys;
}

}  // namespace stickslip::config
