#include "physics/rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "physics/backbone.h"
#include "physics/effects/catalogue.h"

namespace stickslip::physics {

namespace {

using std::numbers::pi;

// ARS(2,2,2): delta makes the explicit part second order.
const double delta_ars = 1.0 - 1.0 / (2.0 * gamma_ars);

// tanh(x) where its value is known already; x brings the derivatives.
double known_tanh(double /*x*/, double value) { return value; }
Dual known_tanh(const Dual& x, double value) {
  return {value, x.d * Dual::slope(1.0 - value * value)};
}

// Solves w + a z(w) = target with z(w) = (z0 + alpha w) / (1 + alpha abs(w) r): the implicit step
// of a bristle that slips at 1/r; r is `back` for a w against the deflection z0.
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

// How much of a bristle's motion is slip at a deflection of `share` times the one that slips: 0 up
// to `elastic`, 1 from 1 on (Dupont, Hayward, Armstrong and Altpeter 2002, Eq. (17)).
template <class T>
T plastic_share(const T& share, const T& elastic) {
  using std::sin;
  if (!(value_of(share) > value_of(elastic))) return T(0.0);
  if (!(value_of(share) < 1.0)) return T(1.0);
  const T middle = 0.5 * (1.0 + elastic);
  return 0.5 + 0.5 * sin((share - middle) * (pi / (1.0 - elastic)));
}

// A relaxation process after an implicit step of `turn` time constants, for a backbone scaled by
// `scale`: what stays of where it was, and by how much it follows the law.
template <class T>
struct Process {
  T stays{0.0};
  T follows{0.0};
};
template <class T>
Process<T> process(const T& from, const T& scale, const T& turn) {
  const T blend = 1.0 / (1.0 + turn);
  return {from * blend, scale * turn * blend};
}

template <class T>
Instant<T> instant_of(const RigState<T>& state, const Input& now, double time_s) {
  Instant<T> at;
  at.time_s = time_s;
  at.x = state.s[state::x];
  at.v = state.s[state::v];
  at.slip = state.slip;
  at.load = state.load;
  at.base_acceleration_m_s2 = now.base_acceleration_m_s2;
  at.friction = state.friction;
  return at;
}

}  // namespace

Rig::Rig(const Model& model) : model_(model) {
  const auto wrong = inconsistencies_of(model);
  if (!wrong.empty()) {
    throw std::invalid_argument("model: " + wrong.front().path + " " + wrong.front().message);
  }
  if (model.terms.size() > max_terms) {
    throw std::invalid_argument("model: at most " + std::to_string(max_terms) +
                                " [[physics]] terms");
  }
  structure_.excitation = model.oscillator.excitation;
  structure_.friction = model.friction.law != FrictionLaw::none;
  structure_.kinetics = model.friction.law == FrictionLaw::state_variable ? Kinetics::relaxing
                                                                          : Kinetics::instantaneous;
  structure_.load_cell = model.load_cell.has_value();
  structure_.resonant = model.load_cell && model.load_cell->dynamics == LoadCellDynamics::resonant;
  structure_.two_well = model.oscillator.two_well.has_value();
  structure_.loaded = model.normal_load.has_value();
  structure_.load_law = model.normal_load ? model.normal_load->law : NormalLoadLaw::constant;

  for (const NamedParameter& named : parameters_of(model_)) {
    values_.push_back(named.parameter->value);
    paths_.push_back(named.path);
  }
  for (const Term& term : model_.terms) {
    BoundTerm entry;
    entry.effect = find_effect(term.id);
    entry.hooks = entry.effect->hooks();
    entry.place = {term.channel, term.from};
    hooks_ |= entry.hooks;
    entry.first_state = state_count_;
    state_count_ += entry.effect->state_count();
    const auto cards = entry.effect->card().parameters;
    for (std::size_t i = 0; i < cards.size(); ++i) {
      const std::string path = path_of(term) + "." + std::string(cards[i].name);
      const auto at = std::find(paths_.begin(), paths_.end(), path);
      entry.parameter[i] = at == paths_.end() ? -1 : static_cast<int>(at - paths_.begin());
      entry.fallback[i] = cards[i].fixed_default.value_or(0.0);
    }
    const bool had_two_processes = structure_.two_processes;
    entry.effect->shape(structure_);
    if (structure_.two_processes && !had_two_processes) slow_state_ = entry.first_state;
    if ((entry.hooks & hook::slip_friction) == hook::slip_friction)
      friction_depends_on_slip_ = true;
    terms_have_rates_ =
        terms_have_rates_ || (entry.hooks & hook::force) != 0 || entry.effect->state_count() > 0;
    terms_.push_back(entry);
  }
  if (state_count_ > max_rig_states) {
    throw std::invalid_argument("model: its [[physics]] terms have too many states of their own");
  }

  const auto n = numbers<double>(values_);
  set_valued_ = !(n.c.transition_speed > 0.0);
  double fastest = 2.0 * pi * 2.0;
  if (structure_.excitation != Excitation::imposed) {
    const double k = structure_.two_well ? 2.0 * n.c.well_linear : n.c.stiffness;
    fastest = std::max({fastest, std::sqrt(k / n.c.mass), n.c.damping / n.c.mass});
  }
  if (structure_.resonant)
    fastest = std::max(fastest, std::sqrt(n.c.cell_stiffness / n.c.cell_mass));
  longest_step_s_ = std::clamp(0.05 / fastest, 1.0e-6, 1.0e-3);
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
  using std::sqrt;
  RigNumbers<T> n;
  std::size_t next = 0;
  const auto take = [&] { return parameters[next++]; };

  // The order is that of parameters_of.
  const Oscillator& oscillator = model_.oscillator;
  if (oscillator.excitation != Excitation::imposed) {
    n.c.mass = take();
    T frequency_rad_s(0.0);
    if (oscillator.natural_frequency_hz) {
      frequency_rad_s = take() * (2.0 * pi);
      n.c.stiffness = n.c.mass * frequency_rad_s * frequency_rad_s;
    }
    if (oscillator.stiffness_n_m) {
      n.c.stiffness = take();
      if (n.c.stiffness > 0.0) frequency_rad_s = sqrt(n.c.stiffness / n.c.mass);
    }
    if (oscillator.damping_ratio) n.c.damping = 2.0 * take() * n.c.mass * frequency_rad_s;
    if (oscillator.damping_n_s_m) n.c.damping = take();
    if (oscillator.two_well) {
      n.c.well_linear = take();
      n.c.well_cubic = take();
    }
    n.inverse_mass = 1.0 / n.c.mass;
  } else {
    n.inverse_mass = T(0.0);
  }
  if (model_.normal_load && model_.normal_load->law != NormalLoadLaw::measured) {
    n.c.load = take();
    if (model_.normal_load->law == NormalLoadLaw::wedge) n.c.load_slope = take();
  }
  if (model_.friction.law != FrictionLaw::none) {
    n.c.mu = take();
    n.c.transition_speed = take();
    if (model_.friction.law == FrictionLaw::state_variable) n.c.rate = take();
  }
  if (model_.load_cell) {
    n.c.cell_mass = take();
    const T frequency_rad_s = take() * (2.0 * pi);
    const T ratio = take();
    n.c.cell_stiffness = n.c.cell_mass * frequency_rad_s * frequency_rad_s;
    n.c.cell_damping = 2.0 * ratio * n.c.cell_mass * frequency_rad_s;
    if (structure_.resonant) n.inverse_cell_mass = 1.0 / n.c.cell_mass;
  }
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    const BoundTerm& entry = terms_[i];
    const std::size_t count = entry.effect->card().parameters.size();
    for (std::size_t j = 0; j < count; ++j) {
      n.term[i][j] = entry.parameter[j] >= 0
                         ? parameters[static_cast<std::size_t>(entry.parameter[j])]
                         : T(entry.fallback[j]);
    }
    if ((entry.hooks & hook::coefficients) != 0) entry.effect->set(n.c, n.term[i].data());
    if ((entry.hooks & hook::reading) != 0) {
      entry.effect->misread(n.reading, entry.place, n.term[i].data());
    }
  }
  return n;
}

template <class T>
T Rig::normal_load(const RigState<T>& state, const Input& now, double time_s,
                   const RigNumbers<T>& n) const {
  if (!model_.normal_load) return T(1.0);
  if (structure_.load_law == NormalLoadLaw::measured) return T(std::max(0.0, now.normal_load_n));
  T load = n.c.load;
  if (structure_.load_law == NormalLoadLaw::wedge) {
    const T& x = state.s[state::x];
    load = load * (1.0 + (n.c.load_slope + n.c.load_curvature * x) * x);
  }
  if ((hooks_ & hook::load) != 0) {
    Instant<T> at = instant_of(state, now, time_s);
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
  T acceleration = n.input_share * now.base_acceleration_m_s2;
  if (structure_.excitation == Excitation::base) acceleration += state.unrecorded;
  return acceleration;
}

template <class T>
void Rig::explicit_rates(std::array<T, max_rig_states>& rate, const RigState<T>& state,
                         const Input& now, double time_s, const RigNumbers<T>& n) const {
  const Coefficients<T>& c = n.c;
  const T& x = state.s[state::x];
  const T& v = state.s[state::v];
  Instant<T> at;
  if (terms_have_rates_) at = instant_of(state, now, time_s);
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
      rate[state::v] += n.inverse_mass * (n.input_share * now.drive_force_n + state.unrecorded);
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

// On entry state.s holds the explicit predictions of a stage; on return the stage itself, in which
// the contact has acted for `alpha` seconds with the force that it has at the end of them.
template <class T>
void Rig::close_contact(RigState<T>& state, double alpha, const Input& now, double time_s,
                        const RigNumbers<T>& n) const {
  const bool imposed = structure_.excitation == Excitation::imposed;
  if (imposed) {
    state.s[state::x] = T(now.displacement_m);
    state.s[state::v] = T(now.velocity_m_s);
  }
  const double guess = value_of(state.slip);
  T free_slip = state.s[state::v];
  if (structure_.resonant) free_slip -= state.s[state::u];
  state.load = normal_load(state, now, time_s, n);
  if (!structure_.friction) {
    state.slip = free_slip;
    return;
  }

  const Coefficients<T>& c = n.c;
  const T mobility = n.inverse_mass + n.inverse_cell_mass;
  T w(guess);
  T force(0.0);
  T theta(0.0);
  T contact = state.s[state::contact];
  T backbone(0.0);
  T slow_part(0.0);
  Process<T> fast;
  Process<T> slow;
  // Factors that depend on the slip velocity are frozen and renewed: they vary slowly over a step.
  const int rounds = friction_depends_on_slip_ ? 3 : 1;
  for (int round = 0; round < rounds; ++round) {
    FrictionFactors<T> factors;
    if ((hooks_ & hook::friction) != 0) {
      Instant<T> at = instant_of(state, now, time_s);
      at.slip = round == 0 ? free_slip : w;
      for (std::size_t i = 0; i < terms_.size(); ++i) {
        if ((terms_[i].hooks & hook::friction) == 0) continue;
        terms_[i].effect->scale_friction(factors, at, n.term[i].data(),
                                         &state.s[static_cast<std::size_t>(terms_[i].first_state)]);
      }
    }
    T level = c.mu * factors.mu;
    if (structure_.loaded) level *= state.load;
    const T reach = alpha * mobility * level;

    if (structure_.kinetics == Kinetics::bristle) {
      const double slip_level = std::max(value_of(level * factors.backbone), 1.0e-12);
      const T r = value_of(level * factors.backbone) > 1.0e-12
                      ? c.contact_stiffness / (level * factors.backbone)
                      : T(value_of(c.contact_stiffness) / slip_level);
      const T& z0 = state.s[state::contact];
      // Nothing slips while the deflection is small, nor while it shrinks; unless it is Dahl's
      // bristle, which always slips a little.
      T along = r;
      T back = r;
      if (value_of(c.contact_elastic_share) > 0.0) {
        using std::abs;
        T elastic = c.contact_elastic_share;
        if (value_of(elastic) > 0.99) elastic = T(0.99);
        along = r * plastic_share(abs(z0) * r, elastic);
        back = T(0.0);
      }
      // The bristle's own damping acts on its deflection over the step: it adds to the stiffness,
      // and pushes from where the bristle was.
      const T a = mobility * (alpha * c.contact_stiffness + c.contact_damping);
      const T push = mobility * c.contact_damping * z0;
      const T target = free_slip + push;
      w = T(solve_bristle(value_of(target), value_of(a), value_of(z0), alpha, value_of(along),
                          value_of(back), guess));
      const T& slipping = value_of(w) * value_of(z0) < 0.0 ? back : along;
      // One Newton step in T: its value changes nothing, its derivatives are exact.
      const double sign = value_of(w) < 0.0 ? -1.0 : 1.0;
      const double denominator = 1.0 + alpha * std::abs(value_of(w)) * value_of(slipping);
      const double slope = 1.0 + value_of(a) * alpha *
                                     (1.0 - sign * value_of(slipping) * value_of(z0)) /
                                     (denominator * denominator);
      const auto deflection = [&](const T& slip) {
        return (z0 + alpha * slip) / (1.0 + (alpha * sign) * slip * slipping);
      };
      w -= (w + a * deflection(w) - target) * (1.0 / slope);
      contact = deflection(w);
      force = c.contact_stiffness * contact + c.contact_damping * (contact - z0) * (1.0 / alpha);
      theta = value_of(level) > 1.0e-12 ? force / level : T(0.0);
      continue;
    }

    T p(0.0);
    T q = factors.backbone;
    if (structure_.two_processes) {
      fast = process(state.s[state::contact], factors.backbone,
                     alpha * c.rate * (1.0 + c.rate_spread));
      slow = process(state.s[static_cast<std::size_t>(slow_state_)], factors.backbone,
                     alpha * c.rate * (1.0 - c.rate_spread));
      // With these shares the mean lag is that of a single process.
      const T share = 0.5 * (1.0 + c.rate_spread);
      p = share * fast.stays + (1.0 - share) * slow.stays;
      q = share * fast.follows + (1.0 - share) * slow.follows;
    } else if (structure_.kinetics == Kinetics::relaxing) {
      const Process<T> only = process(state.s[state::contact], factors.backbone, alpha * c.rate);
      p = only.stays;
      q = only.follows;
    }
    if (set_valued_) {
      const T centre = free_slip - reach * p;
      if (std::abs(value_of(centre)) <= value_of(reach * q) && value_of(mobility) > 0.0) {
        w = T(0.0);
        force = free_slip / (alpha * mobility);
        theta = value_of(level) > 0.0 ? force / level : T(0.0);
      } else {
        const double sign = value_of(centre) > 0.0 ? 1.0 : (value_of(centre) < 0.0 ? -1.0 : 0.0);
        theta = p + q * sign;
        w = free_slip - reach * theta;
        force = level * theta;
      }
      // What the law's own value must have been for this theta.
      if (structure_.two_processes) {
        backbone = value_of(q) > 0.0 ? (theta - p) / q : T(0.0);
      }
    } else {
      const BackboneSlip solved = solve_backbone(value_of(free_slip), value_of(reach), value_of(p),
                                                 value_of(q), value_of(c.transition_speed), guess);
      // One Newton step in T: its value changes next to nothing, its derivatives are exact.
      w = T(solved.w);
      const double t = solved.tanh;
      const double slope = 1.0 + value_of(reach * q) * (1.0 - t * t) / value_of(c.transition_speed);
      backbone = known_tanh(w / c.transition_speed, t);
      w -= (w + reach * (p + q * backbone) - free_slip) * (1.0 / slope);
      backbone = known_tanh(w / c.transition_speed, t);
      theta = p + q * backbone;
      force = level * theta;
    }
    if (structure_.two_processes) {
      contact = fast.stays + fast.follows * backbone;
      slow_part = slow.stays + slow.follows * backbone;
    } else {
      contact = theta;
    }
  }

  state.slip = w;
  state.friction = force;
  state.theta = theta;
  if (structure_.two_processes) state.s[static_cast<std::size_t>(slow_state_)] = slow_part;
  if (structure_.kinetics != Kinetics::instantaneous) state.s[state::contact] = contact;
  if (!imposed) state.s[state::v] -= alpha * n.inverse_mass * force;
  if (structure_.resonant) {
    state.s[state::u] += alpha * n.inverse_cell_mass * force;
  } else if (!imposed) {
    state.s[state::v] = w;  // the same number, but exactly 0 where the mass sticks
  }
}

template <class T>
void Rig::complete(RigState<T>& state, const Input& now, double time_s,
                   const RigNumbers<T>& n) const {
  // The contact acting for an instant: velocities stay, force and theta follow.
  const auto kept = state.s;
  close_contact(state, 1.0e-9, now, time_s, n);
  state.s = kept;
  if (structure_.excitation == Excitation::imposed) {
    state.s[state::x] = T(now.displacement_m);
    state.s[state::v] = T(now.velocity_m_s);
  }
}

template <class T>
void Rig::step(RigState<T>& state, const Input& begin, const Input& end, double time_s, double h,
               const RigNumbers<T>& n) const {
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

  // What the contact did in the second stage, as a rate.
  std::array<T, max_rig_states> i2{};
  for (const int index : {state::v, state::u, state::contact, slow_state_}) {
    const auto i = static_cast<std::size_t>(index);
    if (index >= 0 && has_state(index)) i2[i] = (state.s[i] - predicted[i]) * (1.0 / alpha);
  }
  explicit_rates(e2, state, middle, time_s + alpha, n);
  for (std::size_t i = 0; i < count; ++i) {
    state.s[i] =
        start[i] + h * (delta_ars * e1[i] + (1.0 - delta_ars) * e2[i] + (1.0 - gamma_ars) * i2[i]);
  }
  close_contact(state, alpha, end, time_s + h, n);
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    if (terms_[i].effect->state_count() == 0) continue;
    terms_[i].effect->confine(&state.s[static_cast<std::size_t>(terms_[i].first_state)],
                              n.term[i].data());
  }
}

template <class T>
Quantities<T> Rig::quantities(const RigState<T>& state, const Input& now,
                              const RigNumbers<T>& n) const {
  Quantities<T> q;
  q.displacement = state.s[state::x];
  q.velocity = state.s[state::v];
  q.normal_load = state.load;
  if ((hooks_ & hook::seen) != 0) {
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      if ((terms_[i].hooks & hook::seen) == 0) continue;
      terms_[i].effect->see(q.displacement, q.velocity, n.term[i].data(),
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
