// SPDX-License-Identifier: Apache-2.0
#include "observer/continuation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "observer/kalman_filter.h"

namespace stickslip::observer {

namespace {

namespace state = physics::state;

// A parameter that differs from the new model by more than these standard deviations was
// estimated by equations that the new model corrects.
constexpr double agreement_sigmas = 3.0;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

class Pairs {
 public:
  Pairs() { out.fill(no_correspondence); }
  void add(int now, int before) {
    if (now >= 0 && before >= 0) out[at(now)] = before;
  }
  void add(int now, int before, int count) {
    for (int k = 0; now >= 0 && before >= 0 && k < count; ++k) add(now + k, before + k);
  }
  Correspondence out;
};

bool is_same_filter(const Chain& a, const Chain& b) {
  return a.used && b.used && a.count == b.count &&
         std::equal(
             a.sections.begin(), a.sections.end(), b.sections.begin(), b.sections.end(),
             [](const Section& x, const Section& y) { return x.second_order == y.second_order; });
}

void pair_chains(const Layout& now, const Layout& before, Pairs& pairs) {
  for (const Channel channel : all_channels) {
    const Chain& a = now.of(channel);
    const Chain& b = before.of(channel);
    if (!a.used || !b.used) continue;
    if (is_same_filter(a, b)) pairs.add(a.first, b.first, a.count);
    if (a.delays == b.delays) pairs.add(a.first_delay, b.first_delay, 2 * a.delays);
    pairs.add(a.hum, b.hum, 2);
    pairs.add(a.offset, b.offset);
  }
}

// Without terms the filters of a constant load have no states, with them they do.
void pair_constant_load(const FilterStates& now, const FilterStates& before, Pairs& pairs) {
  const Chain& chain = now.layout.of(Channel::normal_load);
  const Chain& constant = before.layout.of(Channel::normal_load);
  if (!chain.used || chain.count == 0 || !constant.used || constant.count > 0) return;
  const auto terms = now.rig.terms();
  const bool varies = std::any_of(terms.begin(), terms.end(), [](const physics::BoundTerm& term) {
    return (term.hooks & physics::hook::load) != 0;
  });
  if (varies || now.rig.structure().load_law != physics::NormalLoadLaw::constant) return;
  int next = chain.first;
  if (chain.sections.empty()) pairs.add(next, constant.reading);
  for (const Section& section : chain.sections) {
    pairs.add(next++, constant.reading);
    if (section.second_order) pairs.out[at(next++)] = known_zero;
  }
}

// An effect of the catalogue is one object; formulas of two model files are different effects.
void pair_effect_states(const FilterStates& now, const FilterStates& before, Pairs& pairs) {
  for (const physics::BoundTerm& term : now.rig.terms()) {
    for (const physics::BoundTerm& other : before.rig.terms()) {
      if (term.effect != other.effect || term.place != other.place) continue;
      for (int k = 0; k < term.effect->state_count(); ++k) {
        pairs.add(now.layout.rig[at(term.first_state + k)],
                  before.layout.rig[at(other.first_state + k)]);
      }
    }
  }
}

void pair_parameters(const FilterStates& now, const FilterStates& before, Pairs& pairs) {
  const physics::Structure& a = now.rig.structure();
  const physics::Structure& b = before.rig.structure();
  if (a.loaded == b.loaded) pairs.add(now.layout.mu, before.layout.mu);
  pairs.add(now.layout.log_rate, before.layout.log_rate);
  const bool measured = now.layout.load_rate >= 0;
  if (measured == (before.layout.load_rate >= 0)) {
    pairs.add(now.layout.load, before.layout.load);
    pairs.add(now.layout.load_rate, before.layout.load_rate);
  }
}

}  // namespace

Correspondence corresponding_states(const FilterStates& now, const FilterStates& before) {
  Pairs pairs;
  const physics::Structure& a = now.rig.structure();
  const physics::Structure& b = before.rig.structure();
  if (a.excitation != b.excitation) return pairs.out;
  for (const int each : {state::x, state::v, state::y, state::u}) {
    pairs.add(now.layout.rig[at(each)], before.layout.rig[at(each)]);
  }
  if (a.kinetics == b.kinetics) {
    pairs.add(now.layout.rig[at(state::contact)], before.layout.rig[at(state::contact)]);
  }
  pairs.add(now.layout.theta, before.layout.theta);
  pairs.add(now.layout.friction, before.layout.friction);
  pairs.add(now.layout.drive, before.layout.drive, 4);
  pair_parameters(now, before, pairs);
  pair_effect_states(now, before, pairs);
  pair_chains(now.layout, before.layout, pairs);
  pair_constant_load(now, before, pairs);
  return pairs.out;
}

// Where a parameter of the earlier filter contradicts the model, the pair is dissolved.
void KalmanFilter::keep_agreeing(const KalmanFilter& before, Correspondence& from) const {
  for (const int each : {layout_.mu, layout_.log_rate, layout_.load_rate < 0 ? layout_.load : -1}) {
    if (each < 0 || from[at(each)] < 0) continue;
    const int other = from[at(each)];
    const double difference = before.mean_[other] - mean_[each];
    const double variance = before.total_covariance(other, other) + covariance_(each, each);
    const bool agrees = difference * difference <= agreement_sigmas * agreement_sigmas * variance;
    if (agrees) continue;  // NaN does not
    std::replace(from.begin(), from.end(), other, no_correspondence);
  }
}

double KalmanFilter::total_covariance(int row, int column) const {
  double sum = covariance_(row, column);
  for (int g = 0; g < covariance_.groups(); ++g) {
    sum += (covariance_.sensitivity(row, g) * covariance_.sensitivity(column, g)).sum();
  }
  return sum;
}

// The contribution of the earlier model's considered parameters becomes part of the covariance of
// the states: the uncertainty that is reported is the same before and after, and the sensitivities
// to the parameters of this model build up as after any start.
void KalmanFilter::take_states(const KalmanFilter& before, const Correspondence& from) {
  for (int i = 0; i < layout_.count; ++i) {
    if (from[at(i)] == no_correspondence) continue;
    mean_[i] = from[at(i)] >= 0 ? before.mean_[from[at(i)]] : 0.0;
    for (int j = i; j < layout_.count; ++j) {
      if (from[at(j)] == no_correspondence) continue;
      const bool uncertain = from[at(i)] >= 0 && from[at(j)] >= 0;
      covariance_.set(i, j, uncertain ? before.total_covariance(from[at(i)], from[at(j)]) : 0.0);
    }
  }
}

Continuation KalmanFilter::continue_from(const KalmanFilter& before) {
  Continuation out;
  estimate_.restarts = before.estimate_.restarts;
  estimate_.refusals = before.estimate_.refusals;
  if (!unsupported_.empty() || !before.unsupported_.empty() || !before.started_) return out;
  noise_->continue_from(*before.noise_);
  reinitialise(before.frame_);  // states without a correspondence
  if (!started_) return out;
  Correspondence from = corresponding_states({layout_, rig_}, {before.layout_, before.rig_});
  keep_agreeing(before, from);
  take_states(before, from);
  origin_ns_ = before.origin_ns_;
  time_ns_ = before.time_ns_;
  since_mechanical_s_ = before.since_mechanical_s_;
  since_drive_s_ = before.since_drive_s_;
  read_at_ns_ = before.read_at_ns_;
  has_read_ = before.has_read_;
  frame_ = before.frame_;

  const auto is_kept = [&from](int state) {
    return state >= 0 && from[at(state)] != no_correspondence;
  };
  out.mu = is_kept(layout_.mu);
  out.gamma = is_kept(layout_.log_rate);
  out.load = is_kept(layout_.load);
  out.motion = is_kept(layout_.rig[at(state::x)]) || is_kept(layout_.drive);
  out.settled = true;
  for (int i = 0; i < layout_.count; ++i) {
    is_kept(i) ? ++out.kept : ++out.anew;
    const bool is_parameter = i == layout_.mu || i == layout_.log_rate || i == layout_.load;
    out.settled = out.settled && (is_parameter || is_kept(i));
  }
  // States of the motion that start anew need the time that they need at any start.
  if (out.settled) since_start_s_ = before.since_start_s_;
  return out;
}

}  // namespace stickslip::observer
