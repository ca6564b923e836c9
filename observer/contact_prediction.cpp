#include "observer/contact_prediction.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "observer/chain_memory.h"
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

// Small steps in a period. 41 of 140 are the integrator's gamma to one part in 10^4.
constexpr int small_steps = 140;
constexpr int first_stage_steps = 41;
constexpr int early_steps = small_steps - first_stage_steps;

// What changes a state in a period by less than this share of its size is left out.
constexpr double negligible = 1.0e-6;
constexpr double fast_drive_rad_s = 2.0 * std::numbers::pi * 10.0;

/// What happens to a rig during one period.
struct Cause {
  std::array<double, 5> drive{};  ///< p and its derivatives, at the start
  double early_n = 0.0;           ///< friction until the last stage
  double late_n = 0.0;            ///< and in it
};

/// What came of it.
struct Response {
  Vector end;                ///< the states after the period
  double middle_x = 0.0;     ///< x when the first stage ends
  double middle_slip = 0.0;  ///< and the slip
};

physics::Model without_contact(physics::Model model) {
  model.friction = {};
  model.friction.law = physics::FrictionLaw::none;
  model.normal_load.reset();
  model.normal_load_bridge.reset();
  return model;
}

/// The rig with its contact open, which is linear, and its sensor chains.
class OpenRig {
 public:
  OpenRig(const physics::Rig& real, const physics::Model& model, const Layout& layout,
          double period_s)
      : rig_(without_contact(model)),
        numbers_(rig_.numbers<double>(std::span<const double>(rig_.parameter_values()))),
        layout_(layout),
        drives_base_(real.structure().excitation == Excitation::base),
        step_s_(period_s / small_steps) {
    for (Channel channel : all_channels) {
      if (!layout.of(channel).used) continue;
      chains_[index_of(channel)] =
          physics::FilterChain(model.sensors[index_of(channel)].filters, step_s_);
    }
  }

  Response respond(const Vector& start, const Cause& cause) const;

 private:
  Input input_at(const Cause& cause, double t) const {
    const auto& p = cause.drive;
    Input input;
    input.base_acceleration_m_s2 = p[2] + t * (p[3] + 0.5 * t * p[4]);
    if (!drives_base_) input.drive_force_n = position_at(cause, t);
    return input;
  }
  static double position_at(const Cause& cause, double t) {
    const auto& p = cause.drive;
    return p[0] + t * (p[1] + t / 2.0 * (p[2] + t / 3.0 * (p[3] + t / 4.0 * p[4])));
  }
  void kick(RigState<double>& rig, double force_n) const {
    rig.s[state::v] -= 0.5 * step_s_ * force_n * numbers_.inverse_mass;
    rig.s[state::u] += 0.5 * step_s_ * force_n * numbers_.inverse_cell_mass;
  }

  physics::Rig rig_;
  physics::RigNumbers<double> numbers_;
  const Layout& layout_;
  bool drives_base_;
  double step_s_;
  std::array<physics::FilterChain, channel_count> chains_;
};

Response OpenRig::respond(const Vector& start, const Cause& cause) const {
  RigState<double> rig;
  for (const int i : {state::x, state::v, state::y, state::u}) {
    const int at = layout_.rig[static_cast<std::size_t>(i)];
    if (at >= 0) rig.s[static_cast<std::size_t>(i)] = start[at];
  }
  const Channel driven = drive_channel(rig_.structure());
  std::array<FilterMemory<double>, channel_count> memory;
  const auto quantity = [&](Channel channel, const Quantities<double>& q, double t) {
    if (channel == driven) return position_at(cause, t);
    if (channel == Channel::displacement) return q.displacement;
    return channel == Channel::friction_force ? q.friction_reading : 0.0;
  };
  const auto of_displacement = [&] {
    const std::size_t i = index_of(Channel::displacement);
    return chains_[i].output_rate(memory[i]);
  };
  rig.friction = cause.early_n;
  const Quantities<double> first = rig_.quantities(rig, input_at(cause, 0.0), numbers_);
  for (Channel channel : all_channels) {  // displacement comes before velocity
    if (!layout_.of(channel).used) continue;
    const bool velocity = channel == Channel::velocity;
    recall(memory[index_of(channel)], layout_.of(channel), start,
           velocity ? of_displacement() : quantity(channel, first, 0.0),
           channel == Channel::displacement ? first.velocity : 0.0);
  }

  Response response;
  for (int k = 0; k < small_steps; ++k) {
    const double t = k * step_s_;
    const Input begin = input_at(cause, t);
    const Input end = input_at(cause, t + step_s_);
    rig.friction = k < early_steps ? cause.early_n : cause.late_n;
    kick(rig, rig.friction);
    rig_.step(rig, begin, end, t, step_s_, numbers_);
    kick(rig, rig.friction);
    if (k + 1 == first_stage_steps) {
      response.middle_x = rig.s[state::x];
      response.middle_slip = rig.s[state::v] - rig.s[state::u];
    }
    const Quantities<double> q = rig_.quantities(rig, end, numbers_);
    for (Channel channel : all_channels) {
      if (!layout_.of(channel).used) continue;
      const bool velocity = channel == Channel::velocity;
      chains_[index_of(channel)].advance(
          memory[index_of(channel)],
          velocity ? of_displacement() : quantity(channel, q, t + step_s_),
          channel == Channel::displacement ? q.velocity : 0.0);
    }
  }

  response.end = Vector::Zero(layout_.count);
  for (const int i : {state::x, state::v, state::y, state::u}) {
    const int at = layout_.rig[static_cast<std::size_t>(i)];
    if (at >= 0) response.end[at] = rig.s[static_cast<std::size_t>(i)];
  }
  for (Channel channel : all_channels) {
    if (!layout_.of(channel).used) continue;
    each_state(layout_.of(channel), chains_[index_of(channel)], memory[index_of(channel)],
               [&](int row, double value) { response.end[row] = value; });
  }
  return response;
}

}  // namespace

bool ContactPrediction::serves(const physics::Rig& rig, const physics::Model& model) {
  const physics::Structure& structure = rig.structure();
  return model.terms.empty() && !structure.two_well &&
         structure.excitation != Excitation::imposed && structure.kinetics != Kinetics::bristle;
}

ContactPrediction::ContactPrediction(const physics::Rig& rig, const physics::Model& model,
                                     const Layout& layout, double period_s)
    : Prediction(rig, layout, period_s),
      load_varies_(rig.structure().loaded && (rig.structure().load_law == NormalLoadLaw::wedge ||
                                              model.normal_load_bridge.has_value())),
      core_(layout.core) {
  still_ = Matrix::Zero(layout.count, layout.count);
  bend_rate_ = bend_acceleration_ = early_ = late_ = load_before_ = load_after_ = next_;
  find_responses(model);
  find_load_chain(model);
  drop_the_negligible();
  lay_rows();
}

void ContactPrediction::find_responses(const physics::Model& model) {
  const Layout& l = *layout_;
  const OpenRig open(*rig_, model, l, period_s_);
  const int v = l.rig[state::v];
  const int u = l.rig[state::u];
  const auto slip_of = [&](const Vector& states) { return states[v] - (u >= 0 ? states[u] : 0.0); };
  const Vector rest = Vector::Zero(l.count);
  const auto put = [&](int column, const Response& response) {
    still_.col(column) = response.end;
    if (column >= l.core) return;
    middle_x_.still[column] = response.middle_x;
    middle_slip_.still[column] = response.middle_slip;
    end_x_.still[column] = response.end[l.rig[state::x]];
    end_slip_.still[column] = slip_of(response.end);
  };
  for (int column = 0; column < l.count; ++column) {
    Vector unit = rest;
    unit[column] = 1.0;
    put(column, open.respond(unit, {}));
  }
  for (int i = 0; i < 3; ++i) {
    Cause cause;
    cause.drive[static_cast<std::size_t>(i)] = 1.0;
    put(l.drive + i, open.respond(rest, cause));
  }
  const auto bend = [&](std::size_t derivative, Vector& all, double Line::*by) {
    Cause cause;
    cause.drive[derivative] = -1.0;
    const Response response = open.respond(rest, cause);
    all = response.end;
    middle_x_.*by = response.middle_x;
    middle_slip_.*by = response.middle_slip;
    end_x_.*by = response.end[l.rig[state::x]];
    end_slip_.*by = slip_of(response.end);
  };
  bend(3, bend_rate_, &Line::bend_rate);
  bend(4, bend_acceleration_, &Line::bend_acceleration);

  const Response early = open.respond(rest, {.drive = {}, .early_n = 1.0, .late_n = 0.0});
  const Response late = open.respond(rest, {.drive = {}, .early_n = 0.0, .late_n = 1.0});
  early_ = early.end;
  late_ = late.end;
  middle_give_ = -early.middle_slip;
  end_give_ = -slip_of(late.end);
  early_on_end_slip_ = slip_of(early.end);

  // The drive and the parameters by themselves.
  const double h = period_s_;
  const double kept = 1.0 - h / drive_memory_s;
  const int p = l.drive;
  const auto set = [this](int row, int column, double weight) { still_(row, column) = weight; };
  set(p, p, 1.0);
  set(p, p + 1, h);
  set(p, p + 2, h * h / 2.0);
  set(p + 1, p + 1, kept);
  set(p + 1, p + 2, kept * h);
  set(p + 2, p + 2, kept);
  set(p + 3, p + 3, 1.0);
  bend_rate_[p] = -h * h * h / 6.0;
  bend_rate_[p + 1] = -kept * h * h / 2.0;
  bend_rate_[p + 2] = -kept * h;
  bend_acceleration_[p] = -h * h * h * h / 24.0;
  bend_acceleration_[p + 1] = -kept * h * h * h / 6.0;
  bend_acceleration_[p + 2] = -kept * h * h / 2.0;
  for (const int parameter : {l.mu, l.log_rate, l.load}) {
    if (parameter >= 0) set(parameter, parameter, 1.0);
  }
  if (l.load_rate >= 0) {
    set(l.load, l.load_rate, h);
    set(l.load_rate, l.load_rate, 1.0 - h / load_rate_memory_s);
  }
}

// The load's chain takes its input as a straight line over the period.
void ContactPrediction::find_load_chain(const physics::Model& model) {
  const Layout& l = *layout_;
  const Chain& chain = l.of(Channel::normal_load);
  if (!chain.used) return;
  // In the same small steps as what the chain remembers: its sections are exact for straight lines
  // only, and what goes from one into the next is none.
  const physics::FilterChain filters(model.sensors[index_of(Channel::normal_load)].filters,
                                     period_s_ / small_steps);
  const auto respond = [&](double before, double after, Vector& out) {
    FilterMemory<double> memory;
    memory.input = before;
    for (int k = 1; k <= small_steps; ++k) {
      filters.advance(memory, before + (after - before) * k / small_steps, 0.0);
    }
    each_state(chain, filters, memory, [&](int row, double value) { out[row] = value; });
  };
  respond(1.0, 0.0, load_before_);
  respond(0.0, 1.0, load_after_);
  if (load_varies_ || l.load < 0) return;
  still_.col(l.load) += load_before_ + load_after_;
  if (l.load_rate >= 0) still_.col(l.load_rate) += period_s_ * load_after_;
}

// How large each state is where the mass is deflected by a metre and the friction is as large as
// the spring's force; 0 where that says nothing.
Vector ContactPrediction::sizes(double force_n) const {
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

// A reading far down a chain feels what is far up it in the ninth digit: nobody misses that, but a
// good part of the time of a period would go into it. Not in the core, where the like adds up from
// period to period and comes out as another mu.
void ContactPrediction::drop_the_negligible() {
  const Layout& l = *layout_;
  const double force_n = std::max(numbers_.c.stiffness, 1.0e-9);
  const Vector size = sizes(force_n);
  const double rate = size[l.drive + 1];
  const double lambda = fast_drive_rad_s * fast_drive_rad_s;
  for (int row = l.core; row < l.count; ++row) {
    const double least = negligible * size[row];
    if (least == 0.0) continue;
    const auto drop = [least](double& weight, double by) {
      if (by > 0.0 && std::abs(weight) * by < least) weight = 0.0;
    };
    for (int column = 0; column < l.count; ++column) drop(still_(row, column), size[column]);
    drop(bend_rate_[row], lambda * rate);
    drop(bend_acceleration_[row], lambda * size[l.drive + 2]);
    drop(early_[row], force_n);
    drop(late_[row], force_n);
  }
}

void ContactPrediction::lay_rows() {
  const Layout& l = *layout_;
  for (const int at : l.rig) {
    if (at >= 0) columns_.push_back(at);
  }
  for (const int at : {l.mu, l.log_rate, l.load, l.load_rate}) {
    if (at >= 0) columns_.push_back(at);
  }
  // A base that is elsewhere is felt by nobody.
  const bool base = rig_->structure().excitation == Excitation::base;
  for (int i = base ? 1 : 0; i < 4; ++i) columns_.push_back(l.drive + i);

  const bool friction = rig_->structure().friction;
  const bool load_sensed = load_varies_ && l.of(Channel::normal_load).used;
  const int sums = load_sensed ? 4 : (friction ? 2 : 0);
  for (int sum = 0; sum < sums; ++sum) {
    transition_.begin_shared();
    for (const int column : columns_) {
      const int place = transition_.add(column, 0.0);
      if (column == columns_.front()) shared_place_[static_cast<std::size_t>(sum)] = place;
    }
  }
  linear_.resize(static_cast<std::size_t>(l.count));
  for (int row = 0; row < l.count; ++row) {
    transition_.begin_row();
    Span& linear = linear_[static_cast<std::size_t>(row)];
    if (friction && row == l.friction) {
      transition_.add_shared(1, 1.0);
      continue;
    }
    if (friction && row == l.theta) {
      for (const int column : columns_) {
        const int place = transition_.add(column, 0.0);
        if (column == columns_.front()) theta_place_ = place;
      }
      continue;
    }
    const bool bent = bend_rate_[row] != 0.0 || bend_acceleration_[row] != 0.0;
    Bent places{.row = row};
    int place = -1;
    for (int column = 0; column < l.count; ++column) {
      const bool bends = bent && (column == l.drive + 1 || column == l.drive + 2);
      if (still_(row, column) == 0.0 && !bends) continue;
      place = transition_.add(column, still_(row, column));
      if (linear.last == 0) linear.first = place;
      linear.last = place + 1;
      if (column == l.drive + 1) places.rate = place;
      if (column == l.drive + 2) places.acceleration = place;
    }
    if (bent) {
      places.lambda = transition_.add(l.drive + 3, 0.0);
      bent_.push_back(places);
    }
    if (friction && early_[row] != 0.0) transition_.add_shared(0, early_[row]);
    if (friction && late_[row] != 0.0) transition_.add_shared(1, late_[row]);
    if (load_sensed && load_before_[row] != 0.0) transition_.add_shared(2, load_before_[row]);
    if (load_sensed && load_after_[row] != 0.0) transition_.add_shared(3, load_after_[row]);
  }
}

// Into what stands in the transition from `place` on.
void ContactPrediction::put(int place, const Row& slope) {
  for (const int column : columns_) transition_.at(place++) = slope[column];
}

// p''' = -lambda p': to first order in lambda, of which lambda h^2 is some 10^-4.
void ContactPrediction::renew_drive(const Vector& mean) {
  const int p = layout_->drive;
  const double lambda = mean[p + 3];
  for (const Bent& bent : bent_) {
    const double by_rate = bend_rate_[bent.row];
    const double by_acceleration = bend_acceleration_[bent.row];
    transition_.at(bent.rate) = still_(bent.row, p + 1) + lambda * by_rate;
    transition_.at(bent.acceleration) = still_(bent.row, p + 2) + lambda * by_acceleration;
    transition_.at(bent.lambda) = by_rate * mean[p + 1] + by_acceleration * mean[p + 2];
  }
}

ContactPrediction::Row ContactPrediction::no_slope() const {
  Row row;
  std::fill_n(row.of.begin(), core_, 0.0);
  return row;
}

// to += weight * what
void ContactPrediction::add(Row& to, double weight, const Row& what) const {
  for (int i = 0; i < core_; ++i) to[i] += weight * what[i];
}

ContactPrediction::Sloped ContactPrediction::follow(const Line& line, const Vector& mean) const {
  Sloped out;
  std::copy_n(line.still.of.begin(), core_, out.slope.of.begin());
  out.value = 0.0;
  for (const int column : columns_) out.value += line.still[column] * mean[column];
  const int p = layout_->drive;
  const double lambda = mean[p + 3];
  const double bend = line.bend_rate * mean[p + 1] + line.bend_acceleration * mean[p + 2];
  out.value += lambda * bend;
  out.slope[p + 1] += lambda * line.bend_rate;
  out.slope[p + 2] += lambda * line.bend_acceleration;
  out.slope[p + 3] = bend;
  return out;
}

ContactPrediction::Load ContactPrediction::load_after(double time_s, double x, const Vector& mean) {
  const Layout& l = *layout_;
  if (!rig_->structure().loaded) return {};
  if (loaded_by_measurement_) {
    const double load = mean[l.load] + time_s * mean[l.load_rate];
    if (load <= 0.0) return {.value = 0.0};
    return {.value = load, .by_load = 1.0, .by_load_rate = time_s};
  }
  const double load = l.load >= 0 ? mean[l.load] : numbers_.c.load;
  if (rig_->structure().load_law != NormalLoadLaw::wedge) return {.value = load, .by_load = 1.0};
  // The law is the rig's own; x is the first direction, the load the second.
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
  const Load load = load_after(time_s, x, mean);
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

// to += weight times the slope of the load
void ContactPrediction::add_load_slope(Row& to, double weight, const Load& load,
                                       const Row& x) const {
  if (layout_->load >= 0) to[layout_->load] += weight * load.by_load;
  if (layout_->load_rate >= 0) to[layout_->load_rate] += weight * load.by_load_rate;
  if (load.by_x != 0.0) add(to, weight * load.by_x, x);
}

// One implicit stage of the contact, as in physics::Rig: its force acts from the stage's start with
// the value at its end. `free_slip` is the slip without it, `give` what a newton takes away, `from`
// theta before the stage.
ContactPrediction::Stage ContactPrediction::close(const Sloped& free_slip, double give,
                                                  const Load& load, const Sloped& x,
                                                  const Sloped& from, double speed,
                                                  const Vector& mean) {
  const Layout& l = *layout_;
  const double mu = mean[l.mu];
  Sloped level{mu * load.value, no_slope()};
  level.slope[l.mu] = load.value;
  add_load_slope(level.slope, mu, load, x.slope);

  // theta = stays * from + follows * tanh(slip / speed)
  double stays = 0.0;
  double follows = 1.0;
  double follows_by_log_rate = 0.0;
  if (rig_->structure().kinetics == Kinetics::relaxing) {
    const double turn = gamma_ars * period_s_ * rate_;
    stays = 1.0 / (1.0 + turn);
    follows = turn * stays;
    follows_by_log_rate = turn * stays * stays;
  }
  const double held = stays * from.value;
  const physics::BackboneSlip solved = physics::solve_backbone(free_slip.value, give * level.value,
                                                               held, follows, speed, last_slip_);
  last_slip_ = solved.w;

  const double theta = held + follows * solved.tanh;
  const double steepness = follows * (1.0 - solved.tanh * solved.tanh) / speed;
  const double reach = give * level.value;
  const double yield = 1.0 / (1.0 + reach * steepness);
  Stage stage;
  stage.theta.value = theta;
  stage.force.value = level.value * theta;
  Row moved = no_slope();  // theta, were the slip to stay
  add(moved, stays, from.slope);
  if (l.log_rate >= 0) moved[l.log_rate] += (solved.tanh - from.value) * follows_by_log_rate;
  const double pull = steepness * yield;
  const double hold = 1.0 - pull * reach;
  const double ease = -pull * give * theta;
  for (int i = 0; i < core_; ++i) {
    const double slope = hold * moved[i] + pull * free_slip.slope[i] + ease * level.slope[i];
    stage.theta.slope[i] = slope;
    stage.force.slope[i] = theta * level.slope[i] + level.value * slope;
  }
  return stage;
}

void ContactPrediction::add_contact(const Vector& mean, double speed) {
  const Layout& l = *layout_;
  const bool relaxing = rig_->structure().kinetics == Kinetics::relaxing;
  Sloped theta{0.0, no_slope()};
  if (relaxing) {
    rate_ = l.log_rate >= 0 ? std::exp(mean[l.log_rate]) : numbers_.c.rate;
    theta.value = mean[l.theta];
    theta.slope[l.theta] = 1.0;
  }
  const double in_stage_s = gamma_ars * period_s_;
  const Sloped x = follow(middle_x_, mean);
  const Stage middle = close(follow(middle_slip_, mean), middle_give_,
                             load_after(in_stage_s, x.value, mean), x, theta, speed, mean);

  const auto sum = [this](Sloped& to, double weight, const Sloped& what) {
    to.value += weight * what.value;
    add(to.slope, weight, what.slope);
  };
  Sloped slip = follow(end_slip_, mean);
  Sloped x_after = follow(end_x_, mean);
  sum(slip, early_on_end_slip_, middle.force);
  sum(x_after, early_[l.rig[state::x]], middle.force);
  if (relaxing) {
    const double on = (1.0 - gamma_ars) / gamma_ars;
    theta.value *= 1.0 - on;
    theta.slope[l.theta] = 1.0 - on;
    sum(theta, on, middle.theta);
  }
  const Stage end = close(slip, end_give_, load_after(period_s_, x_after.value, mean), x_after,
                          theta, speed, mean);

  next_ += early_ * middle.force.value + late_ * end.force.value;
  next_[l.friction] = end.force.value;
  next_[l.theta] = end.theta.value;
  put(shared_place_[0], middle.force.slope);
  put(shared_place_[1], end.force.slope);
  put(theta_place_, end.theta.slope);
  if (!load_varies_ || !l.of(Channel::normal_load).used) return;
  sum(x_after, late_[l.rig[state::x]], end.force);
  add_load_chain(mean, x_after);
}

void ContactPrediction::add_load_chain(const Vector& mean, const Sloped& x_after) {
  const int at = layout_->rig[state::x];
  Row x_before = no_slope();
  x_before[at] = 1.0;
  const Load before = load_reading(0.0, mean[at], mean);
  const Load after = load_reading(period_s_, x_after.value, mean);
  next_ += load_before_ * before.value + load_after_ * after.value;
  Row slope = no_slope();
  add_load_slope(slope, 1.0, before, x_before);
  put(shared_place_[2], slope);
  slope = no_slope();
  add_load_slope(slope, 1.0, after, x_after.slope);
  put(shared_place_[3], slope);
}

void ContactPrediction::advance(Vector& mean, double /*time_s*/, double slip_variance) {
  renew_drive(mean);
  for (int row = 0; row < layout_->count; ++row) {
    const Span& span = linear_[static_cast<std::size_t>(row)];
    double sum = 0.0;
    for (int i = span.first; i < span.last; ++i) {
      const Transition::Entry& entry = transition_.entry(i);
      sum += entry.weight * mean[entry.from];
    }
    next_[row] = sum;
  }
  if (rig_->structure().friction) add_contact(mean, widened_transition_speed(slip_variance));
  reading_states_.advance(mean, next_, transition_);
  mean = next_;
}

}  // namespace stickslip::observer
