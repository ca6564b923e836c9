// Cause of an alarm of the model check: keeps the latest frames and, after an alarm, evaluates them
// again for each candidate effect. A consumer of frames like publisher and recorder; its thread is
// busy for about a second with each analysis.
#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "daemon/event.h"
#include "daemon/stream.h"
#include "observer/explanation.h"
#include "physics/model.h"

namespace stickslip::daemon {

/// Result of an analysis.
struct Finding {
  ModelVerdict verdict;                             ///< the alarm
  std::vector<observer::Explanation> explanations;  ///< most probable first; may be empty
};

/// "model_explained", with the most probable explanation, the closest alternative and their
/// probabilities; or "model_unexplained" if no candidate explains the frames.
Event event_of(const Finding& finding);

class AlarmAnalyser final : public Sink {
 public:
  /// `model`: what the observer assumes. `period_s`: of the frames, > 0.
  AlarmAnalyser(const physics::Model& model, double period_s);

  /// Any thread: requests the analysis of an alarm, which begins when enough frames have followed
  /// it. Replaces an earlier request that is still pending.
  void request(const ModelVerdict& verdict);

  /// Any thread: the next result, oldest first.
  std::optional<Finding> next_finding();

  WriteResult write_block(std::span<const Sample> block) override;
  WriteResult write_estimate(const Estimate&) override { return WriteResult::ok; }
  WriteResult write_message(const Message&) override { return WriteResult::ok; }
  /// Analyses a pending alarm with the frames there are.
  void finish() override;

 private:
  void analyse(const ModelVerdict& verdict);
  std::optional<ModelVerdict> due_request(std::int64_t now_ns);

  physics::Model model_;
  double period_s_;
  std::deque<Frame> frames_;
  std::mutex lock_;  // never taken by the loop
  std::optional<ModelVerdict> request_;
  std::deque<Finding> findings_;
};

}  // namespace stickslip::daemon
