// SPDX-License-Identifier: Apache-2.0
#include "physics/rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "physics/backbone.h"
#include "physics/catalogue.h"
#include "physics/contact_laws.h"
#include "physics/model_consistency.h"
#include "physics/sensor_chain.h"

namespace stickslip::physics {

namespace {

using std::numbers::pi;

// ARS(2,2,2): delta makes the explicit part second order.
const double delta_ars = 1.0 - 1.0 / (2.0 * gamma_ars);

// tanh(x) with known value; x supplies the derivatives.
double known_tanh(double /*x*/, double value) { return value; }
Dual known_tanh(const Dual& x, double value) {
  return {value, x.d * Dual::slope(1.0 - value * value)};
}

// Root of w + a z(w) = target with z(w) = (z0 + alpha w) / (1 + alpha abs(w) r): the implicit step
// of a bristle that slips at a deflection of 1/r. Where w opposes the deflection z0, `back` is
// used instead of r.
double solve_bristle(double target, double a, double z0, double alpha, double r, double back,
                     double guess) {
  const auto rate = [&](double w) { return w * z0 < 0.0 ? back : r; };
  const auto deflection = [&](double w) {
    return (z0 + alpha * w) / (1.0 + alpha * std::abs(w) * rate(w));
  };
  const double farthest =
      std::max(std::abs(z0), r > 0.0 ? 1.0 / r : 0.0) + alpha * std::abs(target);
  const double reach = std::abs(a) * farthest * (1.0 + 1.0e-9) + 1.0e-300;
  double low = target - reach;
  double high = target + reach;
  double w = std::clamp(guess, low, high);
  for (int iteration = 0; iteration < 80; ++iteration) {
    const double residual = w + a * deflection(w) - target;
    if (residual > 0.0) {
      high = w;
    } else {
      low = w;
    }
    const double denominator = 1.0 + alpha * std::abs(w) * rate(w);
    const double sign = w < 0.0 ? -1.0 : 1.0;
    const double slope =
        1.0 + a * alpha * (1.0 - sign * rate(w) * z0) / (denominator * denominator);
    double next = w - residual / slope;
    if (std::abs(next - w) <= 1.0e-14 * (std::abs(w) + 1.0e-6)) return next;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    w = next;
  }
  return w;
}

// Share of slip in a bristle's motion at `ratio` times its break-away deflection, below 0 where it
// moves back. 1 for ratios from 1; 0 for those up to 2 - 1 / elastic, with a sine between (Dupont,
// Hayward, Armstrong and Altpeter 2002, Eq. (17)). Where that is below 0, the bristle slips from
// the start; elastic = 0 leaves Dahl's, which always does.
template <class T>
T plastic_share(const T& ratio, const T& elastic) {
  using std::sin;
  const T from_middle = (elastic * (ratio - 1.5) + 0.5) / (1.0 - elastic);
  if (!(value_of(from_middle) > -0.5)) return T(0.0);
  if (!(value_of(from_middle) < 0.5)) return T(1.0);
  return 0.5 + 0.5 * sin(pi * from_middle);
}

// A relaxation process over one implicit stage: theta at its end is decayed + gain g(w).
template <class T>
struct Process {
  T decayed{0.0};
  T gain{0.0};
};

// `steps`: length of the stage in time constants. `scale`: factor on the backbone.
template <class T>
Process<T> process(const T& from, const T& scale, const T& steps) {
  const T blend = 1.0 / (1.0 + steps);
  return {from * blend, scale * steps * blend};
}

template <class T>
OperatingPoint<T> operating_point(const RigState<T>& state, const Input& now, double time_s) {
  OperatingPoint<T> at;
  at.time_s = time_s;
  at.x = state.s[state::x];
  at.v = state.s[state::v];
  at.slip = state.slip;
  at.load = state.load;
  at.base_acceleration_m_s2 = now.base_acceleration_m_s2;
  at.friction = state.friction;
  return at;
}

// The functions below are in the innermost loop of all fits.
#define STICKSLIP_INLINE [[gnu::always_inline]] inline

template <class T>
STICKSLIP_INLINE void solve_bristle_contact(const Stage<T>& stage, const Coefficients<T>& c,
                                            const T& z0, ContactSolution<T>& out) {
  const double alpha = stage.alpha;
  const double slip_level = std::max(value_of(stage.level * stage.backbone), 1.0e-12);
  const T r = value_of(stage.level * stage.backbone) > 1.0e-12
                  ? c.contact_stiffness / (stage.level * stage.backbone)
                  : T(value_of(c.contact_stiffness) / slip_level);
  T along = r;
  T back = r;
  if (value_of(c.contact_elastic_share) > 0.0) {
    using std::abs;
    T elastic = c.contact_elastic_share;
    if (value_of(elastic) > 0.99) elastic = T(0.99);
    const T ratio = abs(z0) * r;
    along = r * plastic_share(ratio, elastic);
    back = r * plastic_share(T(-ratio), elastic);
  }
  // The bristle's damping acts on the change of its deflection over the stage: it adds to the
  // stiffness, with a force from the initial deflection.
  const T a = stage.mobility * (alpha * c.contact_stiffness + c.contact_damping);
  const T push = stage.mobility * c.contact_damping * z0;
  const T target = stage.free_slip + push;
  T w = T(solve_bristle(value_of(target), value_of(a), value_of(z0), alpha, value_of(along),
                        value_of(back), stage.guess));
  const T& slipping = value_of(w) * value_of(z0) < 0.0 ? back : along;
  // One Newton step in T leaves the value unchanged and makes the derivatives exact.
  const double sign = value_of(w) < 0.0 ? -1.0 : 1.0;
  const double denominator = 1.0 + alpha * std::abs(value_of(w)) * value_of(slipping);
  const double slope = 1.0 + value_of(a) * alpha *
                                 (1.0 - sign * value_of(slipping) * value_of(z0)) /
                                 (denominator * denominator);
  const auto deflection = [&](const T& slip) {
    return (z0 + alpha * slip) / (1.0 + (alpha * sign) * slip * slipping);
  };
  w -= (w + a * deflection(w) - target) * (1.0 / slope);
  out.slip = w;
  out.contact = deflection(w);
  out.force =
      c.contact_stiffness * out.contact + c.contact_damping * (out.contact - z0) * (1.0 / alpha);
  out.theta = value_of(stage.level) > 1.0e-12 ? out.force / stage.level : T(0.0);
}

// The law theta = decayed + gain g(w), as it holds over a stage, with the set-valued g = sign(w).
// `backbone` receives g where it is needed, for two processes.
template <class T>
STICKSLIP_INLINE void solve_set_valued(const Stage<T>& stage, const Process<T>& law,
                                       bool two_processes, ContactSolution<T>& out, T& backbone) {
  const T reach = stage.alpha * stage.mobility * stage.level;
  const T centre = stage.free_slip - reach * law.decayed;
  if (std::abs(value_of(centre)) <= value_of(reach * law.gain) && value_of(stage.mobility) > 0.0) {
    out.slip = T(0.0);
    out.force = stage.free_slip / (stage.alpha * stage.mobility);
    out.theta = value_of(stage.level) > 0.0 ? out.force / stage.level : T(0.0);
  } else {
    const double sign = value_of(centre) > 0.0 ? 1.0 : (value_of(centre) < 0.0 ? -1.0 : 0.0);
    out.theta = law.decayed + law.gain * sign;
    out.slip = stage.free_slip - reach * out.theta;
    out.force = stage.level * out.theta;
  }
  if (two_processes) {
    backbone = value_of(law.gain) > 0.0 ? (out.theta - law.decayed) / law.gain : T(0.0);
  }
}

// As solve_set_valued, with g(w) = tanh(w / transition_speed).
template <class T>
STICKSLIP_INLINE void solve_smooth(const Stage<T>& stage, const Process<T>& law,
                                   const T& transition_speed, ContactSolution<T>& out,
                                   T& backbone) {
  const T reach = stage.alpha * stage.mobility * stage.level;
  const BackboneSlip solved =
      solve_backbone(value_of(stage.free_slip), value_of(reach), value_of(law.decayed),
                     value_of(law.gain), value_of(transition_speed), stage.guess);
  // One Newton step in T changes the value by rounding only and makes the derivatives exact.
  T w(solved.w);
  const double t = solved.tanh;
  const double slope =
      1.0 + value_of(reach * law.gain) * (1.0 - t * t) / value_of(transition_speed);
  backbone = known_tanh(w / transition_speed, t);
  w -= (w + reach * (law.decayed + law.gain * backbone) - stage.free_slip) * (1.0 / slope);
  backbone = known_tanh(w / transition_speed, t);
  out.slip = w;
  out.theta = law.decayed + law.gain * backbone;
  out.force = stage.level * out.theta;
}

template <class T>
STICKSLIP_INLINE void solve_backbone_contact(bool set_valued, bool two_processes,
                                             const Stage<T>& stage, const Process<T>& law,
                                             const Coefficients<T>& c, ContactSolution<T>& out,
                                             T& backbone) {
  if (set_valued) {
    solve_set_valued(stage, law, two_processes, out, backbone);
  } else {
    solve_smooth(stage, law, c.transition_speed, out, backbone);
  }
}

// Theta as the sum of a fast and a slow process, with shares that give it the mean lag of one.
template <class T>
STICKSLIP_INLINE void solve_two_processes(bool set_valued, const Stage<T>& stage,
                                          const Coefficients<T>& c, const T& from_fast,
                                          const T& from_slow, ContactSolution<T>& out) {
  const Process<T> fast =
      process(from_fast, stage.backbone, stage.alpha * c.rate * (1.0 + c.rate_spread));
  const Process<T> slow =
      process(from_slow, stage.backbone, stage.alpha * c.rate * (1.0 - c.rate_spread));
  const T share = 0.5 * (1.0 + c.rate_spread);
  const Process<T> sum{share * fast.decayed + (1.0 - share) * slow.decayed,
                       share * fast.gain + (1.0 - share) * slow.gain};
  T backbone(0.0);
  solve_backbone_contact(set_valued, true, stage, sum, c, out, backbone);
  out.contact = fast.decayed + fast.gain * backbone;
  out.slow = slow.decayed + slow.gain * backbone;
}

// `contact`: the contact's state at the beginning of the stage. `own`: its further states, theta of
// a slow process or the deflections of parallel elements.
template <class T>
STICKSLIP_INLINE void solve_contact(const Structure& structure, bool set_valued,
                                    const Coefficients<T>& c, const Stage<T>& stage,
                                    const T& contact, const T* own, ContactSolution<T>& out) {
  if (structure.kinetics == Kinetics::bristle) {
    if (structure.loop) return solve_loop_contact(stage, c, contact, out);
    if (structure.elements > 1) return solve_parallel_contact(stage, c, contact, own, out);
    solve_bristle_contact(stage, c, contact, out);
    return;
  }
  if (structure.kinetics == Kinetics::ageing) return solve_ageing_contact(stage, c, contact, out);
  if (structure.two_processes) {
    solve_two_processes(set_valued, stage, c, contact, *own, out);
    return;
  }
  const Process<T> law = structure.kinetics == Kinetics::relaxing
                             ? process(contact, stage.backbone, stage.alpha * c.rate)
                             : Process<T>{T(0.0), stage.backbone};
  T backbone(0.0);
  solve_backbone_contact(set_valued, false, stage, law, c, out, backbone);
  out.contact = out.theta;
}

// States of the contact beside state::contact, which the effect that adds them holds.
int own_states_of(const Structure& structure) {
  return structure.two_processes ? 1 : structure.elements - 1;
}

Structure structure_of(const Model& model) {
  Structure structure;
  structure.excitation = model.oscillator.excitation;
  structure.friction = model.friction.law != FrictionLaw::none;
  structure.kinetics = model.friction.law == FrictionLaw::state_variable ? Kinetics::relaxing
                                                                         : Kinetics::instantaneous;
  structure.load_cell = model.load_cell.has_value();
  structure.resonant = model.load_cell && model.load_cell->dynamics == LoadCellDynamics::resonant;
  structure.two_well = model.oscillator.two_well.has_value();
  structure.loaded = model.normal_load.has_value();
  structure.load_law = model.normal_load ? model.normal_load->law : NormalLoadLaw::constant;
  return structure;
}

double longest_step_of(const Structure& structure, const Coefficients<double>& c) {
  double fastest = 2.0 * pi * 2.0;
  if (structure.excitation != Excitation::imposed) {
    const double k = structure.two_well ? 2.0 * c.well_linear : c.stiffness;
    fastest = std::max({fastest, std::sqrt(k / c.mass), c.damping / c.mass});
  }
  if (structure.resonant) fastest = std::max(fastest, std::sqrt(c.cell_stiffness / c.cell_mass));
  return std::clamp(0.05 / fastest, 1.0e-6, 1.0e-3);
}

const Model& checked(const Model& model) {
  const auto wrong = inconsistencies_of(model);
  if (!wrong.empty()) {
    throw std::invalid_argument("model: " + wrong.front().path + " " + wrong.front().message);
  }
  if (model.terms.size() > max_terms) {
    throw std::invalid_argument("model: at most " + std::to_string(max_terms) +
                                " [[physics]] terms");
  }
  return model;
}

// Reads parameter values in the order of parameters_of.
template <class T>
class ParameterReader {
 public:
  explicit ParameterReader(std::span<const T> values) : values_(values) {}
  const T& next() { return values_[next_++]; }

 private:
  std::span<const T> values_;
  std::size_t next_ = 0;
};

template <class T>
void read_oscillator(const Oscillator& oscillator, ParameterReader<T>& parameters,
                     RigNumbers<T>& n) {
  using std::sqrt;
  if (oscillator.excitation == Excitation::imposed) {
    n.inverse_mass = T(0.0);
    return;
  }
  n.c.mass = parameters.next();
  T frequency_rad_s(0.0);
  if (oscillator.natural_frequency_hz) {
    frequency_rad_s = parameters.next() * (2.0 * pi);
    n.c.stiffness = n.c.mass * frequency_rad_s * frequency_rad_s;
  }
  if (oscillator.stiffness_n_m) {
    n.c.stiffness = parameters.next();
    if (n.c.stiffness > 0.0) frequency_rad_s = sqrt(n.c.stiffness / n.c.mass);
  }
  if (oscillator.damping_ratio) n.c.damping = 2.0 * parameters.next() * n.c.mass * frequency_rad_s;
  if (oscillator.damping_n_s_m) n.c.damping = parameters.next();
  if (oscillator.two_well) {
    n.c.well_linear = parameters.next();
    n.c.well_cubic = parameters.next();
  }
  n.inverse_mass = 1.0 / n.c.mass;
}

// A parameter that neither departs from `neutral` nor may do so leaves readings as they are.
template <class T>
bool acts(const std::optional<Parameter>& parameter, const T& value, double neutral) {
  return parameter && (parameter->sigma > 0.0 || value_of(value) != neutral);
}

// Lag at low frequencies of filters with another cut-off behind that with the declared one. Below
// the cut-off a low-pass is a delay, so that a change by a few per cent is a change of the delay.
template <class T>
T further_lag_s(const Filter& filter, const T& cutoff_hz) {
  const double lag_s = FilterChain({&filter, 1}, 1.0e-3).lag_s();
  return lag_s * (filter.cutoff_hz.value / cutoff_hz - 1.0);
}

// Adds to the laws and returns the lag of the channel's filters beyond the declared one.
template <class T>
T read_instrument(const Sensor& sensor, ParameterReader<T>& parameters, ReadingLaw<T>& law,
                  ReadingLaws<T>& laws) {
  if (sensor.gain) law.gain = parameters.next();
  if (sensor.offset) law.offset = parameters.next();
  if (sensor.delay_s) law.delay_s += parameters.next();
  bool late = value_of(law.delay_s) != 0.0 || (sensor.delay_s && sensor.delay_s->sigma > 0.0);
  T lag_s(0.0);
  for (const Filter& filter : sensor.filters) {
    const T& cutoff_hz = parameters.next();
    if (!acts<T>(filter.cutoff_hz, cutoff_hz, filter.cutoff_hz.value)) continue;
    const T further_s = further_lag_s(filter, cutoff_hz);
    law.cutoff_change -= further_s / FilterChain(sensor.filters, 1.0e-3).lag_s();
    lag_s += further_s;
    late = true;
  }
  law.delay_s += lag_s;
  law.lag_s += lag_s;
  laws.any_delay = laws.any_delay || late;
  laws.any_error = laws.any_error || late || acts(sensor.gain, law.gain, 1.0) ||
                   acts(sensor.offset, law.offset, 0.0);
  return lag_s;
}

template <class T>
void read_instruments(const Model& model, ParameterReader<T>& parameters, ReadingLaws<T>& laws) {
  for (const Channel channel : all_channels) {
    const T lag_s = read_instrument(model.sensors[index_of(channel)], parameters,
                                    laws.of[index_of(channel)], laws);
    // The velocity chain continues that of the displacement.
    if (channel == Channel::displacement) {
      ReadingLaw<T>& velocity = laws.of[index_of(Channel::velocity)];
      velocity.delay_s += lag_s;
      velocity.lag_s += lag_s;
    }
  }
}

template <class T>
void read_contact(const Model& model, bool resonant, ParameterReader<T>& parameters,
                  RigNumbers<T>& n) {
  if (model.normal_load && model.normal_load->law != NormalLoadLaw::measured) {
    n.c.load = parameters.next();
    if (model.normal_load->law == NormalLoadLaw::wedge) n.c.load_slope = parameters.next();
  }
  if (model.friction.law != FrictionLaw::none) {
    n.c.mu = parameters.next();
    n.c.transition_speed = parameters.next();
    if (model.friction.law == FrictionLaw::state_variable) n.c.rate = parameters.next();
  }
  if (model.load_cell) {
    n.c.cell_mass = parameters.next();
    const T frequency_rad_s = parameters.next() * (2.0 * pi);
    const T ratio = parameters.next();
    n.c.cell_stiffness = n.c.cell_mass * frequency_rad_s * frequency_rad_s;
    n.c.cell_damping = 2.0 * ratio * n.c.cell_mass * frequency_rad_s;
    if (resonant) n.inverse_cell_mass = 1.0 / n.c.cell_mass;
  }
}

// A restoring force per mass where it acts: its slope, and its curvature times the velocity
// squared.
template <class T>
struct Restoring {
  T slope{0.0};
  T bending{0.0};
};

// The terms of third order of an oscillation in a step of `h`, whose derivatives are `moving` and
// `accelerating`. A step of second order alone raises the frequency by (omega h)^2 / 6: that of a
// load cell, or of a swing from well to well, by 0.03 %, which shows in half a minute of readings.
template <class T>
void add_third_order(T& position, T& velocity, const T& moving, const T& accelerating,
                     const Restoring<T>& restoring, const T& damping_per_mass, double h) {
  // A step of second order has a part of what the curvature does.
  constexpr double left = 1.0 - 1.5 * gamma_ars;
  const T jerk = -(restoring.slope * moving + damping_per_mass * accelerating);
  const T snap =
      -(restoring.slope * accelerating + damping_per_mass * jerk) - left * restoring.bending;
  const double share = h * h * h / 6.0;
  position += share * jerk;
  velocity += share * snap;
}

}  // namespace

std::vector<BoundTerm> bound_terms(const Model& model) {
  std::size_t next_parameter = declared_parameter_count(model);
  int next_state = state::first_effect;
  std::vector<BoundTerm> terms;
  for (const Term& term : model.terms) {
    BoundTerm bound;
    bound.effect = effect_of(term);
    bound.hooks = bound.effect->hooks();
    bound.place = {term.channel, term.from};
    bound.first_state = next_state;
    next_state += bound.effect->state_count();
    const auto cards = bound.effect->card().parameters;
    for (std::size_t i = 0; i < cards.size(); ++i) {
      const auto at = term.parameters.find(std::string(cards[i].name));
      bound.parameter[i] = at == term.parameters.end()
                               ? -1
                               : static_cast<int>(next_parameter) +
                                     static_cast<int>(std::distance(term.parameters.begin(), at));
      bound.fallback[i] = cards[i].fixed_default.value_or(0.0);
    }
    next_parameter += term.parameters.size();
    terms.push_back(bound);
  }
  return terms;
}

Rig::Rig(const Model& model)
    : model_(checked(model)), structure_(structure_of(model)), terms_(bound_terms(model)) {
  for (const NamedParameter& named : parameters_of(model_)) {
    values_.push_back(named.parameter->value);
    paths_.push_back(named.path);
  }
  for (const BoundTerm& term : terms_) {
    hooks_ |= term.hooks;
    state_count_ += term.effect->state_count();
    const int had = own_states_of(structure_);
    term.effect->set_structure(structure_);
    if (own_states_of(structure_) > had) own_state_ = term.first_state;
    if ((term.hooks & hook::slip_friction) == hook::slip_friction) friction_depends_on_slip_ = true;
    terms_have_rates_ =
        terms_have_rates_ || (term.hooks & hook::force) != 0 || term.effect->state_count() > 0;
  }
  if (state_count_ > max_rig_states) {
    throw std::invalid_argument("model: its [[physics]] terms have too many states of their own");
  }
  const auto n = numbers<double>(values_);
  set_valued_ = !(n.c.transition_speed > 0.0);
  longest_step_s_ = longest_step_of(structure_, n.c);
}

bool Rig::has_state(int index) const {
  switch (index) {
    case state::x:
    case state::v:
      return structure_.excitation != Excitation::imposed;
    case state::y:
    case state::u:
      return structure_.resonant;
    case state::contact:
      return structure_.friction && structure_.kinetics != Kinetics::instantaneous;
    default:
      return index < state_count_;
  }
}

template <class T>
RigNumbers<T> Rig::numbers(std::span<const T> parameters) const {
  RigNumbers<T> n;
  ParameterReader<T> reader(parameters);
  read_oscillator(model_.oscillator, reader, n);
  read_contact(model_, structure_.resonant, reader, n);
  read_instruments(model_, reader, n.reading);
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    const BoundTerm& term = terms_[i];
    const std::size_t count = term.effect->card().parameters.size();
    for (std::size_t j = 0; j < count; ++j) n.term[i][j] = term.value(j, parameters);
    if ((term.hooks & hook::coefficients) != 0) {
      term.effect->set_coefficients(n.c, n.term[i].data());
    }
    if ((term.hooks & hook::reading) != 0) {
      term.effect->set_reading_law(n.reading, term.place, n.term[i].data());
    }
  }
  return n;
}

template <class T>
T Rig::normal_load(const RigState<T>& state, const Input& now, double time_s,
                   const RigNumbers<T>& n) const {
  if (!model_.normal_load) return T(1.0);
  if (structure_.load_law == NormalLoadLaw::measured) {
    T load = n.load_gain * (now.normal_load_n - n.load_offset_n);
    return value_of(load) > 0.0 ? load : T(0.0);
  }
  T load = n.c.load;
  if (structure_.load_law == NormalLoadLaw::wedge) {
    const T& x = state.s[state::x];
    load = load * (1.0 + (n.c.load_slope + n.c.load_curvature * x) * x);
  }
  if ((hooks_ & hook::load) != 0) {
    OperatingPoint<T> at = operating_point(state, now, time_s);
    at.load = load;
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      if ((terms_[i].hooks & hook::load) == 0) continue;
      terms_[i].effect->scale_load(load, at, n.term[i].data(),
                                   &state.s[static_cast<std::size_t>(terms_[i].first_state)]);
    }
  }
  return load > 0.0 ? load : T(0.0);  // unilateral contact
}

template <class T>
T Rig::frame_acceleration(const RigState<T>& state, const Input& now,
                          const RigNumbers<T>& n) const {
  T acceleration = n.input_gain * now.base_acceleration_m_s2;
  if (structure_.excitation == Excitation::base) acceleration += state.unrecorded;
  return acceleration;
}

template <class T>
void Rig::explicit_rates(std::array<T, max_rig_states>& rate, const RigState<T>& state,
                         const Input& now, double time_s, const RigNumbers<T>& n) const {
  const Coefficients<T>& c = n.c;
  const T& x = state.s[state::x];
  const T& v = state.s[state::v];
  OperatingPoint<T> at;
  if (terms_have_rates_) at = operating_point(state, now, time_s);
  if (structure_.excitation != Excitation::imposed) {
    T restoring = c.damping * v;
    if (structure_.two_well) {
      restoring += x * (c.well_cubic * x * x - c.well_linear);
    } else {
      restoring += c.stiffness * x;
    }
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      if ((terms_[i].hooks & hook::force) == 0) continue;
      restoring += terms_[i].effect->force(
          at, n.term[i].data(), &state.s[static_cast<std::size_t>(terms_[i].first_state)]);
    }
    rate[state::x] = v;
    rate[state::v] = -restoring * n.inverse_mass;
    if (structure_.excitation == Excitation::force) {
      rate[state::v] += n.inverse_mass *
                        (n.input_gain * (now.drive_force_n - n.input_offset_n) + state.unrecorded);
    } else {
      rate[state::v] -= frame_acceleration(state, now, n);
    }
  }
  if (structure_.resonant) {
    const T& y = state.s[state::y];
    const T& u = state.s[state::u];
    rate[state::y] = u;
    rate[state::u] = -((c.cell_damping * u + c.cell_stiffness * y) * n.inverse_cell_mass) -
                     frame_acceleration(state, now, n);
  }
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    if (terms_[i].effect->state_count() == 0) continue;
    const auto first = static_cast<std::size_t>(terms_[i].first_state);
    terms_[i].effect->rates(&rate[first], at, n.term[i].data(), &state.s[first]);
  }
}

template <class T>
void Rig::scale_friction(FrictionFactors<T>& factors, const RigState<T>& state, const T& slip,
                         const Input& now, double time_s, const RigNumbers<T>& n) const {
  OperatingPoint<T> at = operating_point(state, now, time_s);
  at.slip = slip;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    if ((terms_[i].hooks & hook::friction) == 0) continue;
    terms_[i].effect->scale_friction(factors, at, n.term[i].data(),
                                     &state.s[static_cast<std::size_t>(terms_[i].first_state)]);
  }
}

// An imposed motion. Its derivatives, which an Input does not have, remain.
template <class T>
void set_motion(RigState<T>& state, const Input& now) {
  state.s[state::x] += now.displacement_m - value_of(state.s[state::x]);
  state.s[state::v] += now.velocity_m_s + value_of(state.unrecorded) - value_of(state.s[state::v]);
}

template <class T>
void Rig::close_contact(RigState<T>& state, double alpha, const Input& now, double time_s,
                        const RigNumbers<T>& n) const {
  const bool imposed = structure_.excitation == Excitation::imposed;
  if (imposed) {
    set_motion(state, now);
  }
  Stage<T> stage;
  stage.alpha = alpha;
  stage.guess = value_of(state.slip);
  stage.free_slip = state.s[state::v];
  if (structure_.resonant) stage.free_slip -= state.s[state::u];
  state.load = normal_load(state, now, time_s, n);
  if (!structure_.friction) {
    state.slip = stage.free_slip;
    return;
  }
  stage.mobility = n.inverse_mass + n.inverse_cell_mass;

  T* const own = own_state_ >= 0 ? &state.s[static_cast<std::size_t>(own_state_)] : nullptr;
  // A viscous force of the contact shares its slip velocity: without it the rest would slip more
  // freely.
  const bool viscous = value_of(n.c.contact_viscosity) != 0.0;
  if (viscous) {
    const T share = 1.0 / (1.0 + alpha * stage.mobility * n.c.contact_viscosity);
    stage.free_slip *= share;
    stage.mobility *= share;
  }
  ContactSolution<T> solution;
  // Factors that depend on the slip velocity are iterated: they vary slowly over a step.
  const int rounds = friction_depends_on_slip_ ? 3 : 1;
  for (int round = 0; round < rounds; ++round) {
    FrictionFactors<T> factors{n.c.mu};
    if ((hooks_ & hook::friction) != 0) {
      const T slip = round == 0 ? stage.free_slip : solution.slip;
      scale_friction(factors, state, slip, now, time_s, n);
    }
    stage.backbone = factors.backbone;
    stage.level = factors.mu;
    if (structure_.loaded) stage.level *= state.load;
    solve_contact(structure_, set_valued_, n.c, stage, state.s[state::contact], own, solution);
  }

  if (structure_.two_processes) *own = solution.slow;
  if (structure_.elements > 1) advance_elements(stage, n.c, solution.slip, own);
  if (viscous) {
    const T drag = n.c.contact_viscosity * solution.slip;
    solution.force += drag;
    if (value_of(stage.level) > 1.0e-12) solution.theta += drag / stage.level;
  }
  state.slip = solution.slip;
  state.friction = solution.force;
  state.theta = solution.theta;
  if (structure_.kinetics != Kinetics::instantaneous) state.s[state::contact] = solution.contact;
  if (!imposed) state.s[state::v] -= alpha * n.inverse_mass * solution.force;
  if (structure_.resonant) {
    state.s[state::u] += alpha * n.inverse_cell_mass * solution.force;
  } else if (!imposed) {
    state.s[state::v] = solution.slip;  // the same number, but exactly 0 where the mass sticks
  }
}

template <class T>
void Rig::complete(RigState<T>& state, const Input& now, double time_s,
                   const RigNumbers<T>& n) const {
  // A contact stage of negligible length: velocities stay, force and theta follow.
  const auto kept = state.s;
  close_contact(state, 1.0e-9, now, time_s, n);
  state.s = kept;
  if (structure_.excitation == Excitation::imposed) {
    set_motion(state, now);
  }
}

template <class T>
void Rig::undivided_step(RigState<T>& state, const Input& begin, const Input& end, double time_s,
                         double h, const RigNumbers<T>& n) const {
  const auto count = static_cast<std::size_t>(state_count_);
  const double alpha = gamma_ars * h;
  std::array<T, max_rig_states> e1{};
  std::array<T, max_rig_states> e2{};
  const std::array<T, max_rig_states> start = state.s;

  explicit_rates(e1, state, begin, time_s, n);
  for (std::size_t i = 0; i < count; ++i) state.s[i] += alpha * e1[i];
  const std::array<T, max_rig_states> predicted = state.s;
  const Input middle = between(begin, end, gamma_ars);
  close_contact(state, alpha, middle, time_s + alpha, n);

  // The implicit rate of the second stage.
  std::array<T, max_rig_states> i2{};
  const auto set_rate = [&](int index) {
    const auto i = static_cast<std::size_t>(index);
    if (has_state(index)) i2[i] = (state.s[i] - predicted[i]) * (1.0 / alpha);
  };
  for (const int index : {state::v, state::u, state::contact}) set_rate(index);
  for (int i = 0; i < own_states_of(structure_); ++i) set_rate(own_state_ + i);
  explicit_rates(e2, state, middle, time_s + alpha, n);
  for (std::size_t i = 0; i < count; ++i) {
    state.s[i] =
        start[i] + h * (delta_ars * e1[i] + (1.0 - delta_ars) * e2[i] + (1.0 - gamma_ars) * i2[i]);
  }
  if (structure_.two_well && structure_.excitation != Excitation::imposed) {
    const T& x = start[state::x];
    const T cubic = n.c.well_cubic * n.inverse_mass;
    const T speed = e2[state::x];
    add_third_order(state.s[state::x], state.s[state::v], speed, e2[state::v] + i2[state::v],
                    Restoring<T>{3.0 * cubic * x * x - n.c.well_linear * n.inverse_mass,
                                 6.0 * cubic * x * speed * speed},
                    n.c.damping * n.inverse_mass, h);
  }
  if (structure_.resonant) {
    add_third_order(state.s[state::y], state.s[state::u], e2[state::y], e2[state::u] + i2[state::u],
                    Restoring<T>{n.c.cell_stiffness * n.inverse_cell_mass},
                    n.c.cell_damping * n.inverse_cell_mass, h);
  }
  close_contact(state, alpha, end, time_s + h, n);
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    if (terms_[i].effect->state_count() == 0) continue;
    terms_[i].effect->confine(&state.s[static_cast<std::size_t>(terms_[i].first_state)],
                              n.term[i].data());
  }
}

// True if friction passes through much of its transition while the slip velocity changes so.
bool Rig::is_transition(double slip, double next, double transition_speed) const {
  if (set_valued_) return (slip > 0.0) != (next > 0.0) || (slip < 0.0) != (next < 0.0);
  constexpr double much = 0.2;
  const auto level = [&](double each) { return std::clamp(each / transition_speed, -1.0, 1.0); };
  return std::abs(level(next) - level(slip)) > much;
}

template <class T>
void Rig::halving_step(RigState<T>& state, const Input& begin, const Input& end, double time_s,
                       double h, const RigNumbers<T>& n, int halvings) const {
  if (halvings == 0 || !structure_.friction) {
    undivided_step(state, begin, end, time_s, h, n);
    return;
  }
  const RigState<T> start = state;
  undivided_step(state, begin, end, time_s, h, n);
  if (!is_transition(value_of(start.slip), value_of(state.slip), value_of(n.c.transition_speed))) {
    return;
  }
  state = start;
  const Input middle = between(begin, end, 0.5);
  halving_step(state, begin, middle, time_s, 0.5 * h, n, halvings - 1);
  halving_step(state, middle, end, time_s + 0.5 * h, 0.5 * h, n, halvings - 1);
}

template <class T>
void Rig::step(RigState<T>& state, const Input& begin, const Input& end, double time_s, double h,
               const RigNumbers<T>& n) const {
  constexpr int most_halvings = 4;
  halving_step(state, begin, end, time_s, h, n, most_halvings);
}

template <class T>
Quantities<T> Rig::quantities(const RigState<T>& state, const Input& now,
                              const RigNumbers<T>& n) const {
  Quantities<T> q;
  q.displacement = state.s[state::x];
  q.velocity = state.s[state::v];
  q.normal_load = state.load;
  if ((hooks_ & hook::measured_motion) != 0) {
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      if ((terms_[i].hooks & hook::measured_motion) == 0) continue;
      terms_[i].effect->add_measured_motion(
          q.displacement, q.velocity, n.term[i].data(),
          &state.s[static_cast<std::size_t>(terms_[i].first_state)]);
    }
  }
  if (model_.normal_load_bridge) {
    const NormalLoadBridge& bridge = *model_.normal_load_bridge;
    using std::max;
    using std::min;
    const T share =
        max(T(0.0), min(T(1.0), T(bridge.share) + T(bridge.share_slope_per_m) * q.displacement));
    q.normal_load = state.load * (share / T(1.0 + bridge.mismatch) +
                                  (T(1.0) - share) / T(1.0 - bridge.mismatch));
  }
  if (structure_.resonant) {
    q.friction_reading = n.c.cell_stiffness * state.s[state::y];
  } else if (structure_.load_cell) {
    q.friction_reading =
        state.friction - n.c.cell_mass * frame_acceleration(state, now, n);  // Eq. (1)
  } else {
    q.friction_reading = state.friction;
  }
  return q;
}

template RigNumbers<double> Rig::numbers(std::span<const double>) const;
template RigNumbers<Dual> Rig::numbers(std::span<const Dual>) const;
template void Rig::complete(RigState<double>&, const Input&, double,
                            const RigNumbers<double>&) const;
template void Rig::complete(RigState<Dual>&, const Input&, double, const RigNumbers<Dual>&) const;
template void Rig::step(RigState<double>&, const Input&, const Input&, double, double,
                        const RigNumbers<double>&) const;
template void Rig::step(RigState<Dual>&, const Input&, const Input&, double, double,
                        const RigNumbers<Dual>&) const;
template double Rig::normal_load(const RigState<double>&, const Input&, double,
                                 const RigNumbers<double>&) const;
template Dual Rig::normal_load(const RigState<Dual>&, const Input&, double,
                               const RigNumbers<Dual>&) const;
template Quantities<double> Rig::quantities(const RigState<double>&, const Input&,
                                            const RigNumbers<double>&) const;
template Quantities<Dual> Rig::quantities(const RigState<Dual>&, const Input&,
                                          const RigNumbers<Dual>&) const;

}  // namespace stickslip::physics
