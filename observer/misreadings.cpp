#include "observer/misreadings.h"

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

Misreadings::Misreadings(const physics::ReadingLaws<double>& laws) : laws_(laws) {
  stretch_.fill(1.0);
}

void Misreadings::leave_out_limited(Frame& frame, const PerChannel& variance) const {
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    const double limit = laws_.of[i].limit;
    if (!(limit > 0.0) || !frame.has(channel)) continue;
    const double margin = std::max(margin_sigmas * std::sqrt(variance[i]), margin_share * limit);
    if (std::abs(frame[channel]) > limit - margin) frame.invalidate(channel);
  }
}

void Misreadings::take_back(Frame& frame, PerChannel& variance) {
  for (Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    const std::size_t i = index_of(channel);
    const auto righted = physics::put_right(laws_.of[i], frame[channel]);
    if (!righted) {
      frame.invalidate(channel);
      continue;
    }
    frame.set(channel, righted->value);
    variance[i] *= righted->slope * righted->slope;
    stretch_[i] = std::abs(righted->slope);
  }
}

}  // namespace stickslip::observer
