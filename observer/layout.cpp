// SPDX-License-Identifier: Apache-2.0
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

// A second-order section approximates a pure delay up to about 2 / delay rad/s: 80 Hz.
constexpr double longest_section_delay_s = 0.004;
static_assert(physics::longest_delay_s <= max_delays * longest_section_delay_s);

// Smaller delays are ignored.
constexpr double smallest_delay_s = 1.0e-7;
// Assumed bandwidth of a reading without filters: ringing of a load cell.
constexpr double unfiltered_rad_s = 2.0 * std::numbers::pi * 20.0;

// In the order of physics::FilterChain.
std::vector<Section> sections_of(const physics::Sensor& sensor) {
  std::vector<Section> sections;
  for (const physics::Filter& filter : sensor.filters) {
    const int order = filter.kind == FilterKind::first_order_lowpass ? 1 : filter.order;
    const double omega = 2.0 * std::numbers::pi * filter.cutoff_hz.value;
    if (order % 2 == 1) sections.push_back({false, omega, 0.0});
    for (int k = 0; k < order / 2; ++k) {
      const double angle = std::numbers::pi * (2 * k + 1) / (2.0 * order);
      sections.push_back({true, omega, 2.0 * std::sin(angle) * omega});
    }
  }
  return sections;
}

// Adds `by` times the rate of a chain's output; false where the rate is not a function of the
// states.
bool add_rate(const Chain& chain, double by, MeasurementRow& row) {
  if (chain.count == 0) return true;  // a constant
  if (chain.sections.empty()) {
    if (chain.input_rate >= 0) row.add(chain.input_rate, by);
    return chain.input_rate >= 0;
  }
  const Section& last = chain.sections.back();
  if (last.second_order) {
    row.add(chain.reading + 1, by);
    return true;
  }
  int input = chain.input;
  if (chain.sections.size() > 1) {
    const bool pair = chain.sections[chain.sections.size() - 2].second_order;
    input = chain.reading - (pair ? 2 : 1);
  }
  if (input < 0) return false;
  row.add(input, by * last.omega);
  row.add(chain.reading, -by * last.omega);
  return true;
}

// Adds `by` times the output of a chain and its delay, `age_s` ago.
void add_output(const Chain& chain, double by, double age_s, MeasurementRow& row) {
  row.add(chain.reading, by);
  const double each_s = chain.delays > 0 ? chain.delay_s / chain.delays : 0.0;
  for (int k = 0; k < chain.delays; ++k) row.add(chain.first_delay + 2 * k + 1, -by * each_s);
  if (age_s == 0.0) return;
  const bool known = add_rate(chain, -by * age_s, row);
  // The rate of a delay section changes by its differential equation (sensor_error_states.cpp).
  const double back = by * age_s * each_s;
  for (int k = 0; k < chain.delays; ++k) {
    const int value = chain.first_delay + 2 * k;
    const double stiffness = 12.0 / (each_s * each_s);
    row.add(chain.reading, back * stiffness);
    for (int i = 0; i < k; ++i) {
      row.add(chain.first_delay + 2 * i + 1, -back * stiffness * each_s);
    }
    row.add(value, -back * stiffness);
    row.add(value + 1, -back * 6.0 / each_s);
  }
  if (known || chain.delays > 0) {
    const double bandwidth_rad_s =
        chain.sections.empty() ? unfiltered_rad_s : chain.sections.back().omega;
    row.bandwidth_rad_s = std::max(row.bandwidth_rad_s, bandwidth_rad_s);
  }
}

}  // namespace

void MeasurementRow::add(int index, double by) {
  const auto end = state.begin() + count;
  const auto place = static_cast<std::size_t>(std::find(state.begin(), end, index) - state.begin());
  if (place == static_cast<std::size_t>(count)) state[static_cast<std::size_t>(count++)] = index;
  weight[place] += by;
}

MeasurementRow measurement_row(const Layout& layout, Channel channel, double age_s) {
  const Chain& chain = layout.of(channel);
  MeasurementRow row;
  // Crosstalk has the age of the reading that it is in.
  if (chain.crosstalk_from && layout.of(*chain.crosstalk_from).used) {
    const Chain& from = layout.of(*chain.crosstalk_from);
    add_output(from, chain.crosstalk, age_s + std::min(0.0, from.delay_s), row);
  }
  add_output(chain, 1.0, age_s, row);
  row.dynamic_terms = row.count;
  if (chain.hum >= 0) {
    row.add(chain.hum, std::cos(chain.hum_rad_s * age_s));
    if (age_s != 0.0) row.add(chain.hum + 1, std::sin(chain.hum_rad_s * age_s));
  }
  if (chain.offset >= 0) row.add(chain.offset, 1.0);
  return row;
}

Channel drive_channel(const physics::Structure& structure) {
  switch (structure.excitation) {
    case Excitation::base:
      return Channel::base_displacement;
    case Excitation::force:
      return Channel::drive_force;
    case Excitation::imposed:
      return Channel::displacement;
  }
  return Channel::base_displacement;
}

namespace {

// Inputs of the chains' first sections, where a state holds them.
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

void add_core(Layout& layout, const physics::Model& model, const physics::Rig& rig,
              const physics::ReadingLaws<double>& laws) {
  const physics::Structure& structure = rig.structure();
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
  // The source of a crosstalk has to be a state, even if it is known exactly.
  const bool crosstalk_from_load = std::any_of(laws.of.begin(), laws.of.end(), [](const auto& law) {
    return law.crosstalk_from == Channel::normal_load;
  });
  const bool load_uncertain =
      structure.loaded && (model.normal_load->load_n.sigma > 0.0 || crosstalk_from_load);
  if (measured) {
    layout.load = layout.core++;
    layout.load_rate = layout.core++;
  } else if (load_uncertain) {
    layout.load = layout.core++;
  }
  layout.drive = layout.core;
  layout.core += 4;
  if (structure.excitation == Excitation::imposed) {
    layout.rig[physics::state::x] = layout.drive;
    layout.rig[physics::state::v] = layout.drive + 1;
  }
}

void add_chain(Layout& layout, const physics::Model& model, Channel channel) {
  int& next = layout.count;
  Chain& chain = layout.chain[index_of(channel)];
  chain.used = true;
  chain.sections = sections_of(model.sensors[index_of(channel)]);
  chain.first = next;
  for (const Section& section : chain.sections) chain.count += section.second_order ? 2 : 1;
  if (chain.sections.empty()) chain.count = 1;
  next += chain.count;
  const bool last_is_first_order = !chain.sections.empty() && !chain.sections.back().second_order;
  chain.reading = next - (chain.sections.empty() || last_is_first_order ? 1 : 2);
}

// The filters of a constant load are at rest: it reads itself.
void add_constant_load(Layout& layout) {
  Chain& chain = layout.chain[index_of(Channel::normal_load)];
  chain.used = true;
  chain.first = layout.count;
  chain.reading = layout.load;
}

void add_outputs(Layout& layout, const physics::Model& model, const physics::Structure& structure) {
  layout.count = layout.core;
  if (structure.friction) {
    layout.friction = layout.count++;
    layout.theta = structure.kinetics == Kinetics::relaxing
                       ? layout.rig[static_cast<std::size_t>(physics::state::contact)]
                       : layout.count++;
  }
  add_chain(layout, model, Channel::displacement);
  add_chain(layout, model, Channel::velocity);
  if (structure.friction) add_chain(layout, model, Channel::friction_force);
  // The sensor of a load that is known exactly adds no information.
  const bool constant = structure.loaded && structure.load_law == NormalLoadLaw::constant &&
                        model.terms.empty() && !model.normal_load_bridge;
  if (constant && layout.load >= 0) {
    add_constant_load(layout);
  } else if (structure.loaded && (layout.load >= 0 || structure.load_law == NormalLoadLaw::wedge)) {
    add_chain(layout, model, Channel::normal_load);
  }
  const Channel driven = drive_channel(structure);
  if (!layout.of(driven).used) add_chain(layout, model, driven);
  connect(layout, structure);
}

void add_sensor_errors(Layout& layout, const physics::ReadingLaws<double>& laws) {
  int& next = layout.count;
  layout.first_sensor_error = next;
  for (Channel channel : all_channels) {
    Chain& chain = layout.chain[index_of(channel)];
    if (!chain.used) continue;
    const physics::ReadingLaw<double>& law = laws.of[index_of(channel)];
    // The simulator's limit.
    chain.delay_s = std::clamp(law.delay_s, -physics::longest_delay_s, physics::longest_delay_s);
    if (std::abs(chain.delay_s) < smallest_delay_s) chain.delay_s = 0.0;
    chain.crosstalk_from = law.crosstalk_from;
    chain.crosstalk = law.crosstalk;
    chain.delays =
        static_cast<int>(std::ceil(std::max(0.0, chain.delay_s) / longest_section_delay_s));
    chain.first_delay = next;
    next += 2 * chain.delays;
    // In the units of the corrected reading.
    chain.hum_rad_s = 2.0 * std::numbers::pi * law.hum_frequency_hz;
    chain.hum_amplitude = std::abs(law.hum_amplitude / law.gain);
    if (chain.hum_rad_s > 0.0 && chain.hum_amplitude > 0.0) {
      chain.hum = next;
      next += 2;
    }
    chain.drift_per_s = std::abs(law.drift_per_s / law.gain);
    if (chain.drift_per_s > 0.0) chain.offset = next++;
  }
}

// The last limit that the layout exceeds; unchanged where it exceeds none.
void check_limits(const Layout& layout, std::string& reason) {
  for (Channel channel : all_channels) {
    const Chain& chain = layout.of(channel);
    if (chain.sections.size() <= physics::max_filter_sections) continue;
    reason = "the " + std::string(info(channel).stem) + " channel has " +
             std::to_string(chain.sections.size()) + " filter sections, at most " +
             std::to_string(physics::max_filter_sections) +
             " are supported: declare fewer in [sensors]";
  }
  for (Channel channel : all_channels) {
    const Chain& chain = layout.of(channel);
    MeasurementRow ignored;
    if (!chain.used || chain.delay_s >= 0.0 || add_rate(chain, 1.0, ignored)) continue;
    reason = "the " + std::string(info(channel).stem) +
             " channel is early, and the rate of its reading is not known: declare delays of the "
             "other channels in [[physics]] instead";
  }
  if (layout.count > max_states) {
    reason = "the model needs " + std::to_string(layout.count) +
             " filter states, the observer supports at most " + std::to_string(max_states) +
             ": declare lower filter orders in [sensors], or fewer sensor errors and shorter "
             "delays in [[physics]]";
  }
}

}  // namespace

Layout make_layout(const physics::Model& model, const physics::Rig& rig, std::string& reason,
                   const physics::ReadingLaws<double>& laws) {
  Layout layout;
  layout.rig.fill(-1);
  add_core(layout, model, rig, laws);
  add_outputs(layout, model, rig.structure());
  add_sensor_errors(layout, laws);
  check_limits(layout, reason);
  return layout;
}

}  // namespace stickslip::observer
