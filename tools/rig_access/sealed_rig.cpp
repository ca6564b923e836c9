// SPDX-License-Identifier: Apache-2.0
#include "tools/rig_access/sealed_rig.h"

#include <algorithm>
#include <cmath>

#include "config/rig.h"
#include "protocol/recording.h"
#include "tools/files/read_file.h"
#include "tools/rig_access/simulated_rig.h"

namespace stickslip::rig_access {

namespace {

double share_of_range(double reading, double low, double high) {
  if (reading > 0.0) return std::isfinite(high) ? reading / high : 0.0;
  return std::isfinite(low) && low < 0.0 ? reading / low : 0.0;
}

}  // namespace

double used_share(const protocol::Recording& recording, const investigation::RigFacts& facts) {
  const Channel drive = facts.force ? Channel::drive_force : Channel::base_displacement;
  double out = 0.0;
  for (const Frame& frame : recording.frames) {
    for (const Channel channel : all_channels) {
      if (!frame.has(channel)) continue;
      const std::size_t c = index_of(channel);
      out =
          std::max(out, share_of_range(frame[channel], facts.ranges.low[c], facts.ranges.high[c]));
      if (channel == drive) out = std::max(out, std::abs(frame[channel]) / facts.limits.value);
    }
  }
  return out;
}

SealedStudy study_of_sealed_rig(const std::filesystem::path& rig_file,
                                const std::filesystem::path& model_file,
                                const std::filesystem::path& folder,
                                const investigation::StudySettings& settings,
                                const investigation::InvestigationOptions& options) {
  if (std::filesystem::exists(investigation::json_file(folder))) {
    std::filesystem::remove_all(folder);
  }
  SimulatedRig rig(config::load_rig(rig_file));
  const investigation::Dialogue unattended{
      .show = [](const std::string&) {}, .confirm = [] { return true; }, .progress = {}};
  SealedStudy out;
  out.study = investigation::investigate(
      investigation::opened(folder, files::content_of(model_file), rig.facts(), settings), folder,
      rig, unattended, options);
  for (const investigation::Step& step : out.study.steps) {
    const auto recording = protocol::read_recording(investigation::recording_file(folder, step));
    out.used_share = std::max(out.used_share, used_share(recording, rig.facts()));
  }
  return out;
}

}  // namespace stickslip::rig_access
