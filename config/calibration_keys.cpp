// SPDX-License-Identifier: Apache-2.0
// Keys of a calibration file.
#include <array>

#include "config/key_binding.h"

namespace stickslip::config {

namespace {

constexpr std::array file_table = {
    schema_key<CalibrationFile>(),
    bound<&CalibrationFile::channel, by_channel>(
        Key{.path = "channel.*",
            .sentence = "The current calibration of the channel.",
            .without = "raw is SI"}),
    bound<&CalibrationFile::history>(Key{
        .path = "history",
        .sentence =
            "One [[history]] table for each previous calibration, newest first for each channel.",
        .without = "none"}),
};

/// Keys of one channel's calibration, which `Prefix` leads to.
template <auto... Prefix>
constexpr auto calibration_table = std::array{
    bound<Prefix..., &ChannelCalibration::offset>(
        Key{.path = "offset",
            .unit = "raw",
            .sentence = "SI = (raw - offset) gain, less the crosstalk from other channels.",
            .need = Need::always}),
    bound<Prefix..., &ChannelCalibration::gain>(Key{.path = "gain",
                                                    .unit = "SI/raw",
                                                    .sentence = "SI = (raw - offset) gain; not 0.",
                                                    .need = Need::always}),
    bound<Prefix..., &ChannelCalibration::covariance>(
        Key{.path = "covariance",
            .unit = "raw^2, SI, (SI/raw)^2",
            .sentence = "Variance of the offset, covariance of both, variance of the gain.",
            .without = "unknown"}),
    bound<Prefix..., &ChannelCalibration::residual_std>(
        Key{.path = "residual_std",
            .unit = "SI",
            .sentence = "Standard deviation of the points about the line.",
            .low = 0}),
    bound<Prefix..., &ChannelCalibration::crosstalk>(
        Key{.path = "crosstalk",
            .unit = "SI/SI",
            .sentence = "Share of other channels' SI values in this reading, which is subtracted.",
            .without = "none"}),
    bound<Prefix..., &ChannelCalibration::valid>(
        Key{.path = "valid_range",
            .unit = "SI",
            .sentence = "Range of the calibration; values outside are marked, and kept.",
            .without = "unlimited"}),
    bound<Prefix..., &ChannelCalibration::raw_unit>(
        Key{.path = "raw_unit",
            .sentence = "Unit of the readings, as the driver names it.",
            .without = "unknown"}),
    of_type(Type::date,
            bound<Prefix..., &ChannelCalibration::date>(
                Key{.path = "date", .sentence = "Date of the calibration.", .need = Need::always})),
    bound<Prefix..., &ChannelCalibration::reference>(
        Key{.path = "reference",
            .sentence = "Reference standard: \"weights set 12, class M1\".",
            .need = Need::always}),
    bound<Prefix..., &ChannelCalibration::by>(
        Key{.path = "by", .sentence = "Person who calibrated.", .without = "unknown"}),
    bound<Prefix..., &ChannelCalibration::despite>(
        Key{.path = "despite",
            .sentence = "Failed checks of the fit that were overridden.",
            .without = "none"}),
    bound<Prefix..., &ChannelCalibration::points>(
        Key{.path = "point",
            .sentence = "The points of the calibration, in the order of measurement.",
            .without = "unknown",
            .header = "...point"}),
};

/// Key of a former calibration on its channel.
constexpr std::array former_table = {
    bound<&FormerCalibration::channel>(
        Key{.path = "channel", .sentence = "The channel.", .need = Need::always}),
};

constexpr std::array point_table = {
    bound<&CalibrationPoint::raw>(
        Key{.path = "raw", .unit = "raw", .sentence = "Mean reading.", .need = Need::always}),
    bound<&CalibrationPoint::raw_std>(Key{.path = "raw_std",
                                          .unit = "raw",
                                          .sentence = "Standard deviation of that mean.",
                                          .without = "0: unknown",
                                          .low = 0}),
    bound<&CalibrationPoint::reference_si>(Key{.path = "reference_si",
                                               .unit = "SI",
                                               .sentence = "Reference value.",
                                               .need = Need::always}),
    bound<&CalibrationPoint::reference_sigma>(
        Key{.path = "reference_sigma",
            .unit = "SI",
            .sentence = "Standard uncertainty of the reference value.",
            .low = 0}),
};

}  // namespace

template <>
std::span<const Key> keys_of<CalibrationFile>() {
  static const std::vector<Key> keys = joined<CalibrationFile>({file_table});
  return keys;
}

template <>
std::span<const Key> keys_of<ChannelCalibration>() {
  static const std::vector<Key> keys = joined<ChannelCalibration>({calibration_table<>});
  return keys;
}

template <>
std::span<const Key> keys_of<FormerCalibration>() {
  static const std::vector<Key> keys =
      joined<FormerCalibration>({former_table, calibration_table<&FormerCalibration::calibration>});
  return keys;
}

template <>
std::span<const Key> keys_of<CalibrationPoint>() {
  static const std::vector<Key> keys = joined<CalibrationPoint>({point_table});
  return keys;
}

}  // namespace stickslip::config
