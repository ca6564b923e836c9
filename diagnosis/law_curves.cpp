// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/law_curves.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "physics/catalogue.h"
#include "physics/effect.h"
#include "physics/friction_laws.h"
#include "physics/rig.h"

namespace stickslip::diagnosis {

namespace {

using physics::Input;
using physics::Model;
namespace state = physics::state;

constexpr std::size_t drawn_points = 400;

// The contact under its mean load, without the rig around it.
Model contact_of(const Model& fitted, const Experiment& experiment) {
  Model model;
  model.oscillator.excitation = physics::Excitation::imposed;
  if (fitted.normal_load) {
    model.normal_load =
        physics::NormalLoad{physics::NormalLoadLaw::constant, {experiment.mean_load_n}, {}};
  }
  model.friction = fitted.friction;
  if (const physics::Term* law = physics::law_term(fitted)) model.terms = {*law};
  return model;
}

struct Motion {
  std::function<double(double)> displacement_m;
  std::function<double(double)> velocity_m_s;
};

// Calls visit(input, friction) in the last of three periods.
void cycle(const Model& contact, const Motion& motion, double period_s,
           const std::function<void(const Input&, double)>& visit) {
  const physics::Rig rig(contact);
  const auto n = rig.numbers<double>(rig.parameter_values());
  const auto substeps = static_cast<std::size_t>(
      std::clamp(std::ceil(period_s / (static_cast<double>(drawn_points) * rig.longest_step_s())),
                 8.0, 400.0));
  const double h = period_s / static_cast<double>(drawn_points * substeps);
  physics::RigState<double> at;
  const auto input = [&motion](double t) {
    Input now;
    now.displacement_m = motion.displacement_m(t);
    now.velocity_m_s = motion.velocity_m_s(t);
    return now;
  };
  constexpr std::size_t periods = 3;
  for (std::size_t i = 0; i < periods * drawn_points * substeps; ++i) {
    const double t = h * static_cast<double>(i);
    const Input end = input(t + h);
    rig.step(at, input(t), end, t, h, n);
    const bool last = i >= (periods - 1) * drawn_points * substeps;
    if (last && (i + 1) % substeps == 0) visit(end, at.friction);
  }
}

// The largest friction until the mass has slipped, under a force that grows at `rate_n_s`.
double break_away(const physics::Rig& rig, double rate_n_s, double slipped_m, double longest_s) {
  const auto n = rig.numbers<double>(rig.parameter_values());
  const double h = std::min(rig.longest_step_s(), 2.0e-4);
  physics::RigState<double> at;
  Input begin;
  double most = 0.0;
  for (double t = 0.0; t < longest_s && at.s[state::x] < slipped_m; t += h) {
    Input end;
    end.drive_force_n = rate_n_s * (t + h);
    rig.step(at, begin, end, t, h, n);
    begin = end;
    most = std::max(most, at.friction);
  }
  return most;
}

void add_break_away(const Model& contact, const Model& fitted, const Experiment& experiment,
                    LawCurves& out) {
  if (fitted.oscillator.excitation == physics::Excitation::imposed) return;
  Model mass = contact;
  mass.oscillator.excitation = physics::Excitation::force;
  mass.oscillator.mass_kg = {fitted.oscillator.mass_kg.value};
  mass.oscillator.stiffness_n_m = physics::Parameter{0.0};
  mass.oscillator.damping_n_s_m = physics::Parameter{0.0};
  const physics::Rig rig(mass);
  const double level_n = physics::friction_coefficient(fitted).value *
                         (fitted.normal_load ? experiment.mean_load_n : 1.0);
  const double slipped_m = 0.02 * experiment.largest.displacement_m;
  for (int i = 0; i <= 12; ++i) {
    const double rate_n_s = level_n * std::pow(10.0, 0.25 * i - 1.0);
    out.loading_rate_n_s.push_back(rate_n_s);
    out.break_away_n.push_back(break_away(rig, rate_n_s, slipped_m, 4.0 * level_n / rate_n_s));
  }
}

}  // namespace

FrictionCycle friction_cycle(const Model& model, const Experiment& experiment) {
  FrictionCycle out;
  Model contact = contact_of(model, experiment);
  for (const physics::Term& term : model.terms) {
    const physics::Effect* const effect = physics::effect_of(term);
    const bool of_friction =
        effect != nullptr && effect->card().relation == physics::Relation::friction_law;
    if (of_friction && !term.law) contact.terms.push_back(term);
  }
  const double amplitude = experiment.largest.displacement_m;
  const double speed = experiment.largest.velocity_m_s;
  if (!(amplitude > 0.0) || !(speed > 0.0)) return out;
  const double w = speed / amplitude;
  cycle(contact,
        {[=](double t) { return amplitude * std::sin(w * t); },
         [=](double t) { return speed * std::cos(w * t); }},
        2.0 * std::numbers::pi / w, [&](const Input& now, double force) {
          out.displacement_m.push_back(now.displacement_m);
          out.velocity_m_s.push_back(now.velocity_m_s);
          out.force_n.push_back(force);
        });
  // A closed loop.
  for (std::vector<double>* list : {&out.displacement_m, &out.velocity_m_s, &out.force_n}) {
    list->push_back(list->front());
  }
  return out;
}

LawCurves law_curves(const Model& fitted, const Experiment& experiment) {
  LawCurves out;
  const Model contact = contact_of(fitted, experiment);
  const double amplitude = experiment.largest.displacement_m;
  const double speed = experiment.largest.velocity_m_s;
  const double w = speed / amplitude;
  const double period_s = 2.0 * std::numbers::pi / w;
  cycle(contact,
        {[=](double t) { return amplitude * std::sin(w * t); },
         [=](double t) { return speed * std::cos(w * t); }},
        period_s, [&](const Input& now, double force) {
          out.displacement_m.push_back(now.displacement_m);
          out.velocity_m_s.push_back(now.velocity_m_s);
          out.force_n.push_back(force);
        });
  // Down to a twentieth of the mean speed.
  const double mean = 0.5 * speed;
  cycle(contact,
        {[=](double t) { return mean * t - 0.95 * mean / w * std::cos(w * t); },
         [=](double t) { return mean * (1.0 + 0.95 * std::sin(w * t)); }},
        period_s, [&](const Input& now, double force) {
          out.lag_velocity_m_s.push_back(now.velocity_m_s);
          out.lag_force_n.push_back(force);
        });
  add_break_away(contact, fitted, experiment, out);
  return out;
}

RecordedFriction recorded_friction(const Experiment& e) {
  RecordedFriction out;
  const std::size_t force = index_of(Channel::friction_force);
  if (!e.is_compared(force) || e.guess.empty()) return out;
  const Segment segment = e.longest_segment();
  // A few cycles in the middle of the longest segment.
  const double cycle_s =
      2.0 * std::numbers::pi * e.largest.displacement_m / std::max(e.largest.velocity_m_s, 1.0e-12);
  const auto wanted = static_cast<std::size_t>(4.0 * cycle_s / e.period_s);
  const std::size_t all = segment.usable_end - segment.usable_begin;
  const std::size_t count = std::clamp<std::size_t>(wanted, 1, all);
  const std::size_t first = segment.usable_begin + (all - count) / 2;
  const std::size_t step = std::max<std::size_t>(1, count / 1000);
  for (std::size_t k = first; k < first + count; k += step) {
    const StateGuess& guess = e.guess[k];
    out.displacement_m.push_back(guess.displacement_m);
    out.velocity_m_s.push_back(guess.velocity_m_s);
    out.force_n.push_back(guess.friction_n);
  }
  return out;
}

}  // namespace stickslip::diagnosis
