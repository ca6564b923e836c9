// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/effect_picture.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "diagnosis/report/figures.h"
#include "diagnosis/report/formatting.h"
#include "diagnosis/report/plot_svg.h"
#include "diagnosis/report/standalone_svg.h"
#include "diagnosis/shape.h"
#include "physics/catalogue.h"
#include "physics/simulator.h"

namespace stickslip::report {

namespace {

using physics::Model;

constexpr double friction_n = 0.12;
constexpr double load_n = 0.15;

// Ranges of a minute on a bench like that of the paper.
diagnosis::Experiment minute_on_a_bench() {
  diagnosis::Experiment out;
  out.largest.displacement_m = 0.02;
  out.largest.velocity_m_s = 0.3;
  out.period_s = 1.0e-3;
  out.samples = 60000;
  out.mean_load_n = load_n;
  out.channel_std[index_of(Channel::displacement)] = 0.008;
  out.channel_std[index_of(Channel::velocity)] = 0.12;
  out.channel_std[index_of(Channel::friction_force)] = 0.08;
  out.channel_std[index_of(Channel::normal_load)] = 0.025;
  out.channel_std[index_of(Channel::base_displacement)] = 0.006;
  out.channel_std[index_of(Channel::drive_force)] = 0.2;
  return out;
}

// Its model, with friction and a load that changes with displacement.
Model bench() {
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4};
  model.oscillator.damping_ratio = physics::Parameter{0.015};
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::wedge, {load_n}, {20.0}};
  model.friction.law = physics::FrictionLaw::state_variable;
  model.friction.mu = {friction_n / load_n};
  model.friction.transition_speed_m_s = {0.0025};
  model.friction.rate_per_s = {150.0};
  return model;
}

// The first place at which a sensor effect acts.
physics::Place place_of(const physics::Effect& effect) {
  if (effect.card().relation != physics::Relation::sensor) return {};
  for (const Channel channel : all_channels) {
    if (effect.acts_on({channel, {}})) return {channel, {}};
  }
  for (const Channel channel : all_channels) {
    for (const Channel from : all_channels) {
      if (effect.acts_on({channel, from})) return {channel, from};
    }
  }
  return {};
}

Model with(Model model, const physics::Effect& effect, const physics::Place& place) {
  physics::Term term = physics::term_of(effect, place);
  for (std::size_t i = 0; i < effect.card().parameters.size(); ++i) {
    term.parameters[std::string(effect.card().parameters[i].name)] = {effect.card().example[i]};
  }
  model.terms.push_back(std::move(term));
  return model;
}

// Readings of a channel over two periods of a shaken base, after its transient.
std::vector<double> readings_of(const Model& model, Channel channel) {
  constexpr double period_s = 1.0e-3;
  constexpr double drive_hz = 2.9;
  constexpr int settled = 3448;  // ten periods of the drive
  constexpr int shown = 690;
  physics::RigSimulator rig(model, {.step_s = 2.5e-4, .noise = false});
  std::vector<double> out;
  for (int k = 1; k <= settled + shown; ++k) {
    const double w = 2.0 * std::numbers::pi * drive_hz;
    physics::Input input;
    input.base_displacement_m = 0.008 * std::sin(w * period_s * k);
    input.base_acceleration_m_s2 = -w * w * input.base_displacement_m;
    rig.advance(period_s, input);
    const Frame frame = rig.read();
    if (k > settled && k % 3 == 0) out.push_back(frame[channel]);
  }
  return out;
}

// The channel in which an effect is seen best.
Channel shown_by(const physics::Effect& effect) {
  const unsigned hooks = effect.hooks();
  if ((hooks & physics::hook::measured_motion) != 0) return Channel::velocity;
  if ((hooks & physics::hook::friction) != 0) return Channel::friction_force;
  return Channel::displacement;
}

std::string reading_picture(const physics::Effect& effect, const physics::Place& place) {
  const Channel channel = place.channel.value_or(shown_by(effect));
  const std::vector<double> without = readings_of(bench(), channel);
  const std::vector<double> present = readings_of(with(bench(), effect, place), channel);
  double largest = 0.0;
  for (const double each : without) largest = std::max(largest, std::abs(each));
  const AxisUnit unit = axis_unit(largest, info(channel).unit);
  LinePlot plot;
  plot.title = channel_name(channel) + " over time";
  plot.description = "A simulated reading over time, without and with the effect.";
  plot.x_label = "time [s]";
  plot.y_label = channel_name(channel) + " [" + unit.unit + "]";
  Series before{"without", {}, {}, 1};
  Series after{"with the effect", {}, {}, 2};
  for (std::size_t i = 0; i < without.size(); ++i) {
    before.x.push_back(3.0e-3 * static_cast<double>(i));
    before.y.push_back(unit.factor * without[i]);
    after.y.push_back(unit.factor * present[i]);
  }
  after.x = before.x;
  plot.series = {before, after};
  return line_plot_svg(plot);
}

}  // namespace

std::string effect_picture(const physics::Effect& effect) {
  const std::span<const double> example = effect.card().example;
  if (example.empty()) return "";
  if (example.size() != effect.card().parameters.size()) {
    throw std::invalid_argument(std::string(effect.card().id) +
                                ": the example does not have one value per parameter");
  }
  const physics::Place place = place_of(effect);
  const auto curves =
      diagnosis::portrait_of(effect, place, example, example, minute_on_a_bench(), friction_n);
  if (curves.empty()) return standalone_svg(reading_picture(effect, place));
  const bool beside_ideal = curves.front().quantity == "reading";
  return standalone_svg(curve_svg(curves.front(), beside_ideal ? "with the effect" : ""));
}

}  // namespace stickslip::report
