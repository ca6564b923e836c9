// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/decision.h"

#include "physics/number_text.h"

namespace stickslip::investigation {

namespace {

using physics::number_text;
using physics::percent_text;

// Runs of other kinds that are made without a hypothesis that they would separate.
constexpr std::size_t most_without_question = 3;

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& each : names) out += (out.empty() ? "" : " and ") + each;
  return out;
}

Decision named(const Step& last) {
  if (last.findings.empty()) {
    return {Ending::named,
            "nothing is missing that these runs could show: it has a probability of " +
                probability_text(last.standing.front().probability)};
  }
  return {Ending::named, "the missing physics is named: " + joined(last.findings) + ", " +
                             (last.findings.size() > 1 ? "each " : "") + "with a probability of " +
                             least_words(last)};
}

}  // namespace

std::string probability_text(double share) {
  return share > 0.999 ? "more than 99.9 %" : percent_text(share);
}

std::string least_words(const Step& last) {
  const bool shared = last.findings.size() > 1 && last.least_probability <= 0.999;
  return (shared ? "at least " : "") + probability_text(last.least_probability);
}

bool is_named(const Study& study, std::size_t steps) {
  const Step& last = study.steps[steps - 1];
  if (last.verdict == "missing_physics") {
    return !last.partial && last.least_probability >= study.settings.certain;
  }
  return last.verdict == "consistent" && steps >= 2 && !last.standing.empty() &&
         last.standing.front().id == "nothing" &&
         last.standing.front().probability >= study.settings.certain;
}

Decision decide(const Study& study, std::size_t steps, const std::optional<NextRun>& next) {
  const StudySettings& settings = study.settings;
  if (steps > 0 && is_named(study, steps)) return named(study.steps[steps - 1]);
  if (!next) {
    return {Ending::no_gain,
            "no run stays within the ranges of the channels for every model that "
            "is possible, or none of another kind is left"};
  }
  double used_s = 0.0;
  for (std::size_t i = 0; i < steps; ++i) {
    used_s += study.steps[i].question.duration_s + settings.overhead_s;
  }
  const double needed_s = next->question.duration_s + settings.overhead_s;
  if (used_s + needed_s > settings.budget_s) {
    return {Ending::budget, "the next run needs " + number_text(needed_s, 3) + " s of rig time, " +
                                number_text(used_s, 4) + " of " +
                                number_text(settings.budget_s, 4) + " s are used"};
  }
  if (steps == 0 || settings.usual_runs) return {};
  const bool asks = study.steps[steps - 1].standing.size() > 1;
  if (asks && next->question.gain < settings.least_gain) {
    return {Ending::no_gain, "the best run would resolve " + percent_text(next->question.gain) +
                                 " of the remaining uncertainty, less than the " +
                                 percent_text(settings.least_gain) + " for which a run is made"};
  }
  if (!asks && steps >= most_without_question) {
    return {Ending::no_gain,
            "one hypothesis is left, which is not certain or does not explain the recordings, and "
            "no run would separate it from another"};
  }
  return {};
}

}  // namespace stickslip::investigation
