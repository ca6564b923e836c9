// SPDX-License-Identifier: Apache-2.0
// Campaigns for a blind examination: recordings of one rig in which an effect shows only in their
// comparison.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/campaign.h"
#include "physics/model.h"
#include "protocol/recording.h"
#include "tools/concealment/ground_truth.h"

namespace stickslip::concealment {

enum class CampaignEffect {
  load_dependent_mu,  ///< the coefficient of friction changes with the load, which differs
  run_drift,          ///< a number changes from run to run
  amplitude_damping,  ///< damping grows with the amplitude, which differs
  faulty_channel,     ///< the gain of a channel is off in one run
};
inline constexpr std::array all_campaign_effects = {
    CampaignEffect::load_dependent_mu, CampaignEffect::run_drift, CampaignEffect::amplitude_damping,
    CampaignEffect::faulty_channel};
std::string_view name_of(CampaignEffect effect);

struct CampaignCase {
  GroundTruth truth;
  physics::Model declared;
  physics::Campaign campaign;
  std::vector<protocol::Recording> recordings;
};

/// Four runs of a force-excited rig of `duration_s` each. The declared model allows for the effect
/// in every single run, by the standard deviations of its numbers. The same arguments give the same
/// campaign. Throws Failure if none of 40 benches moves plausibly.
CampaignCase conceal_campaign(const std::optional<CampaignEffect>& effect, double duration_s,
                              std::uint64_t seed, const std::string& name);

/// campaign.toml: the recordings are run-1/recording.csv and so on.
std::string campaign_text(const CampaignCase& made);

}  // namespace stickslip::concealment
