// SPDX-License-Identifier: Apache-2.0
#include "tools/interview/interview.h"

#include <utility>

#include "physics/problem.h"

namespace stickslip::interview {

namespace {

[[noreturn]] void refuse(std::string message) {
  throw InputError(Problem{"", 0, 0, std::move(message)});
}

constexpr std::string_view introduction =
    "Eight questions about the rig. A number may have a unit and, behind +-, its standard "
    "deviation: "
    "\"60 g +- 1 %\"; +- 0 is exact. Enter takes the answer that is proposed. Nothing is written "
    "before "
    "the last answer; Ctrl-C ends the questions.\n";

/// The model with the answer; the old one stays as it is if the answer cannot be used.
std::string take(const Question& question, Draft& draft, const std::string& answer) {
  Draft changed = draft;
  std::string problem = question.take(changed, answer);
  if (problem.empty()) draft = std::move(changed);
  return problem;
}

std::string text_of(const Question& question, std::size_t number, const std::string& proposal) {
  std::string out("\n");
  out.append(std::to_string(number)).append("/").append(std::to_string(question_count));
  out.append("  ").append(question.title).append("\n");
  out.append("     ").append(question.meaning).append("\n");
  out.append("     Answers: ").append(question.examples).append("\n");
  return proposal.empty() ? out : out.append("     Enter: ").append(proposal).append("\n");
}

/// `before`: shown before the question.
void ask(const Question& question, std::size_t number, const Ask& ask, std::string before,
         Draft& draft) {
  const std::string proposal = question.proposal(draft);
  std::string text = before.append(text_of(question, number, proposal));
  while (true) {
    const std::optional<std::string> line = ask(text);
    if (!line) {
      refuse("the input ended at the question of " + std::string(question.option) +
             ": nothing is written");
    }
    const bool blank = line->find_first_not_of(" \t\r") == std::string::npos;
    if (blank && proposal.empty()) {
      text = "     This has no usual value: expected an answer\n";
      continue;
    }
    const std::string problem = take(question, draft, blank ? proposal : *line);
    if (problem.empty()) return;
    text.assign("     ").append(problem).append("\n");
  }
}

/// Where no person answers, a recording names the sensors; everything else is stated.
bool is_known(const Question& question, const Setup& setup) {
  return question.option == "--sensors" && setup.recorded != Measured{};
}

void note_missing(const Question& question, std::string& missing) {
  missing.append(missing.empty() ? "" : "; ");
  missing.append(question.option).append(" (").append(question.examples).append(")");
}

}  // namespace

Draft interviewed(const Setup& setup) {
  Draft draft;
  draft.measured = setup.recorded;
  std::string before(introduction);
  std::string missing;
  for (std::size_t i = 0; i < question_count; ++i) {
    const Question& question = questions()[i];
    const auto given = setup.answers.find(std::string(question.option));
    if (!question.applies(draft)) {
      if (given == setup.answers.end() || given->second == "none") continue;
      refuse(given->first + ": does not apply: expected it only " +
             (question.option == "--load-cell" ? "with a sensor friction_force and a free mass"
                                               : "where the motion is not imposed"));
    }
    if (given != setup.answers.end()) {
      const std::string problem = take(question, draft, given->second);
      if (!problem.empty()) refuse(given->first + ": " + problem);
    } else if (setup.ask) {
      ask(question, i + 1, setup.ask, std::exchange(before, ""), draft);
    } else if (is_known(question, setup)) {
      take(question, draft, question.proposal(draft));
    } else {
      note_missing(question, missing);
    }
  }
  if (!missing.empty()) {
    refuse("without a terminal every answer is an option; missing: " + missing);
  }
  return draft;
}

}  // namespace stickslip::interview
