// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/observer_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "diagnosis/live_check.h"
#include "observer/smoother.h"
#include "tests/benchmark/estimate_statistics.h"
#include "tests/benchmark/observer_runs.h"

namespace stickslip::quality {

namespace {

using observer::FrictionEstimate;
using observer::Quantity;
using physics::RigTruth;

bool has(const FrictionEstimate& e, Quantity quantity) {
  const auto* end = e.quantities.begin() + e.used;
  return std::find(e.quantities.begin(), end, quantity) != end;
}

// The truth of a recording that estimates are compared with.
struct Truth {
  std::span<const RigTruth> states;
  bool friction = false;
  double mu = 0.0;
  double sticking_below_m_s = 0.0;
};

Truth truth_of(const concealment::Case& recorded) {
  const auto& parameters = recorded.truth.parameters;
  const auto mu = parameters.find("friction.mu");
  // A set-valued contact at rest has no slip at all.
  constexpr double rest_m_s = 1.0e-6;
  return {.states = recorded.states,
          .friction = mu != parameters.end(),
          .mu = mu != parameters.end() ? mu->second : 0.0,
          .sticking_below_m_s =
              std::max(rest_m_s, recorded.declared.friction.transition_speed_m_s.value)};
}

// Accumulates the estimates of one recording, in order.
class Accumulator {
 public:
  Accumulator(const Truth& truth, double period_s)
      : truth_(truth),
        nees_stride_(std::max<std::size_t>(1, static_cast<std::size_t>(0.1 / period_s))) {}

  /// `k`: frame of the estimate.
  void add(const FrictionEstimate& e, std::size_t k);
  EstimatorQuality result() const;

 private:
  void add_friction(const FrictionEstimate& e, const RigTruth& t);

  Truth truth_;
  std::size_t nees_stride_;
  std::size_t good_ = 0;
  RelativeError force_, theta_, slip_;
  Coverage force_coverage_, theta_coverage_, slip_coverage_, mu_coverage_, load_coverage_;
  double nees_sum_ = 0.0;
  std::size_t nees_count_ = 0;
  std::size_t nees_inside_ = 0;
  std::vector<Scored> sticking_;
  EstimatorQuality out_;
};

void Accumulator::add(const FrictionEstimate& e, std::size_t k) {
  out_.restarts = std::max(out_.restarts, e.restarts);
  if (!e.valid) return;
  const RigTruth& t = truth_.states[k];
  if (truth_.friction && good_ % nees_stride_ == 0) {
    const double nees = runs::nees_of(e, t, truth_.mu);
    nees_sum_ += nees;
    ++nees_count_;
    if (runs::inside_bounds(nees)) ++nees_inside_;
  }
  ++good_;
  slip_.add(e.slip_velocity_m_s, t.slip_velocity_m_s);
  slip_coverage_.add(e.slip_velocity_m_s, e.slip_velocity_std_m_s, t.slip_velocity_m_s);
  if (has(e, Quantity::normal_load)) {
    load_coverage_.add(e.normal_load_n, e.standard_deviation(Quantity::normal_load),
                       t.normal_load_n);
  }
  if (truth_.friction) add_friction(e, t);
}

void Accumulator::add_friction(const FrictionEstimate& e, const RigTruth& t) {
  force_.add(e.friction_force_n, t.friction_force_n);
  theta_.add(e.theta, t.theta);
  force_coverage_.add(e.friction_force_n, e.standard_deviation(Quantity::friction_force),
                      t.friction_force_n);
  theta_coverage_.add(e.theta, e.standard_deviation(Quantity::theta), t.theta);
  const double mu_std = e.standard_deviation(Quantity::mu);
  mu_coverage_.add(e.mu, mu_std, truth_.mu);
  out_.final_mu_covered = covers(e.mu, mu_std, truth_.mu);
  const double size =
      std::isfinite(e.theta) ? std::abs(e.theta) : std::numeric_limits<double>::infinity();
  out_.largest_theta = std::max(out_.largest_theta, size);
  sticking_.push_back({e.sticking, std::abs(t.slip_velocity_m_s) < truth_.sticking_below_m_s});
}

EstimatorQuality Accumulator::result() const {
  EstimatorQuality out = out_;
  out.good_share = static_cast<double>(good_) / static_cast<double>(truth_.states.size());
  out.force = force_.value();
  out.theta = theta_.value();
  out.slip = slip_.value();
  out.force_coverage = force_coverage_.share();
  out.theta_coverage = theta_coverage_.share();
  out.slip_coverage = slip_coverage_.share();
  out.mu_coverage = mu_coverage_.share();
  out.load_coverage = load_coverage_.share();
  if (nees_count_ > 0) {
    const auto count = static_cast<double>(nees_count_);
    out.nees = nees_sum_ / count / runs::nees_states;
    out.nees_inside = static_cast<double>(nees_inside_) / count;
  }
  out.auc = area_under_curve(sticking_);
  return out;
}

RecordingQuality described(const concealment::Case& recorded) {
  RecordingQuality out;
  out.name = recorded.truth.name;
  out.world = recorded.truth.world;
  out.duration_s = recorded.truth.duration_s;
  if (!recorded.truth.effects.empty()) out.effect = recorded.truth.effects.front().id;
  return out;
}

}  // namespace

RecordingQuality quality_of(const concealment::Case& recorded) {
  RecordingQuality out = described(recorded);
  const std::vector<Frame>& frames = recorded.recording.frames;
  const double period_s = protocol::median_period_s(frames);
  observer::FrictionObserver filter(recorded.declared, period_s);
  out.unsupported = filter.unsupported();
  if (!out.unsupported.empty()) return out;
  const Truth truth = truth_of(recorded);
  out.by_hand = estimates_by_hand(recorded.recording, recorded.declared, recorded.states,
                                  truth.sticking_below_m_s);
  Accumulator filtered(truth, period_s);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    filtered.add(filter.update(frames[k]), k);
  }
  out.filter = filtered.result();
  Accumulator smoothed(truth, period_s);
  observer::smooth(recorded.declared, period_s, frames, [&](const FrictionEstimate& e) {
    smoothed.add(e, static_cast<std::size_t>(e.sequence));
  });
  out.smoother = smoothed.result();
  out.alarms = false_alarms_of(recorded).alarms;
  return out;
}

namespace {

// A relation with the channel of a sensor, against the hidden effect.
bool is_right(physics::Relation relation, Channel channel, const concealment::TrueEffect& effect) {
  const auto& right = effect.relations;
  if (std::find(right.begin(), right.end(), physics::name_of(relation)) == right.end()) {
    return false;
  }
  return relation != physics::Relation::sensor || !effect.channel || channel == *effect.channel;
}

// Checks a recording as the daemon does, every quarter of a second. `checked` is called after each
// check with the time of its last frame [s], and returns false to end.
template <class Checked>
void run_live_check(const concealment::Case& recorded, diagnosis::LiveCheck& check,
                    Checked&& checked) {
  const std::vector<Frame>& frames = recorded.recording.frames;
  const double duration_s = frames.back().time_s();
  std::size_t end = 0;
  for (double time_s = diagnosis::LiveCheck::every_s; time_s <= duration_s;
       time_s += diagnosis::LiveCheck::every_s) {
    while (end < frames.size() && frames[end].time_s() < time_s) ++end;
    const auto latest = diagnosis::latest_span(std::span(frames).first(end));
    if (latest.empty()) continue;
    check.update(latest);
    if (!checked(time_s)) return;
  }
}

Explained explained_of(const diagnosis::LiveVerdict& verdict,
                       const concealment::TrueEffect& effect) {
  Explained out;
  out.certain = verdict.is_certain;
  if (verdict.explanations.empty()) return out;
  const diagnosis::Explanation& first = verdict.explanations.front();
  out.right = is_right(first.relation, first.channel.value_or(Channel::displacement), effect);
  out.probability = first.probability;
  out.effect = first.name;
  return out;
}

}  // namespace

RecordingQuality false_alarms_of(const concealment::Case& recorded) {
  RecordingQuality out = described(recorded);
  diagnosis::LiveCheck check(recorded.declared);
  run_live_check(recorded, check, [](double) { return true; });
  out.alarms = check.verdict().alarms;
  return out;
}

RecordingQuality live_check_of(const concealment::Case& recorded) {
  RecordingQuality out = described(recorded);
  diagnosis::LiveCheck check(recorded.declared);
  const concealment::TrueEffect& effect = recorded.truth.effects.front();
  run_live_check(recorded, check, [&](double time_s) {
    if (!check.wants_explanation()) return true;
    check.explain();
    const Explained explained = explained_of(check.verdict(), effect);
    if (!out.notice) {
      out.notice = Notice{.after_s = time_s, .at_once = explained, .at_last = {}};
    }
    out.notice->at_last = explained;
    return !check.verdict().is_final;
  });
  out.alarms = check.verdict().alarms;
  return out;
}

}  // namespace stickslip::quality
