// Grades a diagnosis against the truth, and many of them together.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/concealment/truth.h"

namespace stickslip::concealment {

/// What is right and what is wrong in one report.
struct Grade {
  std::string name;
  std::string kind;
  std::vector<std::string> hidden;  ///< ids; of an unlisted physics its own name
  std::vector<std::string> named;   ///< ids of the findings
  std::string verdict;              ///< empty: there is no report
  bool verdict_right = false;
  bool false_alarm = false;     ///< something was found where nothing is hidden
  bool missed = false;          ///< called consistent although something is hidden
  bool first_right = false;     ///< the first finding names something that is hidden
  bool relation_right = false;  ///< every hidden effect is looked for in the right relation
  bool all_named = false;
  int surplus = 0;     ///< findings that name nothing hidden
  bool exact = false;  ///< the verdict, all that is hidden, at its channel, and nothing more
  std::optional<bool> channel_right;  ///< sensor effects
  std::optional<bool> depends_right;  ///< unlisted physics
  std::optional<double> overlap;      ///< in time, of what lasts from one instant to another
  int parameters = 0;                 ///< graded
  int within_tolerance = 0;
  int within_tenth = 0;               ///< within 10 % of the truth
  int covered = 0;                    ///< by their 95 % intervals
  std::optional<double> chi2_before;  ///< held-out, per sample
  std::optional<double> chi2_after;
  std::optional<double> validation_before;  ///< on another run
  std::optional<double> validation_after;
  double seconds = 0.0;
  std::string problem;  ///< why there is no report
};

/// Grades a report (section 5 of the contract); null where there is none.
Grade grade(const concealment::Truth& truth, const nlohmann::ordered_json& report);

/// A table with one line for each hidden effect, the confusion table (what was hidden against what
/// was named first), and the rates with their 95 % intervals.
std::string summary_text(std::span<const Grade> grades);

/// The same for machines.
nlohmann::ordered_json summary_json(std::span<const Grade> grades);

/// The interval that holds a rate with 95 % probability, by Wilson's formula, when `hits` of
/// `count` are seen. {0, 1} for a count of 0.
struct Rate {
  double low = 0.0;
  double high = 1.0;
};
Rate rate_interval(int hits, int count);

}  // namespace stickslip::concealment
