#include "daemon/observer/misreadings.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "physics/effects/catalogue.h"
#include "physics/reading.h"
#include "physics/rig.h"

namespace stickslip::observer {

namespace {

// A reading this near to a limit may have been beyond it: of its noise, and of the limit, which is
// known no better.
constexpr double margin_sigmas = 3.0;
constexpr double margin_share = 0.002;

bool only_misreads(const physics::Term& term) {
  return physics::find_effect(term.id)->hooks() == physics::hook::reading;
}

}  // namespace

Followed followed(const physics::Model& declared) {
  const physics::Rig rig(declared);
  Followed out{declared, rig.numbers<double>(std::span(rig.parameter_values())).reading};
  std::erase_if(out.model.terms, only_misreads);
  if (out.laws.velocity_cutoff_hz > 0.0) {
    std::vector<physics::Filter>& filters = out.model.sensors[index_of(Channel::velocity)].filters;
    const bool declares_one =
        !filters.empty() && (filters.back().kind == physics::FilterKind::first_order_lowpass ||
                             filters.back().order == 1);
    if (declares_one) filters.pop_back();
    filters.push_back({physics::FilterKind::first_order_lowpass, 1, out.laws.velocity_cutoff_hz});
  }
  return out;
}

Misreadings::Misreadings(const physics::ReadingLaws<double>& laws)
    : laws_(laws), any_(laws.wrong), apart_(decltype(apart_)::Identity()) {
  stretch_.fill(1.0);
  for (Channel channel : all_channels) {
    const physics::ReadingLaw<double>& law = laws.of[index_of(channel)];
    if (!law.leak_from) continue;
    apart_(static_cast<int>(channel), static_cast<int>(*law.leak_from)) = law.leak;
  }
  apart_ = apart_.inverse().eval();
}

void Misreadings::take_back(Frame& frame, PerChannel& variance) {
  PerChannel alone{};
  PerChannel slope{};
  for (Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    const std::size_t i = index_of(channel);
    const physics::ReadingLaw<double>& law = laws_.of[i];
    const double margin =
        std::max(margin_sigmas * std::sqrt(variance[i]), margin_share * law.limit);
    const auto righted = physics::put_right(law, frame[channel], margin);
    if (!righted) {
      frame.invalidate(channel);
      continue;
    }
    alone[i] = righted->value;
    slope[i] = righted->slope;
  }
  const Frame known = frame;
  const PerChannel read = variance;
  for (Channel channel : all_channels) {
    if (!known.has(channel)) continue;
    const std::size_t i = index_of(channel);
    double sum = 0.0;
    variance[i] = 0.0;
    for (Channel other : all_channels) {
      const std::size_t j = index_of(other);
      const double share = apart_(static_cast<int>(i), static_cast<int>(j));
      if (share == 0.0) continue;
      if (!known.has(other)) frame.invalidate(channel);
      sum += share * alone[j];
      variance[i] += share * share * slope[j] * slope[j] * read[j];
    }
    if (frame.has(channel)) frame.set(channel, sum);
    stretch_[i] = std::abs(apart_(static_cast<int>(i), static_cast<int>(i)) * slope[i]);
  }
}

}  // namespace stickslip::observer
