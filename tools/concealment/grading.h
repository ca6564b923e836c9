// SPDX-License-Identifier: Apache-2.0
// Grades of diagnoses against the truth, and their statistics.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/concealment/ground_truth.h"

namespace stickslip::concealment {

/// Of the study of a sealed rig.
struct StudyGrade {
  int runs = 0;
  double rig_time_s = 0.0;
  double used_share = 0.0;  ///< of limits and ranges, by the readings
  /// After the first run the first finding is wrong, or has less than 95 %.
  bool open_after_first = false;
};

struct Grade {
  std::string name;
  std::string kind;
  std::vector<std::string> hidden;  ///< ids; names of unlisted physics
  std::vector<std::string> named;   ///< ids of the findings
  std::string verdict;              ///< empty: no report
  bool verdict_right = false;
  bool false_alarm = false;     ///< a finding without a hidden effect
  bool missed = false;          ///< consistent in spite of a hidden effect
  bool first_right = false;     ///< the first finding names a hidden effect
  bool relation_right = false;  ///< of every hidden effect
  bool all_named = false;
  int found = 0;       ///< hidden effects that some finding names
  int surplus = 0;     ///< findings that name no hidden effect
  bool exact = false;  ///< verdict, all hidden effects, their channels, and no surplus
  std::optional<bool> channel_right;  ///< sensor effects
  std::optional<bool> depends_right;  ///< unlisted physics
  std::optional<double> overlap;      ///< of the times of an event
  int parameters = 0;                 ///< graded
  int within_tolerance = 0;
  int within_tenth = 0;               ///< within 10 % of the truth
  int covered = 0;                    ///< by their 95 % intervals
  std::optional<double> chi2_before;  ///< held-out, per sample
  std::optional<double> chi2_after;
  std::optional<double> validation_before;  ///< on another run
  std::optional<double> validation_after;
  std::vector<std::string> nuisances;  ///< imperfections of the instruments; empty: ideal
  std::optional<double> snr;           ///< size of a single effect over the noise
  std::optional<StudyGrade> study;
  double seconds = 0.0;
  std::string problem;  ///< reason for a missing report
};

/// `report`: docs/formats.md, section 5; null if there is none.
Grade grade(const GroundTruth& truth, const nlohmann::ordered_json& report);

/// `study`: as `examine` keeps it, with the report after the first run.
StudyGrade study_grade(const GroundTruth& truth, const nlohmann::ordered_json& study);

/// A table with one line per hidden effect, the confusions (hidden against reported effects), the
/// tables by nuisance and by size of the effect, and the rates with their 95 % intervals.
std::string summary_text(std::span<const Grade> grades);

/// The rates, the tables by nuisance and by size, and the grades of all cases.
nlohmann::ordered_json summary_json(std::span<const Grade> grades);

/// Wilson's 95 % interval of a rate with `hits` of `count`; {0, 1} for a count of 0.
struct Rate {
  double low = 0.0;
  double high = 1.0;
};
Rate rate_interval(int hits, int count);

}  // namespace stickslip::concealment
