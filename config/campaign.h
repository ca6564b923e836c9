// SPDX-License-Identifier: Apache-2.0
// The file of a campaign: recordings of one rig with their conditions, and how the numbers of its
// model are shared among them.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/campaign.h"
#include "physics/model.h"

namespace stickslip::config {

/// One [[recording]], as written.
struct CampaignRecording {
  std::string name;
  std::filesystem::path file;
  std::map<std::string, double> conditions;
  std::map<std::string, double> set;
  std::string material;
  std::string drive;
  std::string comment;
  bool held_out = false;
};

struct CampaignFile {
  std::filesystem::path model;  ///< empty: not named
  std::vector<CampaignRecording> recordings;
  std::vector<physics::SharedNumber> numbers;
};

/// A campaign with its model, consistent with each other.
struct LoadedCampaign {
  physics::Campaign campaign;
  std::vector<std::filesystem::path> recordings;  ///< in the order of the runs
  std::filesystem::path model_file;
  physics::Model model;
};

/// Reads a campaign. `model`: used in place of the one that the file names. Throws InputError with
/// every problem found, each with file, line and column.
LoadedCampaign load_campaign(const std::filesystem::path& file,
                             const std::optional<std::filesystem::path>& model = std::nullopt);

/// The file alone, without its model and recordings; messages name it as `name`.
CampaignFile parse_campaign(std::string_view text, const std::string& name);

/// Leaves every window of the recording of that name for the report. Throws InputError, with the
/// names that there are, for any other name.
void hold_out(physics::Campaign& campaign, const std::string& name, const std::string& file);

}  // namespace stickslip::config
