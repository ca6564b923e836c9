// SPDX-License-Identifier: Apache-2.0
#include "observer/parameter_response.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "observer/chain_memory.h"
#include "observer/prediction.h"

namespace stickslip::observer {

namespace {

using physics::Dual;
namespace state = physics::state;

// Steps eight times as long as the rig's: an error of a per cent of a sensitivity has no effect.
constexpr double step_factor = 8.0;

bool is_state(const std::string& path, const Layout& layout) {
  return path == "friction.mu" || (path == "friction.rate_per_s" && layout.log_rate >= 0) ||
         (path == "normal_load.load_n" && layout.load >= 0);
}

}  // namespace

UncertainParameters uncertain_parameters(physics::Model model, const physics::Rig& rig,
                                         const Layout& layout) {
  UncertainParameters out;
  const std::vector<double>& values = rig.parameter_values();
  const std::vector<Dual> fixed(values.begin(), values.end());
  std::vector<Dual> uncertain = fixed;
  const auto add_numbers = [&] {
    out.numbers.push_back(rig.numbers<Dual>(std::span<const Dual>(uncertain)));
    uncertain = fixed;
  };
  const std::vector<physics::NamedParameter> parameters = physics::parameters_of(model);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double sigma = parameters[i].parameter->sigma;
    if (!(sigma > 0.0) || is_state(parameters[i].path, layout)) continue;
    uncertain[i].d[static_cast<int>(out.paths.size()) % Dual::directions] = Dual::slope(sigma);
    out.paths.push_back(parameters[i].path);
    if (out.paths.size() % Dual::directions == 0) add_numbers();
  }
  if (out.paths.size() % Dual::directions != 0) add_numbers();
  return out;
}

ParameterResponse::ParameterResponse(std::vector<std::string> paths, const physics::Model& model,
                                     const physics::Rig& rig, const Layout& layout, double period_s)
    : rig_(&rig), layout_(&layout), period_s_(period_s), paths_(std::move(paths)) {
  if (count() > 0) add_rows(model);
  const auto groups = static_cast<std::size_t>((count() + parameter_lanes - 1) / parameter_lanes);
  changes_.assign(groups, std::vector<ParameterLanes>(rows_.size(), ParameterLanes::Zero()));
  load_.assign(groups, ParameterLanes::Zero());
}

void ParameterResponse::add_rows(const physics::Model& model) {
  const Layout& l = *layout_;
  for (int i = 0; i < physics::max_rig_states; ++i) {
    if (rig_->has_state(i)) rows_.push_back(l.rig[static_cast<std::size_t>(i)]);
  }
  const int contact = l.rig[state::contact];
  if (l.friction >= 0) rows_.push_back(l.friction);
  if (l.theta >= 0 && l.theta != contact) rows_.push_back(l.theta);
  const auto add = [&](Channel channel, ParameterLanes RigChanges::*input) {
    if (l.of(channel).used) add_chain(l.of(channel), model.sensors[index_of(channel)], input);
  };
  add(Channel::friction_force, &RigChanges::force_reading);
  add(Channel::normal_load, &RigChanges::load_reading);
}

void ParameterResponse::add_chain(const Chain& chain, const physics::Sensor& sensor,
                                  ParameterLanes RigChanges::*input) {
  DrivenChain driven{input, {}};
  const physics::FilterChain filters(sensor.filters, period_s_);
  physics::FilterMemory<double> memory;
  memory.input = 1.0;
  filters.advance(memory, 1.0, 0.0);
  for_each_state(chain, filters, memory, [&](int row, double value) {
    rows_.push_back(row);
    driven.response.push_back(value);
  });
  chains_.push_back(std::move(driven));
}

// In the order of add_rows().
void ParameterResponse::store(int group, const RigChanges& changes) {
  load_[static_cast<std::size_t>(group)] = changes.load;
  auto next = changes_[static_cast<std::size_t>(group)].begin();
  for (int i = 0; i < physics::max_rig_states; ++i) {
    if (rig_->has_state(i)) *next++ = changes.state[static_cast<std::size_t>(i)];
  }
  if (layout_->friction >= 0) *next++ = changes.friction;
  if (layout_->theta >= 0 && layout_->theta != layout_->rig[state::contact]) {
    *next++ = changes.theta;
  }
  for (const DrivenChain& chain : chains_) {
    const ParameterLanes& input = changes.*chain.input;
    for (const double response : chain.response) *next++ = input * response;
  }
}

IntegratedResponse::IntegratedResponse(UncertainParameters parameters, const physics::Model& model,
                                       const physics::Rig& rig, const Layout& layout,
                                       double period_s)
    : ParameterResponse(std::move(parameters.paths), model, rig, layout, period_s),
      steps_(static_cast<int>(std::ceil(period_s / (step_factor * rig.longest_step_s())))),
      numbers_(std::move(parameters.numbers)) {}

void IntegratedResponse::collect(int pass) {
  constexpr int groups_in_pass = Dual::directions / parameter_lanes;
  for (int i = 0; i < groups_in_pass && pass * groups_in_pass + i < groups(); ++i) {
    const auto lanes = [i](const Dual& x) -> ParameterLanes {
      return x.d.segment<parameter_lanes>(i * parameter_lanes).cast<double>();
    };
    RigChanges changes;
    for (std::size_t k = 0; k < changes.state.size(); ++k) changes.state[k] = lanes(state_.s[k]);
    changes.friction = lanes(state_.friction);
    changes.theta = lanes(state_.theta);
    changes.force_reading = lanes(quantities_.friction_reading);
    changes.load_reading = lanes(quantities_.normal_load);
    changes.load = lanes(state_.load);
    store(pass * groups_in_pass + i, changes);
  }
}

physics::Input IntegratedResponse::input_at(const Vector& mean, double after_s) const {
  const int p = layout_->drive;
  const double t = after_s;
  const double position = mean[p] + t * (mean[p + 1] + 0.5 * t * mean[p + 2]);
  const double acceleration = mean[p + 2] - t * mean[p + 3] * mean[p + 1];
  const double load_n =
      layout_->load_rate >= 0 ? mean[layout_->load] + t * mean[layout_->load_rate] : 1.0;
  return input_of(rig_->structure().excitation, position, mean[p + 1] + t * mean[p + 2],
                  acceleration, load_n);
}

void IntegratedResponse::set_states(const Vector& mean, physics::RigNumbers<Dual>& numbers) {
  const Layout& l = *layout_;
  state_ = {};
  for (std::size_t i = 0; i < l.rig.size(); ++i) {
    if (l.rig[i] >= 0) state_.s[i] = Dual(mean[l.rig[i]]);
  }
  if (l.mu >= 0) numbers.c.mu = Dual(mean[l.mu]);
  if (l.log_rate >= 0) numbers.c.rate = Dual(std::exp(mean[l.log_rate]));
  if (l.load >= 0 && l.load_rate < 0) numbers.c.load = Dual(mean[l.load]);
  state_.slip = state_.s[state::v] - state_.s[state::u];
}

void IntegratedResponse::update(const Vector& before, const Vector& /*after*/, double time_s,
                                double transition_speed_m_s) {
  const double h = period_s_ / steps_;
  for (std::size_t pass = 0; pass < numbers_.size(); ++pass) {
    physics::RigNumbers<Dual>& numbers = numbers_[pass];
    numbers.c.transition_speed.a = transition_speed_m_s;
    set_states(before, numbers);
    physics::Input begin = input_at(before, 0.0);
    for (int k = 0; k < steps_; ++k) {
      const physics::Input end = input_at(before, (k + 1) * h);
      rig_->step(state_, begin, end, time_s + k * h, h, numbers);
      begin = end;
    }
    quantities_ = rig_->quantities(state_, begin, numbers);
    collect(static_cast<int>(pass));
  }
}

}  // namespace stickslip::observer
