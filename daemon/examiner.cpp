#include "daemon/examiner.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

namespace stickslip::daemon {

namespace {

// An alarm comes within ten seconds of what it is about, and is examined a few seconds later; more
// for a simulated rig that runs faster than time.
constexpr std::int64_t remembered_ns = 40'000'000'000;
// Nothing is said by a suspect that explains the readings hardly better than the model does.
constexpr double least_gain = 5.0;

std::string percent(double probability) {
  char text[16];
  std::snprintf(text, sizeof text, "%.0f %%", 100.0 * std::clamp(probability, 0.0, 1.0));
  return text;
}

}  // namespace

Event event_of(const Finding& finding) {
  Event out;
  out.severity = Severity::warning;
  out.time_ns = finding.verdict.reported_ns;
  const auto& found = finding.explanations;
  if (found.empty() || found.front().log_likelihood < least_gain) {
    out.code = "model_unexplained";
    out.message =
        "none of the usual suspects explains why the rig no longer follows its model: diagnose the "
        "recording";
    return out;
  }
  out.code = "model_explained";
  const observer::Explanation& first = found.front();
  out.message = "why the rig no longer follows its model: " + first.words + " (" +
                std::string(physics::name_of(first.relation)) + ", " + percent(first.probability) +
                ")";
  if (found.size() > 1 && found[1].probability >= 0.05) {
    out.message += ", or " + found[1].words + " (" + std::string(name_of(found[1].relation)) +
                   ", " + percent(found[1].probability) + ")";
  }
  return out;
}

Examiner::Examiner(const physics::Model& believed, double period_s)
    : believed_(believed), period_s_(period_s) {}

void Examiner::ask(const ModelVerdict& verdict) {
  const std::lock_guard lock(lock_);
  question_ = verdict;
}

std::optional<Finding> Examiner::next_finding() {
  const std::lock_guard lock(lock_);
  if (findings_.empty()) return std::nullopt;
  Finding out = std::move(findings_.front());
  findings_.pop_front();
  return out;
}

std::optional<ModelVerdict> Examiner::due_question(std::int64_t now_ns) {
  const std::lock_guard lock(lock_);
  if (!question_ || now_ns < observer::explained_until_ns(*question_)) return std::nullopt;
  return std::exchange(question_, std::nullopt);
}

Put Examiner::put_block(std::span<const Sample> block) {
  for (const Sample& sample : block) {
    // The source's time may begin anew.
    if (!frames_.empty() && sample.frame.time_ns <= frames_.back().time_ns) frames_.clear();
    frames_.push_back(sample.frame);
  }
  while (frames_.front().time_ns < frames_.back().time_ns - remembered_ns) frames_.pop_front();
  if (const auto question = due_question(frames_.back().time_ns)) answer(*question);
  return Put::done;
}

void Examiner::finish() {
  const auto question = due_question(std::numeric_limits<std::int64_t>::max());
  if (question) answer(*question);
}

void Examiner::answer(const ModelVerdict& verdict) {
  const std::vector<Frame> frames(frames_.begin(), frames_.end());
  Finding finding{verdict, observer::explanations_of(believed_, period_s_, frames, verdict)};
  const std::lock_guard lock(lock_);
  findings_.push_back(std::move(finding));
}

}  // namespace stickslip::daemon
