// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "protocol/sha256.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/concealment/campaign.h"
#include "tools/concealment/concealment.h"
#include "tools/concealment/hidden_effect.h"
#include "tools/concealment/hidden_rig.h"
#include "tools/files/write_file.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

namespace fs = std::filesystem;
using concealment::CaseRequest;

struct Arguments {
  std::string out;
  std::string truth;
  int count = 1;
  std::uint64_t seed = 0;
  bool seeded = false;
  std::string kind = "any";
  std::vector<std::string> effects;
  double duration_s = 30.0;
  bool instruments = false;
  std::vector<std::string> nuisances;
  std::string snr;
  bool campaign = false;
  bool rig = false;
  int jobs = 0;
};

const std::map<std::string, CaseRequest::Kind> kinds = {
    {"any", CaseRequest::Kind::any},       {"null", CaseRequest::Kind::nothing},
    {"single", CaseRequest::Kind::single}, {"pair", CaseRequest::Kind::pair},
    {"triple", CaseRequest::Kind::triple}, {"unlisted", CaseRequest::Kind::unlisted}};

// Decorrelated seeds of the cases of a set (SplitMix64).
std::uint64_t seed_of_case(std::uint64_t seed, std::uint64_t number) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15U * (number + 1);
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return (z ^ (z >> 31U)) >> 12U;  // exact as a JSON number
}

void check_effects(const std::vector<std::string>& ids) {
  for (const std::string& id : ids) {
    if (concealment::find_hidden_effect(id) != nullptr) continue;
    std::string known;
    for (const auto& effect : concealment::hidden_effects()) {
      known += (known.empty() ? "" : ", ") + std::string(effect.id);
    }
    throw InputError(
        Problem{"--effect", 0, 0, "cannot hide \"" + id + "\"; expected one of " + known});
  }
}

std::vector<std::string> names_of_nuisances() {
  std::vector<std::string> names;
  for (const concealment::Nuisance each : concealment::all_nuisances) {
    names.emplace_back(concealment::name_of(each));
  }
  return names;
}

// The nuisances of these names, all of which are valid.
std::vector<concealment::Nuisance> nuisances_named(const std::vector<std::string>& names) {
  std::vector<concealment::Nuisance> out;
  for (const std::string& name : names) out.push_back(*concealment::nuisance_named(name));
  for (const concealment::Nuisance a : out) {
    for (const concealment::Nuisance b : out) {
      if (concealment::go_together(a, b)) continue;
      throw InputError(Problem{"--nuisance", 0, 0,
                               std::string(concealment::name_of(a)) + " and " +
                                   std::string(concealment::name_of(b)) +
                                   " contradict each other; expected one of them"});
    }
  }
  return out;
}

// "VALUE", within a quarter, or "LOW:HIGH".
std::optional<concealment::SnrRange> snr_range(const std::string& text) {
  if (text.empty()) return std::nullopt;
  constexpr double least = 0.5;
  constexpr double most = 1000.0;
  const auto number = [&](const std::string& part) {
    char* end = nullptr;
    const double value = std::strtod(part.c_str(), &end);
    const bool valid = end != part.c_str() && *end == '\0' && value >= least && value <= most;
    if (valid) return value;
    throw InputError(
        Problem{"--snr", 0, 0, "expected VALUE or LOW:HIGH, each from 0.5 to 1000, found " + text});
  };
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    const double value = number(text);
    return concealment::SnrRange{std::max(least, 0.8 * value), 1.25 * value};
  }
  const concealment::SnrRange range{number(text.substr(0, colon)), number(text.substr(colon + 1))};
  if (range.low < range.high) return range;
  throw InputError(Problem{"--snr", 0, 0, "expected LOW below HIGH, found " + text});
}

// A set is never mixed with an earlier one.
void check_new(const fs::path& folder) {
  if (!fs::is_directory(folder) || fs::is_empty(folder)) return;
  throw InputError(Problem{folder.string(), 0, 0, "is not empty; expected a new folder"});
}

void write_case(const concealment::Case& made, const fs::path& folder, const fs::path& truth_file) {
  make_folder(folder);
  protocol::write_recording(made.recording, folder / "recording.csv");
  protocol::write_recording(made.validation, folder / "validation.csv");
  write_file(folder / "model.toml", config::model_text(made.declared));
  if (made.with_instruments) {
    write_file(folder / "model-instruments.toml", config::model_text(*made.with_instruments));
  }
  const std::string truth = concealment::truth_text(made.truth);
  write_file(truth_file, truth);
  write_file(folder / "seal.txt",
             "SHA-256 of the truth file: " + protocol::sha256_of(truth) + "\n");
}

// The condition of a run is that of its own model, with which it is diagnosed alone.
void write_campaign(const concealment::CampaignCase& made, const fs::path& folder,
                    const fs::path& truth_file) {
  make_folder(folder);
  write_file(folder / "model.toml", config::model_text(made.declared));
  write_file(folder / "campaign.toml", concealment::campaign_text(made));
  for (std::size_t i = 0; i < made.recordings.size(); ++i) {
    const fs::path run = folder / ("run-" + std::to_string(i + 1));
    make_folder(run);
    protocol::write_recording(made.recordings[i], run / "recording.csv");
    write_file(run / "model.toml",
               config::model_text(physics::model_of(made.campaign.runs[i], made.declared)));
  }
  const std::string truth = concealment::truth_text(made.truth);
  write_file(truth_file, truth);
  write_file(folder / "seal.txt",
             "SHA-256 of the truth file: " + protocol::sha256_of(truth) + "\n");
}

// A daemon reads the sealed model by its path from the configuration's folder.
void write_rig(const concealment::HiddenRig& made, const fs::path& folder,
               const fs::path& truth_file) {
  make_folder(folder);
  fs::path sealed = truth_file;
  sealed.replace_extension(".toml");
  const std::string actual = config::model_text(made.actual);
  write_file(sealed, actual);
  write_file(folder / "model.toml", config::model_text(made.declared));
  write_file(folder / "rig.toml",
             concealment::rig_text(made, fs::relative(sealed, folder).generic_string()));
  const std::string truth = concealment::truth_text(made.truth);
  write_file(truth_file, truth);
  write_file(folder / "seal.txt",
             "SHA-256 of the truth file: " + protocol::sha256_of(truth) +
                 "\nSHA-256 of the sealed model: " + protocol::sha256_of(actual) + "\n");
}

// Those that campaigns hide; all of them where none is named.
std::vector<concealment::CampaignEffect> campaign_effects(const std::vector<std::string>& named) {
  std::vector<concealment::CampaignEffect> out;
  std::string known;
  for (const concealment::CampaignEffect each : concealment::all_campaign_effects) {
    const std::string name(concealment::name_of(each));
    known += (known.empty() ? "" : ", ") + name;
    if (named.empty() || std::find(named.begin(), named.end(), name) != named.end()) {
      out.push_back(each);
    }
  }
  if (out.size() < std::max<std::size_t>(named.size(), 1)) {
    throw InputError(
        Problem{"--effect", 0, 0, "names one that no campaign hides; expected some of " + known});
  }
  return out;
}

std::vector<std::string> names_of_kinds() {
  std::vector<std::string> names;
  for (const auto& [name, kind] : kinds) names.push_back(name);
  return names;
}

CaseRequest request_of(const Arguments& arguments) {
  check_effects(arguments.effects);
  CaseRequest request;
  request.kind = kinds.at(arguments.kind);
  request.ids = arguments.effects;
  request.duration_s = arguments.duration_s;
  request.snr = snr_range(arguments.snr);
  request.nuisances = nuisances_named(arguments.nuisances);
  request.imperfect_instruments = arguments.instruments || !request.nuisances.empty();
  return request;
}

const char* made_kind(const Arguments& arguments) {
  if (arguments.campaign) return "concealed campaign";
  return arguments.rig ? "concealed rig" : "concealed recording";
}

int run(Arguments arguments) {
  const auto effects = arguments.campaign ? campaign_effects(arguments.effects)
                                          : std::vector<concealment::CampaignEffect>{};
  const CaseRequest request = arguments.campaign ? CaseRequest{} : request_of(arguments);
  const fs::path out = arguments.out;
  const fs::path truth = arguments.truth.empty() ? out / "truth" : fs::path(arguments.truth);
  check_new(out);
  check_new(truth);
  make_folder(out);
  make_folder(truth);
  if (!arguments.seeded) {
    std::random_device device;
    arguments.seed = (static_cast<std::uint64_t>(device()) << 20U) ^ device();
  }
  const auto count = static_cast<std::size_t>(arguments.count);
  terminal::Progress progress("concealing");
  std::atomic<std::size_t> done = 0;
  parallel::for_each(count, parallel::threads_for(arguments.jobs), [&](std::size_t i) {
    char name[32];
    std::snprintf(name, sizeof name, "case-%03zu", i + 1);
    const std::uint64_t seed = seed_of_case(arguments.seed, i);
    const fs::path truth_file = truth / (std::string(name) + ".json");
    if (arguments.campaign) {
      std::optional<concealment::CampaignEffect> effect;
      if (arguments.kind != "null") effect = effects[i % effects.size()];
      write_campaign(concealment::conceal_campaign(effect, arguments.duration_s, seed, name),
                     out / name, truth_file);
    } else if (arguments.rig) {
      write_rig(concealment::conceal_rig(request, seed, name), out / name, truth_file);
    } else {
      write_case(concealment::conceal(request, seed, name), out / name, truth_file);
    }
    progress.at(done.fetch_add(1) + 1, count);
  });
  progress.finish();
  terminal::print("%s written to %s, the truth to %s\n",
                  physics::counted(count, made_kind(arguments)).c_str(), out.c_str(),
                  truth.c_str());
  return 0;
}

}  // namespace

void add_conceal(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "conceal", "Make recordings with hidden effects, for blind examination of the diagnosis");
  declare_files(*command, FileRole::new_folder,
                command->add_option("--out", arguments->out, "New folder for the set")->required());
  declare_files(
      *command, FileRole::new_folder,
      command->add_option("--truth", arguments->truth,
                          "Folder for the truth files (default: OUT/truth); each case contains the "
                          "SHA-256 of its truth file"));
  command->add_option("--count", arguments->count, "Number of recordings")
      ->check(whole_number(1, 999))
      ->capture_default_str();
  CLI::Option* seed =
      command->add_option("--seed", arguments->seed, "Seed (default: random and not disclosed)")
          ->check(seed_number());
  command->add_option("--kind", arguments->kind, "Kind of case")
      ->check(one_of(names_of_kinds()))
      ->capture_default_str();
  command->add_option("--effect", arguments->effects,
                      "Hide one of these effects (id; default: any of the kind)");
  command
      ->add_option("--duration", arguments->duration_s, "Approximate duration of a recording [s]")
      ->check(number_that([](double v) { return v >= 10.0 && v <= 600.0; }, "10 to 600"))
      ->capture_default_str();
  command->add_flag("--instruments", arguments->instruments,
                    "Record with imperfect instruments: one to four nuisances per case, and a "
                    "second model, model-instruments.toml, that declares their uncertainties");
  command
      ->add_option("--nuisance", arguments->nuisances,
                   "These nuisances in every case, separated by commas (implies --instruments)")
      ->delimiter(',')
      ->check(one_of(names_of_nuisances()));
  command->add_option("--snr", arguments->snr,
                      "Size of every hidden effect within 0.4 s over the noise: VALUE (within a "
                      "quarter) or LOW:HIGH, from 0.5 (default: easily visible, 4 or more)");
  command->add_flag(
      "--campaign", arguments->campaign,
      "Make campaigns of four recordings in which an effect shows only in comparison: "
      "load_dependent_mu, run_drift, amplitude_damping or faulty_channel (--effect); "
      "with --kind null nothing is hidden");
  command->add_flag("--rig", arguments->rig,
                    "Make configurations of simulated rigs with hidden effects, for a daemon and "
                    "`investigate`: rig.toml, with the truth in a sealed model of its own");
  for (const char* other : {"--instruments", "--nuisance", "--snr"}) {
    command->get_option("--campaign")->excludes(other);
  }
  for (const char* other : {"--instruments", "--nuisance", "--campaign"}) {
    command->get_option("--rig")->excludes(other);
  }
  add_jobs_option(*command, arguments->jobs);
  command->callback([&action, arguments, seed, command] {
    arguments->seeded = seed->count() > 0;
    action = [arguments, command] {
      outputs_of(*command);
      return run(*arguments);
    };
  });
  describe(*command,
           {.examples = {{"Make twenty recordings with concealed physics",
                          "stickslip conceal --out blind --count 20"},
                         {"Make recordings of imperfect instruments that hide nothing",
                          "stickslip conceal --out plain --count 20 --kind null --instruments"},
                         {"Make campaigns of four recordings, in turns of each effect",
                          "stickslip conceal --out campaigns --campaign --count 8 --duration 12"},
                         {"Make weak effects, for a detection curve",
                          "stickslip conceal --out weak --count 20 --kind single --snr 0.5:4"}},
            .files = {{"DIR/truth", "Truth files; each case holds the SHA-256 of its own"}},
            .see_also = {"stickslip-examine(1)"}});
}

}  // namespace stickslip::commands
