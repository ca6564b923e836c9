#include "observer/layout.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics/reading.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::FilterKind;
using physics::Kinetics;
using physics::NormalLoadLaw;

// A section of second order is a pure delay up to about 2 / delay rad/s: 80 Hz.
constexpr double most_in_a_section_s = 0.004;
static_assert(physics::longest_delay_s <= max_delays * most_in_a_section_s);

// Less than this is no delay.
constexpr double least_delay_s = 1.0e-7;
// How fast a reading without filters is thought to turn: with the ring of a load cell.
constexpr double unfiltered_rad_s = 2.0 * std::numbers::pi * 20.0;

// In the order in which physics::FilterChain lays its sections.
std::vector<Section> sections_of(const physics::Sensor& sensor) {
  std::vector<Section> sections;
  for (const physics::Filter& filter : sensor.filters) {
    const int order = filter.kind == FilterKind::first_order_lowpass ? 1 : filter.order;
    const double omega = 2.0 * std::numbers::pi * filter.cutoff_hz;
    if (order % 2 == 1) sections.push_back({false, omega, 0.0});
    for (int k = 0; k < order / 2; ++k) {
      const double angle = std::numbers::pi * (2 * k + 1) / (2.0 * order);
      sections.push_back({true, omega, 2.0 * std::sin(angle) * omega});
    }
  }
  return sections;
}

// `by` times the rate at which a chain's output changes; whether states tell it.
bool see_rate(const Chain& chain, double by, Sight& sight) {
  if (chain.sections.empty()) {
    if (chain.input_rate >= 0) sight.see(chain.input_rate, by);
    return chain.input_rate >= 0;
  }
  const Section& last = chain.sections.back();
  if (last.second_order) {
    sight.see(chain.reading + 1, by);
    return true;
  }
  int input = chain.input;
  if (chain.sections.size() > 1) {
    const bool pair = chain.sections[chain.sections.size() - 2].second_order;
    input = chain.reading - (pair ? 2 : 1);
  }
  if (input < 0) return false;
  sight.see(input, by * last.omega);
  sight.see(chain.reading, -by * last.omega);
  return true;
}

// `by` times what a chain and its delay delivered `age_s` ago.
void see_output(const Chain& chain, double by, double age_s, Sight& sight) {
  sight.see(chain.reading, by);
  const double each_s = chain.delays > 0 ? chain.delay_s / chain.delays : 0.0;
  for (int k = 0; k < chain.delays; ++k) sight.see(chain.first_delay + 2 * k + 1, -by * each_s);
  if (age_s == 0.0) return;
  const bool known = see_rate(chain, -by * age_s, sight);
  // A section's rate changes as its equation says (reading_states.cpp).
  const double back = by * age_s * each_s;
  for (int k = 0; k < chain.delays; ++k) {
    const int value = chain.first_delay + 2 * k;
    const double stiffness = 12.0 / (each_s * each_s);
    sight.see(chain.reading, back * stiffness);
    for (int i = 0; i < k; ++i) {
      sight.see(chain.first_delay + 2 * i + 1, -back * stiffness * each_s);
    }
    sight.see(value, -back * stiffness);
    sight.see(value + 1, -back * 6.0 / each_s);
  }
  if (known || chain.delays > 0) {
    const double bend_per_s =
        chain.sections.empty() ? unfiltered_rad_s : chain.sections.back().omega;
    sight.bend_per_s = std::max(sight.bend_per_s, bend_per_s);
  }
}

}  // namespace

void Sight::see(int state, double by) {
  const auto end = at.begin() + count;
  const auto place = static_cast<std::size_t>(std::find(at.begin(), end, state) - at.begin());
  if (place == static_cast<std::size_t>(count)) at[static_cast<std::size_t>(count++)] = state;
  weight[place] += by;
}

Sight sight_of(const Layout& layout, Channel channel, double age_s) {
  const Chain& chain = layout.of(channel);
  Sight sight;
  // A leak is as old as the reading that it is in.
  if (chain.leak_from && layout.of(*chain.leak_from).used) {
    const Chain& from = layout.of(*chain.leak_from);
    see_output(from, chain.leak, age_s + std::min(0.0, from.delay_s), sight);
  }
  see_output(chain, 1.0, age_s, sight);
  sight.moving = sight.count;
  if (chain.hum >= 0) {
    sight.see(chain.hum, std::cos(chain.hum_rad_s * age_s));
    if (age_s != 0.0) sight.see(chain.hum + 1, std::sin(chain.hum_rad_s * age_s));
  }
  if (chain.offset >= 0) sight.see(chain.offset, 1.0);
  return sight;
}

Channel drive_channel(const physics::Structure& structure) {
  return structure.excitation == Excitation::force ? Channel::drive_force
                                                   : Channel::base_displacement;
}

namespace {

// What goes into the first sections of chains, where a state holds it.
void connect(Layout& layout, const physics::Structure& structure) {
  Chain& displacement = layout.chain[index_of(Channel::displacement)];
  displacement.input = layout.rig[physics::state::x];
  displacement.input_rate = layout.rig[physics::state::v];
  Chain& velocity = layout.chain[index_of(Channel::velocity)];
  if (displacement.sections.empty()) {
    velocity.input = layout.rig[physics::state::v];
  } else if (displacement.sections.back().second_order) {
    velocity.input = displacement.reading + 1;
  }
  Chain& drive = layout.chain[index_of(drive_channel(structure))];
  drive.input = layout.drive;
  drive.input_rate = layout.drive + 1;
  if (layout.load_rate < 0) return;
  Chain& load = layout.chain[index_of(Channel::normal_load)];
  load.input = layout.load;
  load.input_rate = layout.load_rate;
}

}  // namespace

Layout layout_of(const physics::Model& model, const physics::Rig& rig, std::string& reason,
                 const physics::ReadingLaws<double>& laws) {
  Layout layout;
  layout.rig.fill(-1);
  const physics::Structure& structure = rig.structure();
  if (structure.excitation == Excitation::imposed) {
    reason =
        "the observer follows rigs with a force balance; with oscillator.excitation = \"imposed\" "
        "the motion is given and friction_force is f itself";
    return layout;
  }

  for (int i = 0; i < physics::max_rig_states; ++i) {
    if (rig.has_state(i)) layout.rig[static_cast<std::size_t>(i)] = layout.core++;
  }
  if (structure.friction) {
    layout.mu = layout.core++;
    if (structure.kinetics == Kinetics::relaxing && model.friction.rate_per_s.sigma > 0.0) {
      layout.log_rate = layout.core++;
    }
  }
  const bool measured = structure.loaded && structure.load_law == NormalLoadLaw::measured;
  // A channel that leaks into another one has to be a state, even where it is known.
  const bool load_leaks = std::any_of(laws.of.begin(), laws.of.end(), [](const auto& law) {
    return law.leak_from == Channel::normal_load;
  });
  const bool load_in_doubt =
      structure.loaded && (model.normal_load->load_n.sigma > 0.0 || load_leaks);
  if (measured) {
    layout.load = layout.core++;
    layout.load_rate = layout.core++;
  } else if (load_in_doubt) {
    layout.load = layout.core++;
  }
  layout.drive = layout.core;
  layout.core += 4;

  int next = layout.core;
  if (structure.friction) {
    layout.friction = next++;
    layout.theta = structure.kinetics == Kinetics::relaxing
                       ? layout.rig[static_cast<std::size_t>(physics::state::contact)]
                       : next++;
  }
  const auto lay = [&](Channel channel) {
    Chain& chain = layout.chain[index_of(channel)];
    chain.used = true;
    chain.sections = sections_of(model.sensors[index_of(channel)]);
    chain.first = next;
    for (const Section& section : chain.sections) chain.count += section.second_order ? 2 : 1;
    if (chain.sections.empty()) chain.count = 1;
    next += chain.count;
    const bool last_is_first_order = !chain.sections.empty() && !chain.sections.back().second_order;
    chain.reading = next - (chain.sections.empty() || last_is_first_order ? 1 : 2);
  };
  lay(Channel::displacement);
  lay(Channel::velocity);
  if (structure.friction) lay(Channel::friction_force);
  // A load that is known exactly has nothing to learn from its sensor.
  if (structure.loaded && (layout.load >= 0 || structure.load_law == NormalLoadLaw::wedge)) {
    lay(Channel::normal_load);
  }
  lay(drive_channel(structure));
  connect(layout, structure);
  layout.behind_chains = next;
  for (Channel channel : all_channels) {
    Chain& chain = layout.chain[index_of(channel)];
    if (!chain.used) continue;
    const physics::ReadingLaw<double>& law = laws.of[index_of(channel)];
    // No more than the simulator remembers.
    chain.delay_s = std::clamp(law.delay_s, -physics::longest_delay_s, physics::longest_delay_s);
    if (std::abs(chain.delay_s) < least_delay_s) chain.delay_s = 0.0;
    chain.leak_from = law.leak_from;
    chain.leak = law.leak;
    chain.delays = static_cast<int>(std::ceil(std::max(0.0, chain.delay_s) / most_in_a_section_s));
    chain.first_delay = next;
    next += 2 * chain.delays;
    // In the units of the reading once it has been put right.
    chain.hum_rad_s = 2.0 * std::numbers::pi * law.hum_frequency_hz;
    chain.hum_size = std::abs(law.hum_amplitude / law.gain);
    if (chain.hum_rad_s > 0.0 && chain.hum_size > 0.0) {
      chain.hum = next;
      next += 2;
    }
    chain.offset_per_s = std::abs(law.drift_per_s / law.gain);
    if (chain.offset_per_s > 0.0) chain.offset = next++;
  }
  layout.count = next;

  for (Channel channel : all_channels) {
    const Chain& chain = layout.of(channel);
    if (chain.sections.size() <= physics::max_filter_sections) continue;
    reason = "the " + std::string(info(channel).stem) + " channel has " +
             std::to_string(chain.sections.size()) + " filter sections, of which there may be " +
             std::to_string(physics::max_filter_sections) + ": declare fewer in [sensors]";
  }
  for (Channel channel : all_channels) {
    const Chain& chain = layout.of(channel);
    Sight ignored;
    if (!chain.used || chain.delay_s >= 0.0 || see_rate(chain, 1.0, ignored)) continue;
    reason = "the " + std::string(info(channel).stem) +
             " channel is early, and no state tells how fast its reading changes: declare in "
             "[[physics]] that the others are late";
  }
  if (layout.count > max_states) {
    reason =
        "the model needs " + std::to_string(layout.count) +
        " filter states, the observer has room for " + std::to_string(max_states) +
        ": declare lower filter orders in [sensors], or fewer and shorter faults of channels in "
        "[[physics]]";
  }
  return layout;
}

}  // namespace stickslip::observer
