// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/campaign.h"
#include "config/model_file.h"
#include "config/named_files.h"
#include "config/rig.h"
#include "diagnosis/diagnosis.h"
#include "diagnosis/evaluation.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/report/json.h"
#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "protocol/sha256.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/concealment/grading.h"
#include "tools/concealment/ground_truth.h"
#include "tools/files/outputs.h"
#include "tools/files/read_file.h"
#include "tools/files/write_file.h"
#include "tools/rig_access/sealed_rig.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Arguments {
  std::string set;
  std::string truth;
  std::string reports;
  std::string json;
  std::string model_name = "model.toml";
  std::string job_list;
  std::vector<std::string> only;
  bool alone = false;
  double rig_time_s = 300.0;
  std::string runs = "designed";
  double false_alarm_rate = diagnosis::Criteria{}.false_alarm_rate;
  std::uint64_t seed = 1;
  int jobs = 0;
};

constexpr const char* campaign_name = "campaign.toml";
constexpr const char* rig_name = "rig.toml";

bool is_campaign(const fs::path& folder) { return fs::is_regular_file(folder / campaign_name); }
bool is_rig(const fs::path& folder) { return fs::is_regular_file(folder / rig_name); }

// Folders of a campaign's recordings, for a diagnosis of each alone: "case-001/run-1".
std::vector<std::string> runs_of(const fs::path& set, const std::string& name,
                                 const std::string& model_name) {
  std::vector<std::string> out;
  for (const auto& entry : fs::directory_iterator(set / name)) {
    if (fs::is_regular_file(entry.path() / "recording.csv") &&
        fs::is_regular_file(entry.path() / model_name)) {
      out.push_back(name + "/" + entry.path().filename().string());
    }
  }
  return out;
}

// Checksum of all inputs of a report; a report of another origin is not reused.
std::string origin_of(const fs::path& folder, const Arguments& arguments) {
  static const std::string program = protocol::sha256_of(content_of("/proc/self/exe"));
  std::string inputs = program + std::to_string(arguments.seed) + " " +
                       physics::shortest_text(arguments.false_alarm_rate);
  if (is_campaign(folder)) {
    inputs += content_of(folder / campaign_name);
    for (const fs::path& file : config::files_read_with(folder / campaign_name)) {
      inputs += content_of(file);
    }
    return protocol::sha256_of(inputs);
  }
  if (is_rig(folder)) {
    const config::Rig rig = config::load_rig(folder / rig_name);
    inputs += content_of(folder / rig_name) + content_of(folder / arguments.model_name) +
              content_of(rig.simulated.truth_file) + arguments.runs + " " +
              physics::shortest_text(arguments.rig_time_s);
    return protocol::sha256_of(inputs);
  }
  inputs += content_of(folder / "recording.csv") + content_of(folder / arguments.model_name);
  if (fs::exists(folder / "validation.csv")) inputs += content_of(folder / "validation.csv");
  return protocol::sha256_of(inputs);
}

std::vector<std::string> cases_of(const Arguments& arguments) {
  if (!fs::is_directory(arguments.set)) {
    throw InputError(Problem{arguments.set, 0, 0,
                             "is not a folder; expected a set of folders with recording.csv or " +
                                 std::string(rig_name) + " and " + arguments.model_name});
  }
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(arguments.set)) {
    const std::string name = entry.path().filename();
    if (is_campaign(entry.path())) {
      const auto runs = arguments.alone ? runs_of(arguments.set, name, arguments.model_name)
                                        : std::vector<std::string>{name};
      names.insert(names.end(), runs.begin(), runs.end());
    } else if ((fs::is_regular_file(entry.path() / "recording.csv") || is_rig(entry.path())) &&
               fs::is_regular_file(entry.path() / arguments.model_name)) {
      names.push_back(name);
    }
  }
  std::sort(names.begin(), names.end());
  if (names.empty()) {
    throw InputError(Problem{arguments.set, 0, 0,
                             "contains no case; expected folders with recording.csv or " +
                                 std::string(rig_name) + " and " + arguments.model_name});
  }
  if (arguments.only.empty()) return names;
  for (const std::string& name : arguments.only) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      throw InputError(Problem{arguments.set, 0, 0, "contains no case \"" + name + "\""});
    }
  }
  return arguments.only;
}

// The report of a case, or the reason why there is none.
struct Outcome {
  Json report;
  std::optional<double> before;
  std::optional<double> after;
  Json study;  // of a sealed rig
  double seconds = 0.0;
  std::string problem;
};

Outcome outcome_of(const Json& kept) {
  Outcome out;
  out.report = kept.at("report");
  if (kept.at("validation").is_object()) {
    out.before = kept.at("validation").at("before").get<double>();
    out.after = kept.at("validation").at("after").get<double>();
  }
  out.study = kept.value("study", Json());
  out.seconds = kept.at("seconds").get<double>();
  return out;
}

// A stored report of the same origin.
std::optional<Outcome> stored(const fs::path& file, const std::string& origin) {
  if (!fs::exists(file)) return std::nullopt;
  const Json kept = Json::parse(content_of(file), nullptr, false);
  if (kept.is_discarded() || !kept.is_object() || kept.value("origin", "") != origin) {
    return std::nullopt;
  }
  return outcome_of(kept);
}

investigation::StudySettings study_settings(const Arguments& arguments) {
  investigation::StudySettings out;
  out.budget_s = arguments.rig_time_s;
  out.seed = arguments.seed;
  out.usual_runs = arguments.runs != "designed";
  if (arguments.runs == "one") {
    out.shortest_s = arguments.rig_time_s - out.overhead_s;
    out.longest_s = out.shortest_s;
  }
  return out;
}

// The study of a sealed rig, in a folder beside its report.
Outcome investigate(const fs::path& folder, const fs::path& file, const std::string& origin,
                    const Arguments& arguments, const Outputs& outputs) {
  const auto start = std::chrono::steady_clock::now();
  const fs::path place = fs::path(file).replace_extension();
  const auto found = rig_access::study_of_sealed_rig(
      folder / rig_name, folder / arguments.model_name, place, study_settings(arguments), {});
  const investigation::Study& study = found.study;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const auto report_of = [&place](const investigation::Step& step) {
    return Json::parse(content_of(place / step.name / "report.json"));
  };
  Json kept = {{"origin", origin}, {"seconds", elapsed.count()}, {"validation", nullptr}};
  kept["report"] = study.steps.empty() ? Json() : report_of(study.steps.back());
  kept["study"] = {{"runs", study.steps.size()},
                   {"rig_time_s", study.rig_time_s()},
                   {"ending", name_of(study.ending)},
                   {"used_share", found.used_share},
                   {"first", study.steps.empty() ? Json() : report_of(study.steps.front())}};
  outputs.write(file, Form::json, protocol::json_text(kept) + "\n");
  return outcome_of(kept);
}

Outcome examine(const fs::path& folder, const fs::path& file, const std::string& origin,
                const Arguments& arguments, const Outputs& outputs) {
  if (is_rig(folder)) return investigate(folder, file, origin, arguments, outputs);
  const auto start = std::chrono::steady_clock::now();
  diagnosis::Options options;
  options.seed = arguments.seed;
  options.criteria.false_alarm_rate = arguments.false_alarm_rate;
  physics::Model model;
  std::vector<std::string> files{"recording.csv"};
  std::string model_name = arguments.model_name;
  if (is_campaign(folder)) {
    config::LoadedCampaign loaded = config::load_campaign(folder / campaign_name);
    model = std::move(loaded.model);
    model_name = fs::relative(loaded.model_file, folder);
    options.campaign = std::make_shared<physics::Campaign>(std::move(loaded.campaign));
    files.clear();
    for (const fs::path& each : loaded.recordings) files.push_back(fs::relative(each, folder));
  } else {
    model = config::load_model(folder / model_name);
  }
  std::vector<protocol::Recording> recordings;
  for (const std::string& each : files) {
    recordings.push_back(protocol::read_recording(folder / each));
    warn_if_cut_off(recordings.back());
  }
  const diagnosis::Diagnosis found = diagnosis::diagnose(recordings, model, options);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  Json kept;
  kept["origin"] = origin;
  kept["seconds"] = elapsed.count();
  kept["validation"] = nullptr;
  if (fs::exists(folder / "validation.csv")) {
    const auto other = protocol::read_recording(folder / "validation.csv");
    warn_if_cut_off(other);
    const auto chi2 = [&](const physics::Model& each) {
      return diagnosis::evaluate(other, each).score.chi2_per_sample;
    };
    kept["validation"] = {{"before", chi2(model)}, {"after", chi2(found.model)}};
  }
  const auto checked = [&folder](const std::string& name) {
    return report::Provenance::File{name, protocol::sha256_of(content_of(folder / name))};
  };
  std::vector<report::Provenance::File> sources;
  for (const std::string& each : files) sources.push_back(checked(each));
  report::Provenance provenance =
      report::provenance_of(sources, checked(model_name), arguments.seed);
  report::add_false_alarm_rate(provenance, arguments.false_alarm_rate);
  kept["report"] = report::report_json(found, provenance);
  outputs.write(fs::path(file).replace_extension(".toml"), Form::toml,
                config::model_text(found.model));
  outputs.write(file, Form::json, protocol::json_text(kept) + "\n");
  return outcome_of(kept);
}

std::string quoted(const std::string& word) {
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

struct Folders {
  fs::path set;
  fs::path truth;
  fs::path reports;
  fs::path report_of(std::string name) const {
    std::replace(name.begin(), name.end(), '/', '-');
    return reports / (name + ".json");
  }
  // Of a recording of a campaign, the truth of the campaign.
  fs::path truth_of(const std::string& name) const {
    return truth / (name.substr(0, name.find('/')) + ".json");
  }
  fs::path seal_of(const std::string& name) const {
    return set / name.substr(0, name.find('/')) / "seal.txt";
  }
};

Folders folders_of(const Arguments& arguments) {
  const fs::path set = arguments.set;
  return {set, arguments.truth.empty() ? set / "truth" : fs::path(arguments.truth),
          arguments.reports.empty() ? set / "reports" : fs::path(arguments.reports)};
}

void write_job_list(const Arguments& arguments, const Folders& folders,
                    const std::vector<std::string>& names, const Outputs& outputs) {
  std::string lines;
  std::size_t count = 0;
  for (const std::string& name : names) {
    const std::string origin = origin_of(folders.set / name, arguments);
    if (stored(folders.report_of(name), origin)) continue;
    lines += "stickslip examine " + quoted(folders.set.string()) + " --only " + quoted(name) +
             " --truth " + quoted(folders.truth.string()) + " --reports " +
             quoted(folders.reports.string()) + " --model-name " + quoted(arguments.model_name) +
             " --seed " + std::to_string(arguments.seed) + " --false-alarm-rate " +
             physics::shortest_text(arguments.false_alarm_rate) +
             (arguments.alone ? " --alone" : "");
    if (is_rig(folders.set / name)) {
      lines += " --runs " + arguments.runs + " --rig-time-s " +
               physics::shortest_text(arguments.rig_time_s);
    }
    lines += " --jobs 1\n";
    ++count;
  }
  outputs.write(arguments.job_list, Form::plain, lines);
  if (arguments.job_list != "-") {
    terminal::print("%s of %s in %s\n", physics::counted(count, "job").c_str(),
                    physics::counted(names.size(), "case").c_str(), arguments.job_list.c_str());
  }
}

std::vector<Outcome> examine_all(const Arguments& arguments, const Folders& folders,
                                 const std::vector<std::string>& names, const Outputs& outputs) {
  terminal::Progress progress("examining");
  std::vector<Outcome> outcomes(names.size());
  std::mutex shown;
  std::size_t done = 0;
  std::size_t made = 0;
  parallel::for_each(names.size(), parallel::threads_for(arguments.jobs), [&](std::size_t i) {
    const fs::path folder = folders.set / names[i];
    const fs::path file = folders.report_of(names[i]);
    bool is_new = false;
    try {
      const std::string origin = origin_of(folder, arguments);
      if (auto kept = stored(file, origin)) {
        outcomes[i] = std::move(*kept);
      } else {
        is_new = true;
        outcomes[i] = examine(folder, file, origin, arguments, outputs);
      }
    } catch (const std::exception& error) {
      // A case that fails is a result of the examination.
      outcomes[i].problem = ending_of(error, "stickslip").line;
    }
    const std::scoped_lock lock(shown);
    ++done;
    if (is_new) ++made;
    progress.set_label("examining, " + std::to_string(done) + " of " +
                       physics::counted(names.size(), "case") + " done");
    progress.at(made, made + names.size() - done);  // stored reports take no time
  });
  progress.finish();
  return outcomes;
}

void check_seal(const fs::path& truth_file, const fs::path& seal) {
  if (!fs::exists(seal)) return;
  if (content_of(seal).find(protocol::sha256_of(content_of(truth_file))) != std::string::npos) {
    return;
  }
  throw InputError(Problem{truth_file.string(), 0, 0,
                           "is not the truth file sealed with the recording (the SHA-256 in " +
                               seal.string() + " differs)"});
}

std::vector<concealment::Grade> grades_of(const Folders& folders,
                                          const std::vector<std::string>& names,
                                          const std::vector<Outcome>& outcomes) {
  std::vector<concealment::Grade> grades;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const fs::path truth_file = folders.truth_of(names[i]);
    const concealment::GroundTruth truth = concealment::read_truth(truth_file);
    check_seal(truth_file, folders.seal_of(names[i]));
    grades.push_back(concealment::grade(truth, outcomes[i].report));
    concealment::Grade& grade = grades.back();
    if (outcomes[i].study.is_object()) {
      grade.study = concealment::study_grade(truth, outcomes[i].study);
    }
    grade.validation_before = outcomes[i].before;
    grade.validation_after = outcomes[i].after;
    if (!truth.validation_graded) grade.validation_before.reset();
    if (names[i].find('/') != std::string::npos) grade.name = names[i];
    grade.seconds = outcomes[i].seconds;
    grade.problem = outcomes[i].problem;
  }
  return grades;
}

/// The files that an examination reads.
std::vector<std::string> inputs_of(const Folders& folders, const std::string& model_name,
                                   const std::vector<std::string>& names) {
  std::vector<std::string> out;
  for (const std::string& name : names) {
    for (const std::string& file : {std::string("recording.csv"), std::string("validation.csv"),
                                    std::string(rig_name), model_name, std::string("seal.txt")}) {
      out.push_back((folders.set / name / file).string());
    }
    out.push_back(folders.truth_of(name).string());
  }
  return out;
}

int run(const Arguments& arguments, Outputs outputs) {
  const Folders folders = folders_of(arguments);
  const std::vector<std::string> names = cases_of(arguments);
  outputs.add_inputs(inputs_of(folders, arguments.model_name, names));
  outputs.check(arguments.json);
  if (!arguments.job_list.empty()) {
    write_job_list(arguments, folders, names, outputs);
    return 0;
  }
  make_folder(folders.reports);
  const std::vector<Outcome> outcomes = examine_all(arguments, folders, names, outputs);
  if (!fs::is_directory(folders.truth)) {
    terminal::print("%s in %s; not graded: no truth files in %s\n",
                    physics::counted(names.size(), "report").c_str(), folders.reports.c_str(),
                    folders.truth.c_str());
    return 0;
  }
  const std::vector<concealment::Grade> grades = grades_of(folders, names, outcomes);
  terminal::print_page(concealment::summary_text(grades));
  if (!arguments.json.empty()) {
    outputs.write(arguments.json, Form::json,
                  protocol::json_text(concealment::summary_json(grades)) + "\n");
  }
  return 0;
}

}  // namespace

void add_examine(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("examine",
                         "Diagnose a set of concealed recordings, or study a set of "
                         "sealed rigs, and grade the reports");
  add_input(*command, "DIR", arguments->set, "Folder of the set, as written by `stickslip conceal`")
      ->required()
      ->type_name("DIR");
  add_input(*command, "--truth", arguments->truth, "Folder of the truth files (default: DIR/truth)")
      ->type_name("DIR");
  add_output_folder(*command, "--reports", arguments->reports,
                    "Folder for the reports (default: DIR/reports); existing reports of the same "
                    "recording, model, options and program are reused");
  add_json_file_option(*command, arguments->json);
  command
      ->add_option("--model-name", arguments->model_name,
                   "Model file in the folder of each case, such as model-instruments.toml")
      ->capture_default_str();
  command->add_option("--only", arguments->only, "Only these cases, separated by commas")
      ->delimiter(',');
  add_output(*command, "--job-list", arguments->job_list,
             "Only write one command per case still to be diagnosed (for GNU parallel or a "
             "Slurm array); -: standard output");
  command->add_flag("--alone", arguments->alone,
                    "Diagnose each recording of a campaign by itself, for comparison");
  command
      ->add_option("--runs", arguments->runs,
                   "Runs of a sealed rig: designed for what is left open; the usual ones in "
                   "sequence; or one of the whole rig time, a modulated sine")
      ->check(CLI::IsMember({"designed", "usual", "one"}))
      ->capture_default_str();
  command->add_option("--rig-time-s", arguments->rig_time_s, "Rig time of each sealed rig [s]")
      ->check(number_that([](double v) { return v >= 9.0 && v <= 603.0; }, "9 to 603"))
      ->capture_default_str();
  add_false_alarm_rate_option(*command, arguments->false_alarm_rate);
  add_seed_option(*command, arguments->seed);
  add_jobs_option(*command, arguments->jobs);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command, {.examples = {{"Diagnose and grade a set", "stickslip examine blind"},
                                   {"The same with declared uncertainties of the instruments",
                                    "stickslip examine blind --model-name model-instruments.toml "
                                    "--reports blind/reports-instruments"},
                                   {"Write the work as a list of commands for a cluster",
                                    "stickslip examine blind --job-list jobs.txt"}},
                      .files = {{"DIR/reports", "Reports; existing ones are reused"}},
                      .see_also = {"stickslip-conceal(1)", "stickslip-diagnose(1)"}});
}

}  // namespace stickslip::commands
