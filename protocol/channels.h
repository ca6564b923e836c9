// SPDX-License-Identifier: Apache-2.0
// The LCM channels of a rig: names, types and rates.
#pragma once

#include <array>
#include <string_view>

namespace stickslip::protocol {

inline constexpr const char* frames_channel = "STICKSLIP_FRAMES";
inline constexpr const char* estimate_channel = "STICKSLIP_ESTIMATE";
inline constexpr const char* excitation_channel = "STICKSLIP_EXCITATION";
inline constexpr const char* status_channel = "STICKSLIP_STATUS";
inline constexpr const char* timing_channel = "STICKSLIP_TIMING";
inline constexpr const char* event_channel = "STICKSLIP_EVENT";
inline constexpr const char* recording_channel = "STICKSLIP_RECORDING";
inline constexpr const char* recorder_channel = "STICKSLIP_RECORDER";

/// Code of the event that the rig's model was changed while it runs.
inline constexpr const char* model_changed_code = "model_changed";

/// Default provider of the tools and the daemon: LCM's own group, on this host only.
inline constexpr const char* default_url = "udpm://239.255.76.67:7667?ttl=0";

struct LcmChannel {
  std::string_view name;
  std::string_view type;
  std::string_view rate;
};

inline constexpr std::array<LcmChannel, 8> lcm_channels = {{
    {frames_channel, "frame_block_t", "one per block of frames"},
    {estimate_channel, "friction_estimate_t", "one per block, after its last frame"},
    {excitation_channel, "excitation_t", "every 0.1 s, of all frames since"},
    {status_channel, "status_t", "once a second and at the end"},
    {timing_channel, "timing_t", "once a second"},
    {event_channel, "event_t", "at each event"},
    {recording_channel, "recording_info_t", "at the start and every 2 s"},
    {recorder_channel, "recorder_t", "once a second, of a daemon that records"},
}};

}  // namespace stickslip::protocol
