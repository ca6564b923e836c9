#include "daemon/alarm_analyser.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

namespace stickslip::daemon {

namespace {

// An alarm is raised within ten seconds of the change and analysed a few seconds later; longer for
// a simulated rig that runs faster than real time.
constexpr std::int64_t history_ns = 40'000'000'000;
// An explanation has to be at least this much more likely than the unchanged model (log
// likelihood).
constexpr double min_gain = 5.0;

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
  if (found.empty() || found.front().log_likelihood < min_gain) {
    out.code = "model_unexplained";
    out.message =
        "no known effect explains why the rig no longer follows its model: diagnose the recording";
    return out;
  }
  out.code = "model_explained";
  const observer::Explanation& first = found.front();
  out.message = "probable cause of the model mismatch: " + first.words + " (" +
                std::string(physics::name_of(first.relation)) + ", " + percent(first.probability) +
                ")";
  if (found.size() > 1 && found[1].probability >= 0.05) {
    out.message += ", or " + found[1].words + " (" + std::string(name_of(found[1].relation)) +
                   ", " + percent(found[1].probability) + ")";
  }
  return out;
}

AlarmAnalyser::AlarmAnalyser(const physics::Model& model, double period_s)
    : model_(model), period_s_(period_s) {}

void AlarmAnalyser::request(const ModelVerdict& verdict) {
  const std::lock_guard lock(lock_);
  request_ = verdict;
}

std::optional<Finding> AlarmAnalyser::next_finding() {
  const std::lock_guard lock(lock_);
  if (findings_.empty()) return std::nullopt;
  Finding out = std::move(findings_.front());
  findings_.pop_front();
  return out;
}

std::optional<ModelVerdict> AlarmAnalyser::due_request(std::int64_t now_ns) {
  const std::lock_guard lock(lock_);
  if (!request_ || now_ns < observer::explained_until_ns(*request_)) return std::nullopt;
  return std::exchange(request_, std::nullopt);
}

WriteResult AlarmAnalyser::write_block(std::span<const Sample> block) {
  for (const Sample& sample : block) {
    // A replayed source may start again.
    if (!frames_.empty() && sample.frame.time_ns <= frames_.back().time_ns) frames_.clear();
    frames_.push_back(sample.frame);
  }
  while (frames_.front().time_ns < frames_.back().time_ns - history_ns) frames_.pop_front();
  if (const auto verdict = due_request(frames_.back().time_ns)) analyse(*verdict);
  return WriteResult::ok;
}

void AlarmAnalyser::finish() {
  const auto verdict = due_request(std::numeric_limits<std::int64_t>::max());
  if (verdict) analyse(*verdict);
}

void AlarmAnalyser::analyse(const ModelVerdict& verdict) {
  const std::vector<Frame> frames(frames_.begin(), frames_.end());
  Finding finding{verdict, observer::explanations_of(model_, period_s_, frames, verdict)};
  const std::lock_guard lock(lock_);
  findings_.push_back(std::move(finding));
}

}  // namespace stickslip::daemon
