// SPDX-License-Identifier: Apache-2.0
#include "daemon/rig_description.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "config/model_names.h"
#include "config/names.h"
#include "physics/frame.h"

namespace stickslip::daemon {

namespace {

using nlohmann::json;

json ranges_of(const config::Safety& safety) {
  json out = json::object();
  for (const Channel channel : all_channels) {
    const config::ChannelRange& range = safety.range[index_of(channel)];
    json each = json::object();
    if (std::isfinite(range.low)) each["low"] = range.low;
    if (std::isfinite(range.high)) each["high"] = range.high;
    if (!each.empty()) out[std::string(info(channel).stem)] = each;
  }
  return out;
}

}  // namespace

json description_of(const config::Rig& rig) {
  const config::Limits& limits = rig.limits;
  return {{"name", rig.name},
          {"simulated", rig.driver == config::DriverKind::simulated},
          {"rate_hz", rig.loop.rate_hz},
          {"drive", config::name_of(rig.model.oscillator.excitation)},
          {"limits",
           {{"displacement_m", limits.displacement_m},
            {"velocity_m_s", limits.velocity_m_s},
            {"acceleration_m_s2", limits.acceleration_m_s2},
            {"force_n", limits.force_n},
            {"force_slew_n_s", limits.force_slew_n_s}}},
          {"ranges", ranges_of(rig.safety)},
          {"lcm_url", rig.lcm.enabled ? rig.lcm.url : std::string()},
          {"model", rig.model_text}};
}

}  // namespace stickslip::daemon
