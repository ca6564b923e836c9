// Finds out what has changed in a rig that no longer follows its model: keeps the latest frames
// and, when the model check has raised an alarm, has them gone through again for each suspect.
// A consumer of frames like publisher and recorder, with a thread of its own, which a question
// keeps busy for about a second.
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

/// What an alarm means.
struct Finding {
  ModelVerdict verdict;                             ///< the alarm
  std::vector<observer::Explanation> explanations;  ///< most probable first; may be empty
};

/// The finding in words: "model_explained" with the first suspect, the one that is hardest to tell
/// from it, and the probabilities; or "model_unexplained" where nothing explains the frames.
Event event_of(const Finding& finding);

class Examiner final : public Sink {
 public:
  /// `period_s`: of the frames, > 0.
  Examiner(const physics::Model& believed, double period_s);

  /// Any thread: what does this alarm mean? Answered when enough frames have followed it. A later
  /// question replaces one that still waits.
  void ask(const ModelVerdict& verdict);

  /// Any thread: the next answer, oldest first.
  std::optional<Finding> next_finding();

  Put put_block(std::span<const Sample> block) override;
  Put put_estimate(const Estimate&) override { return Put::done; }
  Put put_message(const Message&) override { return Put::done; }
  /// A question that still waits is answered with what there is.
  void finish() override;

 private:
  void answer(const ModelVerdict& verdict);
  std::optional<ModelVerdict> due_question(std::int64_t now_ns);

  physics::Model believed_;
  double period_s_;
  std::deque<Frame> frames_;
  std::mutex lock_;  // neither side of it is the loop
  std::optional<ModelVerdict> question_;
  std::deque<Finding> findings_;
};

}  // namespace stickslip::daemon
