// SPDX-License-Identifier: Apache-2.0
// Live model check: whether the last seconds of a running rig follow its model, by the fit, the
// candidates and the score of a diagnosis. The declared model is fitted to short windows of the
// latest frames; where its residuals exceed the noise, or its parameters their declared
// uncertainties, every effect of the catalogue is fitted to the same windows. Not for the real-time
// loop: a check takes 5 to 200 ms, an explanation 5 to 20 s.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/hypothesis.h"
#include "diagnosis/shooting.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::diagnosis {

struct FittedCandidate;

enum class LiveStatus : std::uint8_t {
  waiting,  ///< not enough frames or motion
  follows,  ///< the last seconds follow the model
  broken,   ///< they do not
};

/// "waiting", "follows", "broken"
std::string_view name_of(LiveStatus status);

/// One effect that may be missing.
struct Explanation {
  physics::Relation relation = physics::Relation::force_balance;
  std::optional<Channel> channel;  ///< of a sensor's error
  std::string name;                ///< "gain_error of velocity"
  std::string statement;           ///< a sentence with numbers
  double chi2 = 0.0;               ///< per sample with it; 1 is noise alone
  double probability = 0.0;        ///< relative to the other effects, 0 to 1
  bool agrees = true;              ///< with each measured channel by itself
};

struct LiveVerdict {
  LiveStatus status = LiveStatus::waiting;
  double chi2 = 0.0;   ///< of the last seconds, per sample; 1 is noise alone
  double limit = 0.0;  ///< largest that noise reaches
  /// Times of frames: begin of the first window that does not follow, and the alarm.
  std::int64_t since_ns = 0;
  std::int64_t reported_ns = 0;
  /// Most probable first, without those that a measured channel contradicts; empty until the first
  /// LiveCheck::explain.
  std::vector<Explanation> explanations;
  /// True if the first explanation leaves no more than noise does in 95 of 100 cases, and those
  /// with another relation (or another channel) are less probable than 5 % together.
  bool is_certain = false;
  bool is_final = false;     ///< no further explanation follows
  std::uint64_t alarms = 0;  ///< since construction

  /// Stretch of a recording to diagnose: from 20 s before the deviation to 10 s after it.
  std::int64_t from_ns() const { return since_ns - 20'000'000'000; }
  std::int64_t to_ns() const { return since_ns + 10'000'000'000; }
};

/// The status in one sentence.
std::string words_for(const LiveVerdict& verdict);

/// The explanations in one sentence: the probable cause, or the alternatives.
std::string cause_in_words(const LiveVerdict& verdict);

struct LiveCheckSettings {
  /// Mean time between false alarms of a rig that follows its model [days], > 0.
  double days_between_false_alarms = 30.0;
  Criteria criteria = {};
  int threads = 1;
  /// Checks and explanations end with Interrupted soon after a request, from any thread.
  std::stop_token stop = {};
};

/// Checks one rig.
class LiveCheck {
 public:
  /// Longest and least span of the frames of a check, and time between checks [s].
  static constexpr double span_s = 3.2;
  static constexpr double least_s = 1.5;
  static constexpr double every_s = 0.25;

  /// Throws std::invalid_argument for settings outside their range.
  explicit LiveCheck(const physics::Model& model, const LiveCheckSettings& settings = {});
  ~LiveCheck();

  /// Checks `frames`, the latest ones of the rig in order (see latest_span). True where the status
  /// has changed. Frames that cannot be compared with the model, as those of a rig at rest, make
  /// the status `waiting`.
  bool update(std::span<const Frame> frames);

  /// True after a deviation that the next check is to confirm.
  bool is_suspicious() const;

  /// True if the frames of the latest update are to be explained: at an alarm, and after 0.5, 1, 2,
  /// 4 and 8 s more for as long as no explanation is certain.
  bool wants_explanation() const;

  /// Explains the frames of the latest update that did not follow the model.
  void explain();

  const LiveVerdict& verdict() const { return verdict_; }

 private:
  struct Seconds;  // the frames of one check, prepared

  struct Outcome {
    double chi2 = 0.0;
    double limit = 0.0;
    bool follows = true;
    std::size_t first_bad = 0;  // window
  };

  Outcome outcome_of(const Seconds& seconds, const Fit& fit) const;
  Fit fitted(const Seconds& seconds) const;
  Fit fitted_from_declared(const Task& task) const;
  std::optional<Fit> other_fit_that_follows(const Seconds& seconds) const;
  Fit fitted_in_growing_windows(const Task& task, std::vector<double> z) const;
  std::vector<Fit> fits_at_misfit(Task& task) const;
  std::vector<FittedCandidate> candidates_for(const Seconds& seconds) const;
  double informative_share(const Seconds& seconds, const Fit& fit) const;
  std::vector<Explanation> explanations_of(const Seconds& seconds, const Fit& fit) const;
  bool agrees_with_channels(const Seconds& seconds, const FittedCandidate& each) const;
  bool set_status(LiveStatus status);
  void raise_alarm(const Seconds& seconds, const Outcome& outcome);
  void remember(const Seconds& seconds, const Fit& fit);
  std::vector<WindowState> remembered_states(const Seconds& seconds) const;

  physics::Model model_;
  LiveCheckSettings settings_;
  Hypothesis declared_;
  double deviate_;  // of a normal distribution, at the wished rate of false alarms

  // The latest fit, from which the next one starts: states by the time of their `warm` sample.
  std::vector<double> z_;
  std::vector<std::pair<std::int64_t, WindowState>> states_;
  int misfits_ = 0;  // in a row
  LiveVerdict verdict_;

  // The latest frames that do not follow the model, with their fit.
  std::unique_ptr<Seconds> unexplained_;
  Fit unexplained_fit_;
  std::int64_t explain_at_ns_ = 0;
  double explain_again_s_ = 0.0;
};

/// The frames of a check at the end of `frames`: from a multiple of LiveCheck::every_s in their
/// time, so that consecutive checks share windows. Empty where they span less than
/// LiveCheck::least_s.
std::span<const Frame> latest_span(std::span<const Frame> frames);

}  // namespace stickslip::diagnosis
