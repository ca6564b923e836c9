// SPDX-License-Identifier: Apache-2.0
// One sample of a rig. Drivers, calibration, observer, telemetry and recordings share this struct.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace stickslip {

/// The quantities that a rig can measure. The first five are the paper's channels (section 3.1);
/// `drive_force` stands for the base motion on force-excited rigs.
enum class Channel : std::uint8_t {
  displacement,       ///< x, deflection of the mass relative to the moving frame [m]
  velocity,           ///< x', from the analogue differentiator [m/s]
  friction_force,     ///< load-cell force k_l y, before Eq. (1) of the paper [N]
  normal_load,        ///< N, summed over both pads [N]
  base_displacement,  ///< b, displacement of the frame (LVDT) [m]
  drive_force,        ///< F on the mass, force-excited rigs only [N]
};

inline constexpr std::size_t channel_count = 6;

inline constexpr std::array<Channel, channel_count> all_channels = {
    Channel::displacement, Channel::velocity,          Channel::friction_force,
    Channel::normal_load,  Channel::base_displacement, Channel::drive_force};

/// The names of a channel: `stem` in reports and models, `column` in recordings (stem and unit).
struct ChannelInfo {
  std::string_view stem;
  std::string_view column;
  std::string_view unit;
};

inline constexpr std::array<ChannelInfo, channel_count> channel_table = {{
    {"displacement", "displacement_m", "m"},
    {"velocity", "velocity_m_s", "m/s"},
    {"friction_force", "friction_force_n", "N"},
    {"normal_load", "normal_load_n", "N"},
    {"base_displacement", "base_displacement_m", "m"},
    {"drive_force", "drive_force_n", "N"},
}};

constexpr std::size_t index_of(Channel channel) { return static_cast<std::size_t>(channel); }

constexpr const ChannelInfo& info(Channel channel) { return channel_table[index_of(channel)]; }

/// The channel of that stem or column name, if there is one.
constexpr std::optional<Channel> channel_named(std::string_view name) {
  for (Channel channel : all_channels) {
    if (info(channel).stem == name || info(channel).column == name) return channel;
  }
  return std::nullopt;
}

/// One sample. A channel that was not measured, or whose value is implausible, has its validity bit
/// clear and its value 0; a frame does not contain NaN.
struct Frame {
  std::int64_t time_ns = 0;    ///< time of measurement; monotonic, the source chooses the origin
  std::uint64_t sequence = 0;  ///< counts frames at the source; a jump is a loss
  std::array<double, channel_count> value{};  ///< by Channel; SI after calibration
  std::uint8_t valid = 0;                     ///< bit i: channel i holds a measurement
  /// Time from the measurement of a channel to time_ns [us]; 0 where sampled with the frame.
  std::array<std::int32_t, channel_count> age_us{};

  constexpr double operator[](Channel channel) const { return value[index_of(channel)]; }
  constexpr bool has(Channel channel) const { return ((valid >> index_of(channel)) & 1U) != 0; }
  constexpr void set(Channel channel, double v) {
    value[index_of(channel)] = v;
    valid = static_cast<std::uint8_t>(valid | (1U << index_of(channel)));
  }
  constexpr void invalidate(Channel channel) {
    value[index_of(channel)] = 0.0;
    age_us[index_of(channel)] = 0;
    valid = static_cast<std::uint8_t>(valid & ~(1U << index_of(channel)));
  }
  constexpr double time_s() const { return static_cast<double>(time_ns) * 1e-9; }

  friend constexpr bool operator==(const Frame&, const Frame&) = default;
};

}  // namespace stickslip
