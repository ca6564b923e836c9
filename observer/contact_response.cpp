// SPDX-License-Identifier: Apache-2.0
#include "observer/contact_response.h"

#include <span>
#include <utility>

#include "observer/open_motion.h"
#include "physics/backbone.h"

namespace stickslip::observer {

namespace {

using physics::Dual;
using physics::Kinetics;
using physics::NormalLoadLaw;
namespace state = physics::state;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

ParameterLanes lanes_of(const Dual& value, int first) {
  return value.d.segment<parameter_lanes>(first).cast<double>();
}

}  // namespace

ContactResponse::ContactResponse(UncertainParameters parameters, const physics::Model& model,
                                 const physics::Rig& rig, const Layout& layout, double period_s,
                                 const SolvedContact& contact)
    : ParameterResponse(std::move(parameters.paths), model, rig, layout, period_s),
      contact_(&contact),
      numbers_(rig.numbers<double>(std::span<const double>(rig.parameter_values()))) {
  for (const physics::RigNumbers<Dual>& numbers : parameters.numbers) {
    const Responses responses = responses_of(model, numbers, period_s);
    for (int i = 0; i < outputs; ++i) {
      by_force_[0][at(i)] = responses[middle_force][at(i)].a;
      by_force_[1][at(i)] = responses[end_force][at(i)].a;
    }
    for (int first = 0; first < Dual::directions; first += parameter_lanes) {
      if (static_cast<int>(groups_.size()) < groups()) add_group(responses, numbers, first);
    }
  }
}

ContactResponse::Responses ContactResponse::responses_of(const physics::Model& model,
                                                         const physics::RigNumbers<Dual>& numbers,
                                                         double period_s) {
  using Motion = OpenMotion<Dual>;
  const Motion motion(model, numbers, period_s);
  Responses out;
  for (int input = 0; input < inputs; ++input) {
    physics::RigState<Dual> rig;
    Forcing forcing;
    if (input < drive) {
      rig.s[at(input)] = Dual(1.0);
    } else if (input < middle_force) {
      forcing.drive[at(input - drive)] = 1.0;
    } else {
      (input == middle_force ? forcing.middle_n : forcing.end_n) = 1.0;
    }
    auto& response = out[at(input)];
    for (int k = 0; k < Motion::substeps; ++k) {
      motion.advance(rig, forcing, k);
      if (k + 1 != Motion::first_stage_substeps) continue;
      response[middle_x] = rig.s[state::x];
      response[middle_slip] = Motion::slip_of(rig);
    }
    for (const int i : {end_x, end_v, end_y, end_u}) response[at(i)] = rig.s[at(i)];
  }
  return out;
}

void ContactResponse::add_group(const Responses& responses, const physics::RigNumbers<Dual>& n,
                                int first) {
  Group group;
  for (int output = 0; output < outputs; ++output) {
    for (int input = 0; input < inputs; ++input) {
      const ParameterLanes change = lanes_of(responses[at(input)][at(output)], first);
      if ((change == 0.0).all()) continue;
      group.weights[at(output)].push_back({static_cast<Input>(input), change});
    }
  }
  group.mass_of_cell = lanes_of(n.c.cell_mass, first);
  group.stiffness_of_cell = lanes_of(n.c.cell_stiffness, first);
  group.load = lanes_of(n.c.load, first);
  group.load_slope = lanes_of(n.c.load_slope, first);
  group.transition_speed = lanes_of(n.c.transition_speed, first);
  groups_.push_back(std::move(group));
}

ContactResponse::Inputs ContactResponse::inputs_of(const Vector& before) const {
  const Layout& l = *layout_;
  Inputs out{};
  for (const int i : {x, v, y, u}) {
    if (l.rig[at(i)] >= 0) out[at(i)] = before[l.rig[at(i)]];
  }
  for (int i = 0; i < 3; ++i) out[at(drive + i)] = before[l.drive + i];
  out[middle_force] = contact_->middle.force_n;
  out[end_force] = contact_->end.force_n;
  return out;
}

ParameterLanes ContactResponse::change_of(const Group& group, Output output,
                                          const Inputs& of) const {
  ParameterLanes sum = ParameterLanes::Zero();
  for (const Group::Weight& weight : group.weights[output]) {
    sum += of[weight.input] * weight.change;
  }
  return sum;
}

// Of N = load_n (1 + slope x) at fixed x.
ParameterLanes ContactResponse::load_at(const Group& group, double displacement_m, double load_n,
                                        const Vector& mean) const {
  if (!rig_->structure().loaded || !(load_n > 0.0)) return ParameterLanes::Zero();
  const double slope =
      rig_->structure().load_law == NormalLoadLaw::wedge ? numbers_.c.load_slope : 0.0;
  const double declared = layout_->load >= 0 ? mean[layout_->load] : numbers_.c.load;
  return (1.0 + slope * displacement_m) * group.load + declared * displacement_m * group.load_slope;
}

// The stages of ContactPrediction::solve_stage, differentiated.
void ContactResponse::close_contact(const Group& group, const Inputs& of, const Vector& mean,
                                    RigChanges& out) {
  const double mu = mean[layout_->mu];
  ParameterLanes theta = ParameterLanes::Zero();
  const auto solve = [&](const SolvedStage& stage, const ParameterLanes& slip,
                         const ParameterLanes& displacement) -> ParameterLanes {
    const ParameterLanes limit =
        mu * (load_at(group, stage.x, stage.load_n, mean) + stage.load_by_x * displacement);
    theta = stage.by_theta_before * theta + stage.by_limit * limit +
            stage.by_slip * (slip - stage.slip_in_speeds * group.transition_speed);
    return stage.theta * limit + stage.limit_n * theta;
  };
  const ParameterLanes middle =
      solve(contact_->middle, change_of(group, middle_slip, of), change_of(group, middle_x, of));
  const auto add = [&](int i, std::size_t stage, const ParameterLanes& force) {
    out.state[at(i)] += by_force_[stage][at(i)] * force;
  };
  for (const int i : {end_x, end_v, end_y, end_u}) add(i, 0, middle);
  if (rig_->structure().kinetics == Kinetics::relaxing) {
    theta *= (1.0 - physics::gamma_ars) / physics::gamma_ars;
  } else {
    theta.setZero();
  }
  out.friction = solve(contact_->end, out.state[end_v] - out.state[end_u], out.state[end_x]);
  for (const int i : {end_x, end_v, end_y, end_u}) add(i, 1, out.friction);
  out.theta = out.state[state::contact] = theta;
}

// Reading of the load's bridge over the load.
double ContactResponse::bridge_factor(double displacement_m) {
  bridge_.s[state::x] = displacement_m;
  return rig_->quantities(bridge_, physics::Input{}, numbers_).normal_load;
}

// The inputs of the chains at the end of the period.
void ContactResponse::read(const Group& group, const Vector& after, RigChanges& out) {
  const physics::Structure& structure = rig_->structure();
  out.force_reading = out.friction;
  if (structure.resonant) {
    out.force_reading = after[layout_->rig[state::y]] * group.stiffness_of_cell +
                        numbers_.c.cell_stiffness * out.state[end_y];
  } else if (structure.load_cell && structure.excitation == physics::Excitation::base) {
    out.force_reading -= after[layout_->drive + 2] * group.mass_of_cell;
  }
  const double displacement_m = after[layout_->rig[state::x]];
  out.load = load_at(group, displacement_m, structure.friction ? contact_->end.load_n : 1.0, after);
  out.load_reading.setZero();
  if ((out.load == 0.0).all() && contact_->end.load_by_x == 0.0) return;
  out.load_reading =
      bridge_factor(displacement_m) * (out.load + contact_->end.load_by_x * out.state[end_x]);
}

void ContactResponse::update(const Vector& before, const Vector& after, double /*time_s*/,
                             double /*transition_speed_m_s*/) {
  const Inputs of = inputs_of(before);
  for (int i = 0; i < groups(); ++i) {
    const Group& group = groups_[at(i)];
    RigChanges changes;
    for (const Output output : {end_x, end_v, end_y, end_u}) {
      changes.state[output] = change_of(group, output, of);
    }
    changes.state[state::contact].setZero();
    changes.friction.setZero();
    changes.theta.setZero();
    if (rig_->structure().friction) close_contact(group, of, before, changes);
    read(group, after, changes);
    store(i, changes);
  }
}

}  // namespace stickslip::observer
