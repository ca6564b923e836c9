#include "daemon/observer/layout.h"

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

}  // namespace

Sight sight_of(const Chain& chain, double age_s) {
  Sight sight;
  const auto see = [&sight](int at, double weight) {
    const auto i = static_cast<std::size_t>(sight.count++);
    sight.at[i] = at;
    sight.weight[i] = weight;
  };
  see(chain.reading, 1.0);
  if (chain.delays > 0) {
    const double each_s = chain.delay_s / chain.delays;
    for (int k = 0; k < chain.delays; ++k) {
      // What is late changes as its last section does.
      const bool last = k + 1 == chain.delays;
      see(chain.first_delay + 2 * k + 1, -each_s - (last ? age_s : 0.0));
    }
  } else if (age_s != 0.0 && !chain.sections.empty()) {
    const Section& last = chain.sections.back();
    if (last.second_order) {
      sight.bend_per_s = last.omega;
      see(chain.reading + 1, -age_s);
    } else if (chain.sections.size() > 1) {
      // A first-order section follows what the section before it delivers.
      const bool pair = chain.sections[chain.sections.size() - 2].second_order;
      sight.bend_per_s = last.omega;
      sight.weight[0] = 1.0 + age_s * last.omega;
      see(chain.reading - (pair ? 2 : 1), -age_s * last.omega);
    }
  }
  if (chain.hum >= 0) {
    see(chain.hum, std::cos(chain.hum_rad_s * age_s));
    if (age_s != 0.0) see(chain.hum + 1, std::sin(chain.hum_rad_s * age_s));
  }
  if (chain.offset >= 0) see(chain.offset, 1.0);
  return sight;
}

Channel drive_channel(const physics::Structure& structure) {
  return structure.excitation == Excitation::force ? Channel::drive_force
                                                   : Channel::base_displacement;
}

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
  const bool load_in_doubt = structure.loaded && model.normal_load->load_n.sigma > 0.0;
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
  layout.behind_chains = next;
  for (Channel channel : all_channels) {
    Chain& chain = layout.chain[index_of(channel)];
    if (!chain.used) continue;
    const physics::ReadingLaw<double>& law = laws.of[index_of(channel)];
    chain.delay_s = std::min(law.delay_s, physics::longest_delay_s);
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
