// SPDX-License-Identifier: Apache-2.0
#include "config/campaign.h"

#include <algorithm>
#include <set>

#include "config/document.h"
#include "config/model_file.h"
#include "physics/catalogue.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/spelling.h"

namespace stickslip::config {

namespace {

using physics::SharedNumber;

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& each : names) out += (out.empty() ? "" : ", ") + each;
  return out;
}

std::string hint(const std::string& name, const std::vector<std::string>& names) {
  const std::string meant = physics::nearest(name, names);
  if (!meant.empty()) return "; did you mean " + meant + "?";
  return names.empty() ? std::string() : "; expected one of " + listed(names);
}

// Numbers that a model has or, of an instrument, may have.
std::vector<std::string> paths_of_model(physics::Model model) {
  for (physics::Sensor& sensor : model.sensors) {
    if (!sensor.gain) sensor.gain.emplace();
    if (!sensor.offset) sensor.offset.emplace();
    if (!sensor.delay_s) sensor.delay_s.emplace();
  }
  std::vector<std::string> out;
  for (const physics::NamedParameter& each : physics::parameters_of(model))
    out.push_back(each.path);
  return out;
}

// True for a number of an effect that a diagnosis may find missing.
bool is_of_an_effect(const std::string& path) {
  constexpr std::string_view terms = "physics.";
  if (!path.starts_with(terms)) return false;
  const std::string id = path.substr(terms.size(), path.find('.', terms.size()) - terms.size());
  const physics::Effect* effect = physics::find_effect(id);
  if (effect == nullptr) return false;
  const std::string name = path.substr(path.rfind('.') + 1);
  const auto& cards = effect->card().parameters;
  return std::any_of(cards.begin(), cards.end(),
                     [&](const physics::ParameterCard& card) { return card.name == name; });
}

class Consistency {
 public:
  Consistency(Document& document, const CampaignFile& file) : document_(document), file_(file) {}

  void check_recordings() {
    const auto& all = file_.recordings;
    if (all.size() < 2) {
      document_.report("recording", "holds " + physics::counted(all.size(), "recording") +
                                        "; expected two or more, which differ in a condition");
    }
    std::set<std::string> names;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!names.insert(all[i].name).second) {
        report(i, "name",
               "\"" + all[i].name +
                   "\" is the name of another recording, too; expected "
                   "a name of its own");
      }
    }
    const bool fitted =
        std::any_of(all.begin(), all.end(), [](const auto& e) { return !e.held_out; });
    if (!all.empty() && !fitted) {
      document_.report("recording", "every recording is held out; expected one or more to fit");
    }
  }

  void check_numbers() {
    for (std::size_t i = 0; i < file_.numbers.size(); ++i) {
      const SharedNumber& number = file_.numbers[i];
      for (std::size_t k = 0; k < i; ++k) {
        if (file_.numbers[k].path == number.path) {
          report_number(i, "path", number.path + " has a [[number]] table already");
        }
      }
      if (!number.condition.empty()) check_condition(i, number);
    }
  }

  void check_with(const physics::Model& model) {
    const std::vector<std::string> paths = paths_of_model(model);
    const auto is_known = [&](const std::string& path) {
      return std::find(paths.begin(), paths.end(), path) != paths.end();
    };
    for (std::size_t i = 0; i < file_.recordings.size(); ++i) {
      for (const auto& [path, value] : file_.recordings[i].set) {
        if (is_known(path)) continue;
        report(i, "set." + path, "the model has no number of that path" + hint(path, paths));
      }
    }
    physics::Model copy = model;
    const auto declared = physics::parameters_of(copy);
    for (std::size_t i = 0; i < file_.numbers.size(); ++i) {
      const SharedNumber& number = file_.numbers[i];
      if (!is_known(number.path) && !is_of_an_effect(number.path)) {
        report_number(i, "path",
                      number.path +
                          " is no number of the model, and of no effect of the catalogue" +
                          hint(number.path, paths));
      }
      for (const physics::NamedParameter& each : declared) {
        if (each.path != number.path || each.parameter->sigma > 0.0) continue;
        report_number(i, "path",
                      number.path +
                          " is a plain number in the model, which is exact; expected "
                          "{ value = ..., sigma = ... } there for one that is fitted");
      }
    }
  }

 private:
  void report(std::size_t recording, const std::string& key, const std::string& message) {
    document_.report("recording." + std::to_string(recording) + "." + key, message);
  }
  void report_number(std::size_t number, const std::string& key, const std::string& message) {
    document_.report("number." + std::to_string(number) + "." + key, message);
  }

  void check_condition(std::size_t i, const SharedNumber& number) {
    bool varied = false;
    for (const CampaignRecording& each : file_.recordings) {
      const auto found = each.conditions.find(number.condition);
      if (found == each.conditions.end()) {
        std::vector<std::string> names;
        for (const auto& [name, value] : each.conditions) names.push_back(name);
        return report_number(i, "condition",
                             "the recording \"" + each.name + "\" does not state the condition " +
                                 number.condition + hint(number.condition, names));
      }
      if (number.sharing != physics::Sharing::linear && !(found->second > 0.0)) {
        return report_number(i, "condition",
                             number.condition + " is " + physics::number_text(found->second) +
                                 " in \"" + each.name +
                                 "\"; expected a condition above 0, or sharing = \"linear\"");
      }
      varied = varied || found->second != file_.recordings.front().conditions.at(number.condition);
    }
    if (!varied && physics::follows(number.sharing)) {
      report_number(i, "condition",
                    number.condition +
                        " is the same in all recordings, and nothing can be seen "
                        "to follow it");
    }
  }

  Document& document_;
  const CampaignFile& file_;
};

physics::Run run_of(const CampaignRecording& each) {
  physics::Run out;
  out.name = each.name;
  out.conditions = each.conditions;
  out.settings = each.set;
  out.held_out = each.held_out;
  for (const auto& [name, text] :
       {std::pair{"material", each.material}, std::pair{"drive", each.drive},
        std::pair{"comment", each.comment}}) {
    if (!text.empty()) out.remarks[name] = text;
  }
  return out;
}

CampaignFile read_consistent(Document& document) {
  CampaignFile out;
  if (document.sound()) {
    document.read(out);
    Consistency consistency(document, out);
    consistency.check_recordings();
    if (document.sound()) consistency.check_numbers();
  }
  return out;
}

}  // namespace

CampaignFile parse_campaign(std::string_view text, const std::string& name) {
  Document document(text, name, keys_of<CampaignFile>());
  CampaignFile out = read_consistent(document);
  if (!document.sound()) throw InputError(document.take_problems());
  return out;
}

LoadedCampaign load_campaign(const std::filesystem::path& file,
                             const std::optional<std::filesystem::path>& model) {
  Document document(read_text(file), file.string(), keys_of<CampaignFile>());
  const CampaignFile read = read_consistent(document);
  if (document.sound() && !model && read.model.empty()) {
    document.report("model",
                    "is missing: expected the path of the rig's model, here or in --model");
  }
  LoadedCampaign out;
  if (document.sound()) {
    out.model_file = model.value_or(read.model);
    out.model = load_model(out.model_file);
    Consistency(document, read).check_with(out.model);
  }
  if (!document.sound()) throw InputError(document.take_problems());
  for (const CampaignRecording& each : read.recordings) {
    out.campaign.runs.push_back(run_of(each));
    // Drift from run to run follows their order; with two it is no condition of its own.
    if (read.recordings.size() > 2) {
      out.campaign.runs.back().conditions.emplace("order", out.campaign.runs.size());
    }
    out.recordings.push_back(each.file);
  }
  out.campaign.numbers = read.numbers;
  return out;
}

void hold_out(physics::Campaign& campaign, const std::string& name, const std::string& file) {
  const auto found = campaign.find(name);
  if (!found) {
    std::vector<std::string> names;
    for (const physics::Run& run : campaign.runs) names.push_back("\"" + run.name + "\"");
    throw InputError(Problem{
        "--hold-out", 0, 0,
        "\"" + name + "\" is no recording of " + file + "; expected one of " + listed(names)});
  }
  campaign.runs[*found].held_out = true;
  const bool fitted = std::any_of(campaign.runs.begin(), campaign.runs.end(),
                                  [](const physics::Run& run) { return !run.held_out; });
  if (!fitted) {
    throw InputError(Problem{"--hold-out", 0, 0,
                             "holds out every recording of " + file + "; expected one to fit"});
  }
}

}  // namespace stickslip::config
