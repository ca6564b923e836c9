// SPDX-License-Identifier: Apache-2.0
// A study: what was asked of a rig, what it answered, and what was concluded, as its folder holds
// it. Everything that a continuation or a repetition needs beside the recordings is in study.json.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/design/best_run.h"
#include "diagnosis/diagnosis.h"
#include "tools/investigation/rig.h"

namespace stickslip::investigation {

/// A hypothesis after a run.
struct Standing {
  std::string id;
  std::string name;
  std::string statement;
  double probability = 0.0;
};

/// Two hypotheses and what the run was expected to make between them [nat].
struct Expected {
  std::string truth;
  std::string other;
  double nats = 0.0;
  double error = 0.0;
};

/// A run before it is made.
struct Question {
  design::RunPlan plan;
  std::string words;
  double duration_s = 0.0;
  design::DrivePeaks peaks;
  design::Extent extent;
  double factor = 1.0;
  double gain = 0.0;
  int evaluations = 0;
  std::vector<Expected> expected;
};

/// A run that was made. Without an answer: recorded, and not diagnosed yet.
struct Step {
  std::string name;  ///< "run-01", its folder
  Question question;
  std::string recording_sha256;
  bool answered = false;
  std::string verdict;
  bool partial = false;            ///< the findings leave more than the noise
  double chi2 = 0.0;               ///< held-out, per sample, of the result
  double least_probability = 0.0;  ///< of the findings
  std::vector<std::string> findings;
  std::vector<Standing> standing;  ///< most probable first
};

struct StudySettings {
  double budget_s = 600.0;  ///< of rig time
  double certain = 0.99;
  double least_gain = 0.05;  ///< expected_gain below which no run is made
  int evaluations = 90;
  double shortest_s = 8.0;
  double longest_s = 20.0;
  double overhead_s = 3.0;  ///< rig time of a run beside its drive
  std::uint64_t seed = 1;
  /// The usual runs one after the other, whatever they are expected to resolve: what designed runs
  /// are compared with.
  bool usual_runs = false;
};

enum class Ending {
  open,      ///< not ended: it can be taken up again
  named,     ///< one hypothesis has what counts as certain
  no_gain,   ///< the best run would not gain what it costs
  budget,    ///< the next run would exceed the budget of rig time
  declined,  ///< a person declined a run
};
std::string_view name_of(Ending ending);

struct Study {
  std::string rig;
  std::string model_sha256;
  StudySettings settings;
  RigFacts facts;
  std::vector<Step> steps;
  Ending ending = Ending::open;
  std::string ending_words;

  double rig_time_s() const;
};

/// The files of a study, by its folder.
std::filesystem::path json_file(const std::filesystem::path& folder);
std::filesystem::path model_file(const std::filesystem::path& folder);
std::filesystem::path recording_file(const std::filesystem::path& folder, const Step& step);

std::string study_text(const Study& study);

/// Throws InputError for a file that is none.
Study read_study(const std::filesystem::path& folder);

/// Writes study.json beside its place, then moves it there.
void save(const Study& study, const std::filesystem::path& folder);

/// Writes a file of the study beside its place, then moves it there. Creates the folder.
void write_whole(const std::filesystem::path& file, const std::string& text);

}  // namespace stickslip::investigation
