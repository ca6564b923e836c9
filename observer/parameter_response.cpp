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

ParameterResponse::ParameterResponse(physics::Model model, const physics::Rig& rig,
                                     const Layout& layout, double period_s)
    : rig_(&rig),
      layout_(&layout),
      period_s_(period_s),
      steps_(static_cast<int>(std::ceil(period_s / (step_factor * rig.longest_step_s())))) {
  const std::vector<double>& values = rig.parameter_values();
  const std::vector<Dual> fixed(values.begin(), values.end());
  std::vector<Dual> uncertain = fixed;
  const auto add_pass = [&] {
    numbers_.push_back(rig.numbers<Dual>(std::span<const Dual>(uncertain)));
    uncertain = fixed;
  };
  const std::vector<physics::NamedParameter> parameters = physics::parameters_of(model);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double sigma = parameters[i].parameter->sigma;
    if (!(sigma > 0.0) || is_state(parameters[i].path, layout)) continue;
    uncertain[i].d[count() % Dual::directions] = Dual::slope(sigma);
    paths_.push_back(parameters[i].path);
    if (count() % Dual::directions == 0) add_pass();
  }
  if (count() % Dual::directions != 0) add_pass();
  if (count() > 0) add_rows(model);
}

void ParameterResponse::add_rows(const physics::Model& model) {
  const Layout& l = *layout_;
  for (int i = 0; i < physics::max_rig_states; ++i) {
    if (rig_->has_state(i)) rows_.push_back(l.rig[static_cast<std::size_t>(i)]);
  }
  const int contact = l.rig[state::contact];
  if (l.friction >= 0) rows_.push_back(l.friction);
  if (l.theta >= 0 && l.theta != contact) rows_.push_back(l.theta);
  for (Channel channel : {Channel::friction_force, Channel::normal_load}) {
    if (l.of(channel).used) add_chain(channel, model.sensors[index_of(channel)]);
  }
  changes_.resize(rows_.size());
}

void ParameterResponse::add_chain(Channel channel, const physics::Sensor& sensor) {
  using Quantities = physics::Quantities<Dual>;
  DrivenChain chain{
      channel == Channel::friction_force ? &Quantities::friction_reading : &Quantities::normal_load,
      {}};
  const physics::FilterChain filters(sensor.filters, period_s_);
  physics::FilterMemory<double> memory;
  memory.input = 1.0;
  filters.advance(memory, 1.0, 0.0);
  for_each_state(layout_->of(channel), filters, memory, [&](int row, double value) {
    rows_.push_back(row);
    chain.response.push_back(value);
  });
  chains_.push_back(std::move(chain));
}

// In the order of add_rows().
void ParameterResponse::collect() {
  auto next = changes_.begin();
  for (int i = 0; i < physics::max_rig_states; ++i) {
    if (rig_->has_state(i)) *next++ = state_.s[static_cast<std::size_t>(i)].d;
  }
  if (layout_->friction >= 0) *next++ = state_.friction.d;
  if (layout_->theta >= 0 && layout_->theta != layout_->rig[state::contact]) {
    *next++ = state_.theta.d;
  }
  for (const DrivenChain& chain : chains_) {
    const Dual& input = quantities_.*chain.input;
    for (const double response : chain.response) *next++ = input.d * Dual::slope(response);
  }
}

physics::Input ParameterResponse::input_at(const Vector& mean, double after_s) const {
  const int p = layout_->drive;
  const double t = after_s;
  const double position = mean[p] + t * (mean[p + 1] + 0.5 * t * mean[p + 2]);
  const double acceleration = mean[p + 2] - t * mean[p + 3] * mean[p + 1];
  const double load_n =
      layout_->load_rate >= 0 ? mean[layout_->load] + t * mean[layout_->load_rate] : 1.0;
  return input_of(rig_->structure().excitation, position, mean[p + 1] + t * mean[p + 2],
                  acceleration, load_n);
}

void ParameterResponse::set_states(const Vector& mean, physics::RigNumbers<Dual>& numbers) {
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

const ParameterResponse::Changes& ParameterResponse::of(int pass, const Vector& mean, double time_s,
                                                        double transition_speed_m_s) {
  physics::RigNumbers<Dual>& numbers = numbers_[static_cast<std::size_t>(pass)];
  numbers.c.transition_speed.a = transition_speed_m_s;
  set_states(mean, numbers);
  const double h = period_s_ / steps_;
  physics::Input begin = input_at(mean, 0.0);
  for (int k = 0; k < steps_; ++k) {
    const physics::Input end = input_at(mean, (k + 1) * h);
    rig_->step(state_, begin, end, time_s + k * h, h, numbers);
    begin = end;
  }
  quantities_ = rig_->quantities(state_, begin, numbers);
  collect();
  return changes_;
}

}  // namespace stickslip::observer
