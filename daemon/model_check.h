// SPDX-License-Identifier: Apache-2.0
// Live model check of the frames: a consumer like publisher and recorder, with a thread of its own
// that checks the latest seconds every quarter of a second, or less often where that would take
// more than a quarter of a core. Neither the loop nor another consumer waits for it.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "daemon/event.h"
#include "daemon/stream.h"
#include "diagnosis/live_check.h"
#include "physics/model.h"

namespace stickslip::daemon {

using diagnosis::LiveVerdict;

/// "model_broken" with the stretch of the recording to diagnose, "model_follows". `utc_us`: now.
Event status_event(const LiveVerdict& verdict, std::int64_t now_ns, std::int64_t utc_us);

/// "model_explained" with the probable cause; "model_unexplained" while it is not certain.
Event explanation_event(const LiveVerdict& verdict, std::int64_t now_ns);

class ModelCheck final : public Sink {
 public:
  /// `model`: what the rig is expected to follow. Mean time between false alarms in days, > 0.
  /// `patience`: see finish(); none: without limit.
  ModelCheck(const physics::Model& model, double days_between_false_alarms,
             std::optional<std::chrono::steady_clock::duration> patience = std::nullopt);
  ~ModelCheck() override;

  /// Any thread: from the next frame on the rig is expected to follow this model. Explanations of
  /// the earlier model's deviations end; the status is `waiting` until the first check, and that
  /// the rig follows the new model is reported ("model_follows"). Alarms are counted on.
  void change_model(const physics::Model& model);

  /// Any thread: the next event, oldest first.
  std::optional<Event> next_event();

  /// Any thread.
  LiveVerdict verdict() const;

  WriteResult write_block(std::span<const Sample> block) override;
  WriteResult write_estimate(const Estimate&) override { return WriteResult::ok; }
  WriteResult write_message(const Message&) override { return WriteResult::ok; }
  /// Checks the last frames, and explains them where they do not follow the model, for as long as
  /// its patience lasts: the thread has what a busy machine leaves to it.
  void finish() override;

 private:
  void begin_with(const physics::Model& model);
  void run();
  bool check_until_the_end(std::vector<Frame>& frames);
  bool wait_for_frames(std::vector<Frame>& frames);
  void take_new_model();
  void show_verdict();
  void report_change(diagnosis::LiveStatus before, std::int64_t now_ns);
  void check(const std::vector<Frame>& frames);
  void rest(std::chrono::steady_clock::duration checked);
  void check_last(const std::vector<Frame>& frames);
  void publish(const Event& event);

  double days_between_false_alarms_;
  std::optional<std::chrono::steady_clock::duration> patience_;
  // Of the thread:
  std::optional<diagnosis::LiveCheck> check_;
  std::uint64_t earlier_alarms_ = 0;  // of the models before this one
  bool follows_is_new_ = false;       // if the model follows, that is to be reported
  mutable std::mutex lock_;           // of all below; never taken by the loop
  std::stop_source stop_;             // of the present check
  std::optional<physics::Model> new_model_;
  std::condition_variable wake_;
  std::deque<Frame> frames_;
  std::int64_t checked_ns_ = 0;  // time of the latest frame at the latest check
  std::chrono::steady_clock::time_point resting_until_;
  bool ending_ = false;
  bool gave_up_ = false;  // waiting for the end of a check
  bool ended_ = false;
  LiveVerdict verdict_;
  std::deque<Event> events_;
  std::thread thread_;
};

}  // namespace stickslip::daemon
