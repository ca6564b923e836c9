// SPDX-License-Identifier: Apache-2.0
#include "config/named_files.h"

#include <system_error>

#include "config/campaign.h"
#include "config/document.h"
#include "config/key.h"
#include "config/rig.h"
#include "config/same_file.h"

namespace stickslip::config {

std::vector<NamedFile> named_files(const Rig& rig) {
  const Document document(rig.text, rig.file.string(), rig_keys());
  std::vector<NamedFile> out = document.named_files();
  out.insert(out.begin(), NamedFile{"", rig.file, false});
  return out;
}

namespace {

std::vector<std::filesystem::path> files_of_campaign(const std::string& text,
                                                     const std::string& name) {
  const CampaignFile campaign = parse_campaign(text, name);
  std::vector<std::filesystem::path> out;
  if (!campaign.model.empty()) out.push_back(campaign.model);
  for (const CampaignRecording& each : campaign.recordings) out.push_back(each.file);
  return out;
}

}  // namespace

std::vector<std::filesystem::path> files_read_with(const std::filesystem::path& file) {
  std::vector<std::filesystem::path> out;
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return out;
  try {
    const std::string text = read_text(file);
    if (kind_of(text) == FileKind::campaign) return files_of_campaign(text, file.string());
    if (kind_of(text) != FileKind::rig) return out;
    const Document document(text, file.string(), rig_keys());
    for (NamedFile& each : document.named_files()) {
      if (!each.written) out.push_back(std::move(each.file));
    }
  } catch (const InputError&) {
    // Unreadable, or too large for a configuration: the command that reads it reports it.
  }
  return out;
}

std::string wrong_with_output(const Rig& rig, std::string_view key,
                              const std::filesystem::path& file) {
  for (const NamedFile& each : named_files(rig)) {
    if (each.key == key || each.file.empty() || !is_same_file(file, each.file)) continue;
    const std::string other =
        file == each.file ? "is" : "is the same file as " + each.file.string() + ",";
    return other + ' ' +
           (each.key.empty() ? std::string("this configuration")
                             : (each.written ? "what " : "read as ") + each.key +
                                   (each.written ? " writes" : "")) +
           ": expected another file to write to";
  }
  return {};
}

}  // namespace stickslip::config
