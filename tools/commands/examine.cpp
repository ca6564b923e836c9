#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/diagnosis.h"
#include "diagnosis/evaluation.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/report/json.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "protocol/sha256.h"
#include "tools/command_line/option_checks.h"
#include "tools/commands/commands.h"
#include "tools/concealment/grading.h"
#include "tools/concealment/truth.h"
#include "tools/files/read_file.h"
#include "tools/files/write_file.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

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
  std::string job_list;
  std::vector<std::string> only;
  std::uint64_t seed = 1;
  int jobs = 0;
};

// What a report was made from: a report that was made from anything else is made anew.
std::string origin_of(const fs::path& folder, std::uint64_t seed) {
  static const std::string program = protocol::sha256_of(content_of("/proc/self/exe"));
  return protocol::sha256_of(program + std::to_string(seed) + content_of(folder / "recording.csv") +
                             content_of(folder / "model.toml") +
                             content_of(folder / "validation.csv"));
}

// Whole or not at all: who is interrupted goes on later from what is complete.
void replace_file(const fs::path& file, const std::string& content) {
  const fs::path unfinished = file.string() + ".unfinished";
  write_file(unfinished, content);
  fs::rename(unfinished, file);
}

std::vector<std::string> cases_of(const Arguments& arguments) {
  if (!fs::is_directory(arguments.set)) {
    throw InputError(Problem{arguments.set, 0, 0,
                             "is no folder; expected a set with folders that hold recording.csv "
                             "and model.toml"});
  }
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(arguments.set)) {
    if (fs::is_regular_file(entry.path() / "recording.csv") &&
        fs::is_regular_file(entry.path() / "model.toml")) {
      names.push_back(entry.path().filename());
    }
  }
  std::sort(names.begin(), names.end());
  if (names.empty()) {
    throw InputError(Problem{arguments.set, 0, 0,
                             "holds no case; expected folders with recording.csv and model.toml"});
  }
  if (arguments.only.empty()) return names;
  for (const std::string& name : arguments.only) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      throw InputError(Problem{arguments.set, 0, 0, "holds no case \"" + name + "\""});
    }
  }
  return arguments.only;
}

// A case's report, read or made; what went wrong goes into `problem`.
struct Outcome {
  Json report;
  std::optional<double> before;
  std::optional<double> after;
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
  out.seconds = kept.at("seconds").get<double>();
  return out;
}

// The report of an earlier run, if it was made from the same.
std::optional<Outcome> earlier(const fs::path& file, const std::string& origin) {
  if (!fs::exists(file)) return std::nullopt;
  const Json kept = Json::parse(content_of(file), nullptr, false);
  if (kept.is_discarded() || !kept.is_object() || kept.value("origin", "") != origin) {
    return std::nullopt;
  }
  return outcome_of(kept);
}

Outcome examine(const fs::path& folder, const fs::path& file, const std::string& origin,
                std::uint64_t seed) {
  const auto begun = std::chrono::steady_clock::now();
  const physics::Model model = config::load_model(folder / "model.toml");
  const std::vector<protocol::Recording> recordings{
      protocol::read_recording(folder / "recording.csv")};
  diagnosis::Options options;
  options.seed = seed;
  const diagnosis::Diagnosis found = diagnosis::diagnose(recordings, model, options);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
  Json kept;
  kept["origin"] = origin;
  kept["seconds"] = took.count();
  kept["validation"] = nullptr;
  if (fs::exists(folder / "validation.csv")) {
    const auto other = protocol::read_recording(folder / "validation.csv");
    const auto chi2 = [&](const physics::Model& each) {
      return diagnosis::evaluate(other, each).score.chi2_per_sample;
    };
    kept["validation"] = {{"before", chi2(model)}, {"after", chi2(found.model)}};
  }
  kept["report"] = report::report_json(found);
  replace_file(fs::path(file).replace_extension(".toml"), config::model_text(found.model));
  replace_file(file, kept.dump(2) + "\n");
  return outcome_of(kept);
}

std::string quoted(const std::string& word) {
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

int run(const Arguments& arguments) {
  const fs::path set = arguments.set;
  const fs::path truth_folder = arguments.truth.empty() ? set / "truth" : fs::path(arguments.truth);
  const fs::path reports =
      arguments.reports.empty() ? set / "reports" : fs::path(arguments.reports);
  const std::vector<std::string> names = cases_of(arguments);
  expect_writable(arguments.json);
  const auto file_of = [&](const std::string& name) { return reports / (name + ".json"); };

  if (!arguments.job_list.empty()) {
    std::string lines;
    std::size_t count = 0;
    for (const std::string& name : names) {
      if (earlier(file_of(name), origin_of(set / name, arguments.seed))) continue;
      lines += "stickslip examine " + quoted(set.string()) + " --only " + quoted(name) +
               " --truth " + quoted(truth_folder.string()) + " --reports " +
               quoted(reports.string()) + " --seed " + std::to_string(arguments.seed) +
               " --jobs 1\n";
      ++count;
    }
    write_table(arguments.job_list, lines);
    if (arguments.job_list != "-") {
      std::printf("%zu jobs of %zu cases in %s\n", count, names.size(), arguments.job_list.c_str());
    }
    return 0;
  }

  make_folder(reports);
  terminal::Progress progress("examining");
  std::vector<Outcome> outcomes(names.size());
  std::mutex shown;
  std::size_t done = 0;
  std::size_t made = 0;
  parallel::for_each(names.size(), parallel::threads_for(arguments.jobs), [&](std::size_t i) {
    const fs::path folder = set / names[i];
    bool is_new = false;
    try {
      const std::string origin = origin_of(folder, arguments.seed);
      if (auto kept = earlier(file_of(names[i]), origin)) {
        outcomes[i] = std::move(*kept);
      } else {
        is_new = true;
        outcomes[i] = examine(folder, file_of(names[i]), origin, arguments.seed);
      }
    } catch (const std::exception& error) {
      // One case that fails is a result of the examination, not its end.
      outcomes[i].problem = error.what();
    }
    const std::scoped_lock lock(shown);
    ++done;
    if (is_new) ++made;
    progress.say("examining, " + std::to_string(done) + " of " + std::to_string(names.size()) +
                 " cases done");
    progress.at(made, made + names.size() - done);  // earlier reports took no time
  });
  progress.finish();

  if (!fs::is_directory(truth_folder)) {
    std::printf("%zu reports in %s; %s holds no truth to grade them by\n", names.size(),
                reports.c_str(), truth_folder.c_str());
    return 0;
  }
  std::vector<concealment::Grade> grades;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const fs::path truth_file = truth_folder / (names[i] + ".json");
    const concealment::Truth truth = concealment::read_truth(truth_file);
    const fs::path seal = set / names[i] / "seal.txt";
    if (fs::exists(seal) &&
        content_of(seal).find(protocol::sha256_of(content_of(truth_file))) == std::string::npos) {
      throw InputError(Problem{truth_file.string(), 0, 0,
                               "is not the truth that was sealed with the recording (" +
                                   seal.string() + " names another SHA-256)"});
    }
    grades.push_back(concealment::grade(truth, outcomes[i].report));
    concealment::Grade& grade = grades.back();
    grade.validation_before = outcomes[i].before;
    grade.validation_after = outcomes[i].after;
    if (!truth.validation_graded) grade.validation_before.reset();
    grade.seconds = outcomes[i].seconds;
    grade.problem = outcomes[i].problem;
  }
  std::fputs(concealment::summary_text(grades).c_str(), stdout);
  if (!arguments.json.empty()) {
    write_file(arguments.json, concealment::summary_json(grades).dump(2) + "\n");
  }
  return 0;
}

}  // namespace

void add_examine(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "examine", "Diagnose a whole set of concealed recordings and grade the answers");
  command->add_option("set", arguments->set, "Folder of the set, as `stickslip conceal` makes it")
      ->required()
      ->type_name("DIR");
  command->add_option("--truth", arguments->truth,
                      "Folder of the truth files (default: DIR/truth)");
  command->add_option("--reports", arguments->reports,
                      "Folder for the reports (default: DIR/reports); those that are there and "
                      "were made from the same recording, seed and program are not made again");
  command->add_option("--json", arguments->json, "Write the grades as JSON");
  command->add_option("--only", arguments->only, "Only these cases")->delimiter(',');
  command->add_option("--job-list", arguments->job_list,
                      "Write one command for each case still to be diagnosed (for GNU parallel or "
                      "a Slurm array) and do nothing else; - is standard output");
  command->add_option("--seed", arguments->seed, "Seed of the diagnoses")
      ->check(seed_number())
      ->capture_default_str();
  command->add_option("--jobs", arguments->jobs, "Threads (0: as many as there are cores)")
      ->check(number_of_threads());
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::commands
