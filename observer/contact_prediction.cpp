// SPDX-License-Identifier: Apache-2.0
#include "observer/contact_prediction.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <span>
#include <utility>

#include "observer/chain_memory.h"
#include "observer/open_motion.h"
#include "physics/backbone.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::FilterMemory;
using physics::gamma_ars;
using physics::Input;
using physics::Kinetics;
using physics::NormalLoadLaw;
using physics::Quantities;
using physics::RigState;
namespace state = physics::state;

constexpr int substeps = OpenMotion<double>::substeps;

// Weights that change a state in a period by a smaller share of its scale are dropped.
constexpr double negligible = 1.0e-6;
constexpr double fast_drive_rad_s = 2.0 * std::numbers::pi * 10.0;

struct Response {
  Vector end;                ///< states after the period
  double middle_x = 0.0;     ///< x at the end of the first stage
  double middle_slip = 0.0;  ///< slip velocity there
};

/// The rig without contact force and its sensor chains.
class OpenRig {
 public:
  OpenRig(const physics::RigNumbers<double>& numbers, const physics::Model& model,
          const Layout& layout, double period_s)
      : motion_(model, numbers, period_s), layout_(layout) {
    for (Channel channel : all_channels) {
      if (!layout.of(channel).used) continue;
      chains_[index_of(channel)] =
          physics::FilterChain(model.sensors[index_of(channel)].filters, motion_.step_s());
    }
  }

  Response response(const Vector& start, const Forcing& forcing) const;

 private:
  using Memory = std::array<FilterMemory<double>, channel_count>;

  double velocity_input(const Memory& memory) const {
    constexpr std::size_t x = index_of(Channel::displacement);
    return chains_[x].output_rate(memory[x]);
  }
  double chain_input(Channel channel, const Quantities<double>& q, const Forcing& forcing, double t,
                     const Memory& memory) const {
    if (channel == Channel::velocity) return velocity_input(memory);
    if (channel == drive_channel(motion_.structure())) return forcing.position_at(t);
    if (channel == Channel::displacement) return q.displacement;
    return channel == Channel::friction_force ? q.friction_reading : 0.0;
  }
  static double input_rate(Channel channel, const Quantities<double>& q) {
    return channel == Channel::displacement ? q.velocity : 0.0;
  }
  Response collect(const RigState<double>& rig, const Memory& memory) const;

  OpenMotion<double> motion_;
  const Layout& layout_;
  std::array<physics::FilterChain, channel_count> chains_;
};

Response OpenRig::response(const Vector& start, const Forcing& forcing) const {
  RigState<double> rig;
  for (const int i : {state::x, state::v, state::y, state::u}) {
    const int at = layout_.rig[static_cast<std::size_t>(i)];
    if (at >= 0) rig.s[static_cast<std::size_t>(i)] = start[at];
  }
  Memory memory;
  rig.friction = forcing.middle_n;
  const Quantities<double> first = motion_.quantities(rig, forcing, 0.0);
  for (Channel channel : all_channels) {  // displacement comes before velocity
    if (!layout_.of(channel).used) continue;
    load_memory(memory[index_of(channel)], layout_.of(channel), start,
                chain_input(channel, first, forcing, 0.0, memory), input_rate(channel, first));
  }

  double middle_x = 0.0;
  double middle_slip = 0.0;
  for (int k = 0; k < substeps; ++k) {
    motion_.advance(rig, forcing, k);
    if (k + 1 == OpenMotion<double>::first_stage_substeps) {
      middle_x = rig.s[state::x];
      middle_slip = OpenMotion<double>::slip_of(rig);
    }
    const double t = (k + 1) * motion_.step_s();
    const Quantities<double> q = motion_.quantities(rig, forcing, t);
    for (Channel channel : all_channels) {
      if (!layout_.of(channel).used) continue;
      chains_[index_of(channel)].advance(memory[index_of(channel)],
                                         chain_input(channel, q, forcing, t, memory),
                                         input_rate(channel, q));
    }
  }
  Response response = collect(rig, memory);
  response.middle_x = middle_x;
  response.middle_slip = middle_slip;
  return response;
}

Response OpenRig::collect(const RigState<double>& rig, const Memory& memory) const {
  Response response;
  response.end = Vector::Zero(layout_.count);
  for (const int i : {state::x, state::v, state::y, state::u}) {
    const int at = layout_.rig[static_cast<std::size_t>(i)];
    if (at >= 0) response.end[at] = rig.s[static_cast<std::size_t>(i)];
  }
  for (Channel channel : all_channels) {
    if (!layout_.of(channel).used) continue;
    for_each_state(layout_.of(channel), chains_[index_of(channel)], memory[index_of(channel)],
                   [&](int row, double value) { response.end[row] = value; });
  }
  return response;
}

}  // namespace

bool ContactPrediction::supports(const physics::Rig& rig, const physics::Model& model) {
  const physics::Structure& structure = rig.structure();
  return model.terms.empty() && !structure.two_well &&
         structure.excitation != Excitation::imposed && structure.kinetics != Kinetics::bristle;
}

ContactPrediction::ContactPrediction(const physics::Rig& rig, const physics::Model& model,
                                     const Layout& layout, double period_s)
    : Prediction(rig, layout, period_s),
      load_varies_(rig.structure().loaded && (rig.structure().load_law == NormalLoadLaw::wedge ||
                                              model.normal_load_bridge.has_value())),
      core_{} {
  open_jacobian_ = Matrix::Zero(layout.count, layout.count);
  by_lambda_rate_ = by_lambda_acceleration_ = next_;
  by_middle_force_ = by_end_force_ = by_load_before_ = by_load_after_ = next_;
  compute_responses(model);
  compute_parameter_rows();
  compute_load_chain(model);
  drop_negligible_weights();
  choose_columns();
  build_rows();
}

void ContactPrediction::compute_responses(const physics::Model& model) {
  const Layout& l = *layout_;
  const OpenRig open(numbers_, model, l, period_s_);
  const int v = l.rig[state::v];
  const int u = l.rig[state::u];
  const auto slip_of = [&](const Vector& states) { return states[v] - (u >= 0 ? states[u] : 0.0); };
  const Vector rest = Vector::Zero(l.count);
  const auto put = [&](int column, const Response& response) {
    open_jacobian_.col(column) = response.end;
    if (column >= l.core) return;
    middle_x_.weights[column] = response.middle_x;
    middle_slip_.weights[column] = response.middle_slip;
    end_x_.weights[column] = response.end[l.rig[state::x]];
    end_slip_.weights[column] = slip_of(response.end);
  };
  for (int column = 0; column < l.count; ++column) {
    Vector unit = rest;
    unit[column] = 1.0;
    put(column, open.response(unit, {}));
  }
  for (int i = 0; i < 3; ++i) {
    Forcing forcing;
    forcing.drive[static_cast<std::size_t>(i)] = 1.0;
    put(l.drive + i, open.response(rest, forcing));
  }
  const auto by_lambda = [&](std::size_t derivative, Vector& all, double LinearForm::*term) {
    Forcing forcing;
    forcing.drive[derivative] = -1.0;
    const Response response = open.response(rest, forcing);
    all = response.end;
    middle_x_.*term = response.middle_x;
    middle_slip_.*term = response.middle_slip;
    end_x_.*term = response.end[l.rig[state::x]];
    end_slip_.*term = slip_of(response.end);
  };
  by_lambda(3, by_lambda_rate_, &LinearForm::by_lambda_rate);
  by_lambda(4, by_lambda_acceleration_, &LinearForm::by_lambda_acceleration);

  const Response middle = open.response(rest, {.drive = {}, .middle_n = 1.0, .end_n = 0.0});
  const Response end = open.response(rest, {.drive = {}, .middle_n = 0.0, .end_n = 1.0});
  by_middle_force_ = middle.end;
  by_end_force_ = end.end;
  middle_compliance_ = -middle.middle_slip;
  end_compliance_ = -slip_of(end.end);
  middle_force_on_end_slip_ = slip_of(middle.end);
}

// Drive and parameters, whose evolution does not depend on the rig.
void ContactPrediction::compute_parameter_rows() {
  const Layout& l = *layout_;
  const double h = period_s_;
  const double kept = 1.0 - h / drive_memory_s;
  const int p = l.drive;
  const auto set = [this](int row, int column, double weight) {
    open_jacobian_(row, column) = weight;
  };
  set(p, p, 1.0);
  set(p, p + 1, h);
  set(p, p + 2, h * h / 2.0);
  set(p + 1, p + 1, kept);
  set(p + 1, p + 2, kept * h);
  set(p + 2, p + 2, kept);
  set(p + 3, p + 3, 1.0);
  by_lambda_rate_[p] = -h * h * h / 6.0;
  by_lambda_rate_[p + 1] = -kept * h * h / 2.0;
  by_lambda_rate_[p + 2] = -kept * h;
  by_lambda_acceleration_[p] = -h * h * h * h / 24.0;
  by_lambda_acceleration_[p + 1] = -kept * h * h * h / 6.0;
  by_lambda_acceleration_[p + 2] = -kept * h * h / 2.0;
  for (const int parameter : {l.mu, l.log_rate, l.load}) {
    if (parameter >= 0) set(parameter, parameter, 1.0);
  }
  if (l.load_rate >= 0) {
    set(l.load, l.load_rate, h);
    set(l.load_rate, l.load_rate, 1.0 - h / load_rate_memory_s);
  }
}

// The input of the load's chain is interpolated linearly over the period.
void ContactPrediction::compute_load_chain(const physics::Model& model) {
  const Layout& l = *layout_;
  const Chain& chain = l.of(Channel::normal_load);
  if (chain.count == 0) return;
  // In the same substeps as the chain's own states: sections are exact for linear inputs only, and
  // the signal between two sections is not linear.
  const physics::FilterChain filters(model.sensors[index_of(Channel::normal_load)].filters,
                                     period_s_ / substeps);
  const auto response = [&](double before, double after, Vector& out) {
    FilterMemory<double> memory;
    memory.input = before;
    for (int k = 1; k <= substeps; ++k) {
      filters.advance(memory, before + (after - before) * k / substeps, 0.0);
    }
    for_each_state(chain, filters, memory, [&](int row, double value) { out[row] = value; });
  };
  response(1.0, 0.0, by_load_before_);
  response(0.0, 1.0, by_load_after_);
  if (load_varies_ || l.load < 0) return;
  open_jacobian_.col(l.load) += by_load_before_ + by_load_after_;
  if (l.load_rate >= 0) open_jacobian_.col(l.load_rate) += period_s_ * by_load_after_;
}

// Magnitude of each state for a displacement of one metre and a friction force equal to the
// spring's; 0 where undefined.
Vector ContactPrediction::scales(double force_n) const {
  const Layout& l = *layout_;
  const auto& c = numbers_.c;
  Vector size = Vector::Zero(l.count);
  const auto set = [&size](int at, double value) {
    if (at >= 0) size[at] = value;
  };
  const double speed = std::sqrt(c.stiffness / c.mass);
  set(l.rig[state::x], 1.0);
  set(l.rig[state::v], speed);
  if (l.rig[state::y] >= 0) {
    const double deflection = force_n / c.cell_stiffness;
    set(l.rig[state::y], deflection);
    set(l.rig[state::u], deflection * std::sqrt(c.cell_stiffness / c.cell_mass));
  }
  const bool base = rig_->structure().excitation == Excitation::base;
  const double drive = base ? 1.0 : force_n;
  double each = drive;
  for (int i = 0; i < 3; ++i, each *= fast_drive_rad_s) set(l.drive + i, each);
  const auto chain = [&](Channel channel, double value) {
    if (!l.of(channel).used) return;
    int next = l.of(channel).first;
    if (l.of(channel).sections.empty()) set(next, value);
    for (const Section& section : l.of(channel).sections) {
      set(next++, value);
      if (section.second_order) set(next++, value * section.omega);
    }
  };
  chain(Channel::displacement, 1.0);
  chain(Channel::velocity, speed);
  chain(Channel::friction_force, force_n);
  chain(drive_channel(rig_->structure()), drive);
  return size;
}

// States at opposite ends of a chain affect each other in the ninth digit only, at a considerable
// part of the cost of a period. Core rows are kept: errors there accumulate and bias mu.
void ContactPrediction::drop_negligible_weights() {
  const Layout& l = *layout_;
  const double force_n = std::max(numbers_.c.stiffness, 1.0e-9);
  const Vector size = scales(force_n);
  const double rate = size[l.drive + 1];
  const double lambda = fast_drive_rad_s * fast_drive_rad_s;
  for (int row = l.core; row < l.count; ++row) {
    const double least = negligible * size[row];
    if (least == 0.0) continue;
    const auto drop = [least](double& weight, double by) {
      if (by > 0.0 && std::abs(weight) * by < least) weight = 0.0;
    };
    for (int column = 0; column < l.count; ++column)
      drop(open_jacobian_(row, column), size[column]);
    drop(by_lambda_rate_[row], lambda * rate);
    drop(by_lambda_acceleration_[row], lambda * size[l.drive + 2]);
    drop(by_middle_force_[row], force_n);
    drop(by_end_force_[row], force_n);
  }
}

void ContactPrediction::choose_columns() {
  const Layout& l = *layout_;
  for (const int at : l.rig) {
    if (at >= 0) columns_.push_back(at);
  }
  for (const int at : {l.mu, l.log_rate, l.load, l.load_rate}) {
    if (at >= 0) columns_.push_back(at);
  }
  // The position of the base has no effect, only its motion.
  const bool base = rig_->structure().excitation == Excitation::base;
  for (int i = base ? 1 : 0; i < 4; ++i) columns_.push_back(l.drive + i);
}

// Zero weights for all columns_; returns the position of the first.
int ContactPrediction::add_zero_row() {
  int first = 0;
  for (const int column : columns_) {
    const int position = transition_.add(column, 0.0);
    if (column == columns_.front()) first = position;
  }
  return first;
}

void ContactPrediction::build_rows() {
  const Layout& l = *layout_;
  const bool friction = rig_->structure().friction;
  const bool load_sensed = load_varies_ && l.of(Channel::normal_load).used;
  const int sums = load_sensed ? 4 : (friction ? 2 : 0);
  for (int sum = 0; sum < sums; ++sum) {
    transition_.begin_shared();
    shared_position_[static_cast<std::size_t>(sum)] = add_zero_row();
  }
  linear_part_.resize(static_cast<std::size_t>(l.count));
  for (int row = 0; row < l.count; ++row) {
    transition_.begin_row();
    if (friction && row == l.friction) {
      transition_.add_shared(1, 1.0);
    } else if (friction && row == l.theta) {
      theta_position_ = add_zero_row();
    } else {
      build_linear_row(row, friction, load_sensed);
    }
  }
}

void ContactPrediction::build_linear_row(int row, bool friction, bool load_sensed) {
  const Layout& l = *layout_;
  Span& linear = linear_part_[static_cast<std::size_t>(row)];
  const bool by_lambda = by_lambda_rate_[row] != 0.0 || by_lambda_acceleration_[row] != 0.0;
  DriveTerms terms{.row = row};
  for (int column = 0; column < l.count; ++column) {
    const bool varies = by_lambda && (column == l.drive + 1 || column == l.drive + 2);
    if (open_jacobian_(row, column) == 0.0 && !varies) continue;
    const int position = transition_.add(column, open_jacobian_(row, column));
    if (linear.last == 0) linear.first = position;
    linear.last = position + 1;
    if (column == l.drive + 1) terms.rate = position;
    if (column == l.drive + 2) terms.acceleration = position;
  }
  if (by_lambda) {
    terms.lambda = transition_.add(l.drive + 3, 0.0);
    drive_terms_.push_back(terms);
  }
  const auto add_shared = [&](bool present, int sum, double weight) {
    if (present && weight != 0.0) transition_.add_shared(sum, weight);
  };
  add_shared(friction, 0, by_middle_force_[row]);
  add_shared(friction, 1, by_end_force_[row]);
  add_shared(load_sensed, 2, by_load_before_[row]);
  add_shared(load_sensed, 3, by_load_after_[row]);
}

// Writes weights for columns_ from `position` on.
void ContactPrediction::store(int position, const Row& gradient) {
  for (const int column : columns_) transition_.at(position++) = gradient[column];
}

// p''' = -lambda p', to first order in lambda; lambda h^2 is about 10^-4.
void ContactPrediction::update_drive_terms(const Vector& mean) {
  const int p = layout_->drive;
  const double lambda = mean[p + 3];
  for (const DriveTerms& terms : drive_terms_) {
    const double by_rate = by_lambda_rate_[terms.row];
    const double by_acceleration = by_lambda_acceleration_[terms.row];
    transition_.at(terms.rate) = open_jacobian_(terms.row, p + 1) + lambda * by_rate;
    transition_.at(terms.acceleration) =
        open_jacobian_(terms.row, p + 2) + lambda * by_acceleration;
    transition_.at(terms.lambda) = by_rate * mean[p + 1] + by_acceleration * mean[p + 2];
  }
}

void ContactPrediction::add(Row& to, double weight, const Row& row) {
  for (int i = 0; i < core_lanes; ++i) to[i] += weight * row[i];
}

void ContactPrediction::add(ValueAndGradient& to, double weight, const ValueAndGradient& term) {
  to.value += weight * term.value;
  add(to.gradient, weight, term.gradient);
}

ContactPrediction::ValueAndGradient ContactPrediction::evaluate(const LinearForm& form,
                                                                const Vector& mean) const {
  ValueAndGradient out{0.0, form.weights};
  // Four sums, so that they fit a register.
  std::array<double, 4> sum{};
  for (int i = 0; i < core_lanes; i += 4) {
    for (int k = 0; k < 4; ++k) {
      sum[static_cast<std::size_t>(k)] += form.weights[i + k] * core_[i + k];
    }
  }
  out.value = (sum[0] + sum[2]) + (sum[1] + sum[3]);
  const int p = layout_->drive;
  const double lambda = mean[p + 3];
  const double by_lambda =
      form.by_lambda_rate * mean[p + 1] + form.by_lambda_acceleration * mean[p + 2];
  out.value += lambda * by_lambda;
  out.gradient[p + 1] += lambda * form.by_lambda_rate;
  out.gradient[p + 2] += lambda * form.by_lambda_acceleration;
  out.gradient[p + 3] = by_lambda;
  return out;
}

ContactPrediction::Load ContactPrediction::load_at(double time_s, double x, const Vector& mean) {
  const Layout& l = *layout_;
  if (!rig_->structure().loaded) return {};
  if (loaded_by_measurement_) {
    const double load = mean[l.load] + time_s * mean[l.load_rate];
    if (load <= 0.0) return {.value = 0.0};
    return {.value = load, .by_load = 1.0, .by_load_rate = time_s};
  }
  const double load = l.load >= 0 ? mean[l.load] : numbers_.c.load;
  if (rig_->structure().load_law != NormalLoadLaw::wedge) return {.value = load, .by_load = 1.0};
  // The rig's own law, differentiated by x (direction 0) and by the load (direction 1).
  physics::Dual& at = dual_state_.s[state::x];
  at.a = x;
  at.d[0] = 1.0F;
  dual_numbers_.c.load.a = load;
  dual_numbers_.c.load.d[1] = 1.0F;
  dual_state_.load = rig_->normal_load(dual_state_, Input{}, 0.0, dual_numbers_);
  return {
      .value = dual_state_.load.a, .by_x = dual_state_.load.d[0], .by_load = dual_state_.load.d[1]};
}

ContactPrediction::Load ContactPrediction::load_reading(double time_s, double x,
                                                        const Vector& mean) {
  const Load load = load_at(time_s, x, mean);
  dual_state_.s[state::x] = physics::Dual(x);
  dual_state_.s[state::x].d[0] = 1.0F;
  dual_state_.load = physics::Dual(load.value);
  dual_state_.load.d[0] = physics::Dual::slope(load.by_x);
  dual_state_.load.d[1] = physics::Dual::slope(load.by_load);
  dual_state_.load.d[2] = physics::Dual::slope(load.by_load_rate);
  const physics::Dual reading = rig_->quantities(dual_state_, Input{}, dual_numbers_).normal_load;
  return {.value = reading.a,
          .by_x = reading.d[0],
          .by_load = reading.d[1],
          .by_load_rate = reading.d[2]};
}

void ContactPrediction::add_load_gradient(Row& to, double weight, const Load& load,
                                          const Row& x) const {
  if (layout_->load >= 0) to[layout_->load] += weight * load.by_load;
  if (layout_->load_rate >= 0) to[layout_->load_rate] += weight * load.by_load_rate;
  if (load.by_x != 0.0) add(to, weight * load.by_x, x);
}

// One implicit stage of the contact, as in physics::Rig: the force at the end of the stage acts
// from its start. `free_slip`: slip velocity without the force; `compliance`: slip velocity
// removed per newton; `from`: theta before the stage.
ContactPrediction::Stage ContactPrediction::solve_stage(const ValueAndGradient& free_slip,
                                                        double compliance, const Load& load,
                                                        const ValueAndGradient& x,
                                                        const ValueAndGradient& from, double speed,
                                                        const Vector& mean, SolvedStage& solved) {
  const Layout& l = *layout_;
  const double mu = mean[l.mu];
  ValueAndGradient limit{mu * load.value, Row{}};
  limit.gradient[l.mu] = load.value;
  add_load_gradient(limit.gradient, mu, load, x.gradient);

  // theta = kept * from + gain * tanh(slip / speed)
  double kept = 0.0;
  double gain = 1.0;
  double gain_by_log_rate = 0.0;
  if (rig_->structure().kinetics == Kinetics::relaxing) {
    const double gamma_h = gamma_ars * period_s_ * gamma_;
    kept = 1.0 / (1.0 + gamma_h);
    gain = gamma_h * kept;
    gain_by_log_rate = gamma_h * kept * kept;
  }
  const double offset = kept * from.value;
  const physics::BackboneSlip solved_slip = physics::solve_backbone(
      free_slip.value, compliance * limit.value, offset, gain, speed, last_slip_);
  last_slip_ = solved_slip.w;

  const double theta = offset + gain * solved_slip.tanh;
  const double steepness = gain * (1.0 - solved_slip.tanh * solved_slip.tanh) / speed;
  const double slip_range = compliance * limit.value;
  const double share = 1.0 / (1.0 + slip_range * steepness);
  Stage stage;
  stage.theta.value = theta;
  stage.force.value = limit.value * theta;
  Row at_fixed_slip{};  // gradient of theta
  add(at_fixed_slip, kept, from.gradient);
  if (l.log_rate >= 0)
    at_fixed_slip[l.log_rate] += (solved_slip.tanh - from.value) * gain_by_log_rate;
  const double by_slip = steepness * share;
  const double by_theta = 1.0 - by_slip * slip_range;
  const double by_limit = -by_slip * compliance * theta;
  solved = {.theta = theta,
            .force_n = stage.force.value,
            .limit_n = limit.value,
            .load_n = load.value,
            .load_by_x = load.by_x,
            .x = x.value,
            .by_slip = by_slip,
            .by_limit = by_limit,
            .by_theta_before = by_theta * kept,
            .slip_in_speeds = solved_slip.w / speed};
  for (int i = 0; i < core_lanes; ++i) {
    const double gradient = by_theta * at_fixed_slip[i] + by_slip * free_slip.gradient[i] +
                            by_limit * limit.gradient[i];
    stage.theta.gradient[i] = gradient;
    stage.force.gradient[i] = theta * limit.gradient[i] + limit.value * gradient;
  }
  return stage;
}

void ContactPrediction::add_contact(const Vector& mean, double speed) {
  const Layout& l = *layout_;
  const bool relaxing = rig_->structure().kinetics == Kinetics::relaxing;
  ValueAndGradient theta{0.0, Row{}};
  if (relaxing) {
    gamma_ = l.log_rate >= 0 ? std::exp(mean[l.log_rate]) : numbers_.c.rate;
    theta.value = mean[l.theta];
    theta.gradient[l.theta] = 1.0;
  }
  const double in_stage_s = gamma_ars * period_s_;
  const ValueAndGradient x = evaluate(middle_x_, mean);
  const Stage middle =
      solve_stage(evaluate(middle_slip_, mean), middle_compliance_,
                  load_at(in_stage_s, x.value, mean), x, theta, speed, mean, contact_.middle);

  ValueAndGradient slip = evaluate(end_slip_, mean);
  ValueAndGradient x_after = evaluate(end_x_, mean);
  add(slip, middle_force_on_end_slip_, middle.force);
  add(x_after, by_middle_force_[l.rig[state::x]], middle.force);
  if (relaxing) {
    const double extrapolation = (1.0 - gamma_ars) / gamma_ars;
    theta.value *= 1.0 - extrapolation;
    theta.gradient[l.theta] = 1.0 - extrapolation;
    add(theta, extrapolation, middle.theta);
  }
  const Stage end = solve_stage(slip, end_compliance_, load_at(period_s_, x_after.value, mean),
                                x_after, theta, speed, mean, contact_.end);

  next_ += by_middle_force_ * middle.force.value + by_end_force_ * end.force.value;
  next_[l.friction] = end.force.value;
  next_[l.theta] = end.theta.value;
  store(shared_position_[0], middle.force.gradient);
  store(shared_position_[1], end.force.gradient);
  store(theta_position_, end.theta.gradient);
  if (!load_varies_ || !l.of(Channel::normal_load).used) return;
  add(x_after, by_end_force_[l.rig[state::x]], end.force);
  add_load_chain(mean, x_after);
}

void ContactPrediction::add_load_chain(const Vector& mean, const ValueAndGradient& x_after) {
  const int at = layout_->rig[state::x];
  Row x_before{};
  x_before[at] = 1.0;
  const Load before = load_reading(0.0, mean[at], mean);
  const Load after = load_reading(period_s_, x_after.value, mean);
  next_ += by_load_before_ * before.value + by_load_after_ * after.value;
  Row gradient{};
  add_load_gradient(gradient, 1.0, before, x_before);
  store(shared_position_[2], gradient);
  gradient = Row{};
  add_load_gradient(gradient, 1.0, after, x_after.gradient);
  store(shared_position_[3], gradient);
}

std::unique_ptr<ParameterResponse> ContactPrediction::response_to(
    UncertainParameters parameters, const physics::Model& model) const {
  return std::make_unique<ContactResponse>(std::move(parameters), model, *rig_, *layout_, period_s_,
                                           contact_);
}

void ContactPrediction::advance(Vector& mean, double /*time_s*/, double slip_variance) {
  update_drive_terms(mean);
  for (int row = 0; row < layout_->count; ++row) {
    const Span& span = linear_part_[static_cast<std::size_t>(row)];
    double sum = 0.0;
    for (int i = span.first; i < span.last; ++i) {
      const Transition::Entry& entry = transition_.entry(i);
      sum += entry.weight * mean[entry.from];
    }
    next_[row] = sum;
  }
  std::copy_n(mean.data(), layout_->core, core_.of.begin());
  if (rig_->structure().friction) add_contact(mean, widened_transition_speed(slip_variance));
  sensor_error_states_.advance(mean, next_, transition_);
  mean = next_;
}

}  // namespace stickslip::observer
