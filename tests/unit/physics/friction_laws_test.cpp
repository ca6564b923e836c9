// SPDX-License-Identifier: Apache-2.0
// The laws of friction by name, against their closed forms and against a fine integration of the
// published equations that shares no code with the rig.
#include "physics/friction_laws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "physics/catalogue.h"
#include "physics/declared_value.h"
#include "physics/model_consistency.h"
#include "physics/rig.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

constexpr double load_n = 2.0;

Model with_law(Model model, const std::string& id, const std::map<std::string, Parameter>& values) {
  model.friction = {};
  Term term;
  term.id = id;
  term.parameters = values;
  term.law = true;
  model.terms.insert(model.terms.begin(), term);
  settle_law(model);
  return model;
}

Model imposed(const std::string& id, const std::map<std::string, Parameter>& values) {
  Model model;
  model.oscillator.excitation = Excitation::imposed;
  model.normal_load = NormalLoad{NormalLoadLaw::constant, {load_n}, {}};
  return with_law(model, id, values);
}

struct Motion {
  std::function<double(double)> x;
  std::function<double(double)> v;
};

Input at(const Motion& motion, double t) {
  Input input;
  input.displacement_m = motion.x(t);
  input.velocity_m_s = motion.v(t);
  return input;
}

// The friction force after each of `count` steps of `h` seconds.
std::vector<double> forces(const Model& model, const Motion& motion, double h, int count) {
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  RigState<double> state;
  rig.complete(state, at(motion, 0.0), 0.0, n);
  std::vector<double> out;
  for (int i = 0; i < count; ++i) {
    const double t = h * i;
    rig.step(state, at(motion, t), at(motion, t + h), t, h, n);
    out.push_back(state.friction);
  }
  return out;
}

Motion steady(double speed) {
  return {[speed](double t) { return speed * t; }, [speed](double) { return speed; }};
}

Motion sine(double amplitude, double hz) {
  const double w = 2.0 * std::numbers::pi * hz;
  return {[=](double t) { return amplitude * std::sin(w * t); },
          [=](double t) { return amplitude * w * std::cos(w * t); }};
}

// Energy that friction takes in one cycle, the last of `forces`.
double energy_per_cycle(const std::vector<double>& force, const Motion& motion, double h,
                        int steps_per_cycle) {
  double energy = 0.0;
  const int count = static_cast<int>(force.size());
  for (int i = count - steps_per_cycle; i < count; ++i) {
    const double mean =
        0.5 * (force[static_cast<std::size_t>(i)] + force[static_cast<std::size_t>(i - 1)]);
    energy += mean * (motion.x(h * (i + 1)) - motion.x(h * i));
  }
  return energy;
}

TEST(FrictionLaws, EachIsDescribedAndFitsAModelWithoutFriction) {
  for (const Effect* law : friction_laws()) {
    const Card& card = law->card();
    EXPECT_TRUE(card.law);
    EXPECT_EQ(find_law(card.id), law);
    EXPECT_FALSE(card.references.empty()) << card.id;
    EXPECT_EQ(card.sentence.back(), '.') << card.id;
    EXPECT_EQ(card.parameters.front().name, "mu") << card.id;
    ASSERT_EQ(card.example.size(), card.parameters.size()) << card.id;
    std::map<std::string, Parameter> values;
    for (std::size_t i = 0; i < card.example.size(); ++i) {
      EXPECT_GE(card.example[i], card.parameters[i].low) << card.id;
      EXPECT_LE(card.example[i], card.parameters[i].high) << card.id;
      values[std::string(card.parameters[i].name)] = {card.example[i]};
    }
    for (const std::string_view id : card.includes) EXPECT_NE(find_effect(id), nullptr) << id;
    const Model model = with_law(test::bench(), std::string(card.id), values);
    EXPECT_TRUE(inconsistencies_of(model).empty()) << card.id;
    EXPECT_EQ(friction_coefficient(model).value, card.example[0]) << card.id;
    EXPECT_TRUE(Rig(model).structure().friction) << card.id;
    Scales scales;
    scales.displacement_m = 0.02;
    scales.velocity_m_s = 0.2;
    for (const auto& start : law->starts(scales)) {
      ASSERT_EQ(start.size(), card.parameters.size()) << card.id;
      for (std::size_t i = 0; i < start.size(); ++i) {
        EXPECT_TRUE(!card.parameters[i].positive || start[i] > 0.0) << card.id;
      }
    }
  }
}

TEST(FrictionLaws, AreNoCandidatesAndShutOutTheEffectsThatTheyContain) {
  for (const Effect* effect : catalogue()) EXPECT_FALSE(effect->card().law) << effect->card().id;
  const Model lugre = with_law(test::bench(), "lugre",
                               {{"mu", {0.6}},
                                {"mu_static", {0.8}},
                                {"stribeck_speed_m_s", {0.05}},
                                {"stiffness_n_m", {60.0}}});
  for (const char* id : {"stribeck", "contact_compliance", "friction_memory", "dry_friction"}) {
    EXPECT_FALSE(can_be_missing(*find_effect(id), lugre)) << id;
  }
  EXPECT_TRUE(can_be_missing(*find_effect("asymmetric_friction"), lugre));
  Model twice = lugre;
  Term term;
  term.id = "stribeck";
  term.parameters = {{"static_ratio", {1.2}}, {"stribeck_speed_m_s", {0.05}}};
  twice.terms.push_back(term);
  EXPECT_FALSE(inconsistencies_of(twice).empty());
}

TEST(FrictionLaws, ParametersArePartOfTheFrictionTable) {
  Model model = imposed("dahl", {{"mu", {0.5}}, {"stiffness_n_m", {1000.0, 50.0}}});
  const auto named = parameters_of(model);
  const auto found = std::find_if(named.begin(), named.end(), [](const NamedParameter& each) {
    return each.path == "friction.stiffness_n_m";
  });
  ASSERT_NE(found, named.end());
  EXPECT_EQ(found->parameter->sigma, 50.0);
  EXPECT_EQ(unit_of("friction.stiffness_n_m", model), "N/m");
  EXPECT_EQ(relation_of("friction.stiffness_n_m", model), Relation::friction_law);
}

TEST(FrictionLaws, CoulombAndStateVariableAreThoseOfTheModelItself) {
  const Model model = imposed(
      "state_variable", {{"mu", {0.5}}, {"transition_speed_m_s", {0.001}}, {"rate_per_s", {50.0}}});
  EXPECT_TRUE(model.terms.empty());
  EXPECT_EQ(model.friction.law, FrictionLaw::state_variable);
  EXPECT_EQ(model.friction.rate_per_s.value, 50.0);
}

// On trial in a diagnosis a law is a term like any other: the equations are the same.
TEST(FrictionLaws, ATermOnTrialIsTheLawItself) {
  const Motion motion = sine(1.0e-3, 2.0);
  for (const char* id : {"coulomb", "state_variable"}) {
    const std::map<std::string, Parameter> values =
        std::string(id) == "coulomb"
            ? std::map<std::string, Parameter>{{"mu", {0.5}}, {"transition_speed_m_s", {0.001}}}
            : std::map<std::string, Parameter>{
                  {"mu", {0.5}}, {"transition_speed_m_s", {0.001}}, {"rate_per_s", {50.0}}};
    Model trial = imposed("coulomb", {{"mu", {0.5}}, {"transition_speed_m_s", {0.001}}});
    trial.friction = {};
    Term term;
    term.id = id;
    term.law = true;
    term.parameters = values;
    trial.terms = {term};
    const auto one = forces(imposed(id, values), motion, 1.0e-4, 2000);
    const auto other = forces(trial, motion, 1.0e-4, 2000);
    EXPECT_EQ(one, other) << id;
  }
}

// Dahl 1968, Eq. for sliding in one direction from rest: F = Fc (1 - exp(-sigma0 x / Fc)).
// A coulomb contact with a bristle of 200 N/m that breaks away after 1 mm.
Model bristle(double elastic_share) {
  Model model;
  model.oscillator.excitation = Excitation::imposed;
  model.normal_load = NormalLoad{NormalLoadLaw::constant, {load_n}, {}};
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {0.1};
  model.terms.push_back({"contact_compliance",
                         {},
                         {{"contact_stiffness_n_m", {200.0}}, {"elastic_share", {elastic_share}}}});
  return model;
}

// Force of Dupont's bristle [N], which slips from `from` times its break-away deflection on, by the
// midpoint rule.
std::vector<double> published_bristle(const Motion& motion, double from, double h, int count) {
  const auto rate = [&](double z, double v) {
    const double ratio = (v < 0.0 ? -z : z) / 1.0e-3;
    const double middle = (ratio - 0.5 * (1.0 + from)) / (1.0 - from);
    const double plastic = 0.5 + 0.5 * std::sin(std::numbers::pi * std::clamp(middle, -0.5, 0.5));
    return v * (1.0 - plastic * ratio);
  };
  constexpr int parts = 20;
  std::vector<double> out;
  double z = 0.0;
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < parts; ++k) {
      const double part = h / parts;
      const double t = h * i + part * k;
      const double half = z + 0.5 * part * rate(z, motion.v(t));
      z += part * rate(half, motion.v(t + 0.5 * part));
    }
    out.push_back(200.0 * z);
  }
  return out;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double out = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, std::abs(a[i] - b[i]));
  return out;
}

TEST(ContactCompliance, SlipsFromTheDeflectionOfItsElasticShare) {
  const Motion motion = sine(0.003, 1.0);
  for (const double from : {-2.0, 0.0, 0.5}) {
    const double elastic_share = 1.0 / (2.0 - from);
    EXPECT_LT(largest_difference(forces(bristle(elastic_share), motion, 1.0e-4, 15000),
                                 published_bristle(motion, from, 1.0e-4, 15000)),
              1.0e-3)
        << from;
  }
}

// A fit has to find its way from one kind of contact to another.
TEST(ContactCompliance, ChangesGraduallyFromDahlsBristleOn) {
  const Motion motion = sine(0.003, 1.0);
  const std::vector<double> dahl = forces(bristle(0.0), motion, 1.0e-3, 1500);
  EXPECT_LT(largest_difference(forces(bristle(0.01), motion, 1.0e-3, 1500), dahl), 1.0e-4);
  EXPECT_GT(largest_difference(forces(bristle(0.3), motion, 1.0e-3, 1500), dahl), 5.0e-3);
}

TEST(FrictionLaws, DahlApproachesItsLevelExponentially) {
  const double stiffness = 1.0e4;
  const double level = 0.5 * load_n;
  const Model model = imposed("dahl", {{"mu", {0.5}}, {"stiffness_n_m", {stiffness}}});
  const double speed = 1.0e-3;
  const double h = 1.0e-4;
  const auto force = forces(model, steady(speed), h, 5000);
  for (std::size_t i = 99; i < force.size(); i += 100) {
    const double x = speed * h * static_cast<double>(i + 1);
    EXPECT_NEAR(force[i], level * (1.0 - std::exp(-stiffness * x / level)), 2.0e-5 * level);
  }
}

std::map<std::string, Parameter> lugre_values() {
  return {{"mu", {0.5}},
          {"mu_static", {0.75}},
          {"stribeck_speed_m_s", {0.001}},
          {"stiffness_n_m", {1e5}},
          {"damping_n_s_m", {300.0}},
          {"viscosity_n_s_m", {0.4}}};
}

// Canudas de Wit et al. 1995, Eq. (5): the steady force of the LuGre law, and likewise of the
// Stribeck and Maxwell-slip laws, which settle on the same curve.
TEST(FrictionLaws, SteadyForcesFollowTheStribeckCurve) {
  const auto curve = [](double v) {
    return load_n * (0.5 + 0.25 * std::exp(-std::pow(v / 0.001, 2))) + 0.4 * v;
  };
  const Model lugre = imposed("lugre", lugre_values());
  const Model stribeck = imposed("stribeck", {{"mu", {0.5}},
                                              {"mu_static", {0.75}},
                                              {"stribeck_speed_m_s", {0.001}},
                                              {"viscosity_n_s_m", {0.4}},
                                              {"transition_speed_m_s", {0.0}}});
  const Model gms = imposed("gms", {{"mu", {0.5}},
                                    {"mu_static", {0.75}},
                                    {"stribeck_speed_m_s", {0.001}},
                                    {"stiffness_n_m", {1e5}},
                                    {"yield_spread", {0.5}},
                                    {"attraction_per_s", {100.0}},
                                    {"viscosity_n_s_m", {0.4}}});
  for (const double v : {2.0e-4, 7.0e-4, 1.5e-3, 5.0e-3, 0.1}) {
    for (const Model* model : {&lugre, &stribeck, &gms}) {
      EXPECT_NEAR(forces(*model, steady(v), 1.0e-4, 20000).back(), curve(v), 1.0e-6) << v;
      EXPECT_NEAR(forces(*model, steady(-v), 1.0e-4, 20000).back(), -curve(v), 1.0e-6) << v;
    }
  }
}

// A mass that is drawn by a force growing at `rate`: the friction at which it breaks away.
double break_away_force(const Model& contact, double rate_n_s) {
  Model model = contact;
  model.oscillator = {};
  model.oscillator.excitation = Excitation::force;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = Parameter{0.0};
  model.oscillator.damping_n_s_m = Parameter{0.0};
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  RigState<double> state;
  const double h = 2.0e-5;
  Input begin;
  double most = 0.0;
  for (int i = 0; state.s[state::x] < 1.0e-4; ++i) {
    Input end;
    end.drive_force_n = rate_n_s * h * (i + 1);
    rig.step(state, begin, end, h * i, h, n);
    begin = end;
    most = std::max(most, state.friction);
  }
  return most;
}

// Fourth-order Runge-Kutta on the published equations, with steps that resolve the bristles.
double break_away_of_published_lugre(double rate_n_s) {
  const double s0 = 1.0e5, s1 = 300.0, s2 = 0.4, mass = 1.0;
  struct State {
    double x, v, z;
  };
  const auto friction = [&](const State& s, double& dz) {
    const double g = load_n * (0.5 + 0.25 * std::exp(-std::pow(s.v / 0.001, 2)));
    dz = s.v - s0 * std::abs(s.v) / g * s.z;
    return s0 * s.z + s1 * dz + s2 * s.v;
  };
  const auto rate = [&](const State& s, double t) {
    double dz = 0.0;
    const double f = friction(s, dz);
    return State{s.v, (rate_n_s * t - f) / mass, dz};
  };
  const auto moved = [](const State& s, const State& d, double h) {
    return State{s.x + h * d.x, s.v + h * d.v, s.z + h * d.z};
  };
  State s{0.0, 0.0, 0.0};
  const double h = 1.0e-5;
  double most = 0.0;
  for (double t = 0.0; s.x < 1.0e-4; t += h) {
    const State a = rate(s, t);
    const State b = rate(moved(s, a, 0.5 * h), t + 0.5 * h);
    const State c = rate(moved(s, b, 0.5 * h), t + 0.5 * h);
    const State d = rate(moved(s, c, h), t + h);
    s = moved(s,
              {a.x + 2.0 * (b.x + c.x) + d.x, a.v + 2.0 * (b.v + c.v) + d.v,
               a.z + 2.0 * (b.z + c.z) + d.z},
              h / 6.0);
    double dz = 0.0;
    most = std::max(most, friction(s, dz));
  }
  return most;
}

// Canudas de Wit et al. 1995, Fig. 4: the break-away force falls with the rate of loading.
TEST(FrictionLaws, LuGreBreaksAwayAtLessTheFasterItIsLoaded) {
  const Model model = imposed("lugre", lugre_values());
  double former = load_n;
  for (const double rate : {1.0, 5.0, 20.0}) {
    const double force = break_away_force(model, rate);
    EXPECT_NEAR(force, break_away_of_published_lugre(rate), 2.0e-3) << rate;
    EXPECT_LT(force, former - 0.005) << rate;
    former = force;
  }
  EXPECT_GT(former, 0.5 * load_n);
}

// Below break-away the mass returns: a spring, not a slide.
TEST(FrictionLaws, LuGreIsASpringBeforeItSlips) {
  const Model model = imposed("lugre", lugre_values());
  const auto force = forces(model, sine(2.0e-7, 1.0), 1.0e-4, 10000);
  EXPECT_NEAR(*std::max_element(force.begin(), force.end()), 1.0e5 * 2.0e-7, 0.04 * 0.02);
}

// With n = 2 and an unloading along a straight line, the loop integrates to a hyperbolic tangent.
TEST(FrictionLaws, BoucWenFollowsItsClosedForms) {
  const double stiffness = 1.0e4;
  const double level = 0.5 * load_n;
  const double speed = 1.0e-3;
  const double h = 1.0e-4;
  const Model square = imposed(
      "bouc_wen",
      {{"mu", {0.5}}, {"stiffness_n_m", {stiffness}}, {"loop_shape", {0.5}}, {"sharpness", {2.0}}});
  const auto force = forces(square, steady(speed), h, 4000);
  for (std::size_t i = 99; i < force.size(); i += 100) {
    const double x = speed * h * static_cast<double>(i + 1);
    EXPECT_NEAR(force[i], level * std::tanh(stiffness * x / level), 1.0e-4 * level);
  }
  // n = 1 and loop_shape = 1: Dahl's law.
  const Model one = imposed(
      "bouc_wen",
      {{"mu", {0.5}}, {"stiffness_n_m", {stiffness}}, {"loop_shape", {1.0}}, {"sharpness", {1.0}}});
  const Model dahl = imposed("dahl", {{"mu", {0.5}}, {"stiffness_n_m", {stiffness}}});
  const Motion motion = sine(3.0e-4, 1.0);
  const auto a = forces(one, motion, h, 20000);
  const auto b = forces(dahl, motion, h, 20000);
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1.0e-9 * level) << i;
}

// n = 1, unloading along a straight line: theta' = rho v (1 - theta) loads, theta' = rho v unloads.
// A loop of amplitude A between the forces -F and F takes an energy that follows by quadrature.
TEST(FrictionLaws, BoucWenTakesTheEnergyOfItsLoop) {
  const double stiffness = 1.0e4;
  const double level = 0.5 * load_n;
  const Model model = imposed(
      "bouc_wen",
      {{"mu", {0.5}}, {"stiffness_n_m", {stiffness}}, {"loop_shape", {0.5}}, {"sharpness", {1.0}}});
  const double amplitude = 3.0e-4;
  // From -theta: straight to 0 over theta / rho, then 1 - exp(-rho s) over the rest of 2 A.
  const double rho = stiffness / level;
  double theta = 0.5;
  for (int i = 0; i < 200; ++i) theta = 1.0 - std::exp(-(2.0 * amplitude * rho - theta));
  const double rest = 2.0 * amplitude - theta / rho;
  const double half =
      level * (-0.5 * theta * theta / rho + rest - (1.0 - std::exp(-rho * rest)) / rho);
  const Motion motion = sine(amplitude, 1.0);
  const double h = 1.0e-4;
  const auto force = forces(model, motion, h, 40000);
  EXPECT_NEAR(energy_per_cycle(force, motion, h, 10000), 2.0 * half, 2.0e-3 * half);
}

// Iwan 1966: the first loading is the sum of the elements, each other branch is the first loading
// twice as large (Masing's rule).
TEST(FrictionLaws, IwanIsASumOfJenkinsElementsAndFollowsMasing) {
  const double stiffness = 1.0e4;
  const double level = 0.5 * load_n;
  const double spread = 0.8;
  const Model model =
      imposed("iwan", {{"mu", {0.5}}, {"stiffness_n_m", {stiffness}}, {"yield_spread", {spread}}});
  const auto backbone = [&](double x) {
    double sum = 0.0;
    for (int i = 1; i <= 4; ++i) {
      sum += std::min(0.25 * stiffness * x, 0.25 * level * (1.0 + spread * (2.0 * i - 5.0) / 4.0));
    }
    return sum;
  };
  const Motion motion = sine(1.3e-4, 1.0);
  const double h = 1.0e-4;
  const auto force = forces(model, motion, h, 12500);
  const double turn = backbone(1.3e-4);
  for (std::size_t i = 0; i < force.size(); i += 50) {
    const double t = h * static_cast<double>(i + 1);
    const double x = motion.x(t);
    double expected = 0.0;
    if (t <= 0.25) {
      expected = backbone(x);
    } else if (t <= 0.75) {
      expected = turn - 2.0 * backbone(0.5 * (1.3e-4 - x));
    } else {
      expected = -turn + 2.0 * backbone(0.5 * (x + 1.3e-4));
    }
    EXPECT_NEAR(force[i], expected, 1.0e-4 * level) << t;
  }
}

// With a level that does not depend on the speed the Maxwell-slip law is Iwan's.
TEST(FrictionLaws, MaxwellSlipIsIwanWithoutAStribeckEffect) {
  const Model gms = imposed("gms", {{"mu", {0.5}},
                                    {"mu_static", {0.5}},
                                    {"stribeck_speed_m_s", {0.001}},
                                    {"stiffness_n_m", {1.0e4}},
                                    {"yield_spread", {0.6}},
                                    {"attraction_per_s", {50.0}}});
  const Model iwan =
      imposed("iwan", {{"mu", {0.5}}, {"stiffness_n_m", {1.0e4}}, {"yield_spread", {0.6}}});
  const Motion motion = sine(2.0e-4, 1.0);
  const auto a = forces(gms, motion, 1.0e-4, 15000);
  const auto b = forces(iwan, motion, 1.0e-4, 15000);
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1.0e-9) << i;
}

// Al-Bender et al. 2005: in slip the force lags behind the Stribeck curve. Against a fine
// integration of their slip equation, F' = C (1 - F / s(v)), in sliding of one direction.
TEST(FrictionLaws, MaxwellSlipLagsAsPublishedInSlip) {
  const double attraction = 20.0;
  const Model model = imposed("gms", {{"mu", {0.5}},
                                      {"mu_static", {0.75}},
                                      {"stribeck_speed_m_s", {0.01}},
                                      {"stiffness_n_m", {1.0e6}},
                                      {"yield_spread", {0.5}},
                                      {"attraction_per_s", {attraction}}});
  const double w = 2.0 * std::numbers::pi;
  const Motion motion{[=](double t) { return 0.012 * t - 0.010 / w * std::sin(w * t); },
                      [=](double t) { return 0.012 - 0.010 * std::cos(w * t); }};
  const double h = 1.0e-4;
  const auto force = forces(model, motion, h, 30000);
  const double limited = attraction / (1.0 + attraction / 1000.0);
  double level = 1.0;
  double largest_lag = 0.0;
  const int finer = 20;
  for (int i = 0; i < 30000 * finer; ++i) {
    const double v = motion.v(h / finer * (i + 0.5));
    const double s = 1.0 + 0.5 * std::exp(-std::pow(v / 0.01, 2));
    level += h / finer * limited * (1.0 - level / s);
    if ((i + 1) % finer != 0 || i < 10000 * finer) continue;
    const double f = force[static_cast<std::size_t>((i + 1) / finer - 1)];
    ASSERT_NEAR(f, 0.5 * load_n * level, 2.0e-3) << i;
    largest_lag = std::max(largest_lag, std::abs(level - s));
  }
  EXPECT_GT(largest_lag, 0.05);
}

// Dieterich 1979, Ruina 1983: a step of the slip speed from v1 to v2 changes the coefficient by
// a ln(v2/v1) at once, then by -b ln(v2/v1) over slip of about Dc.
TEST(FrictionLaws, RateAndStateRespondsToAStepOfTheSpeed) {
  const double a = 0.01, b = 0.015, dc = 1.0e-4, v0 = 1.0e-3, mu = 0.6;
  const Model model = imposed("rate_and_state", {{"mu", {mu}},
                                                 {"direct_effect", {a}},
                                                 {"evolution_effect", {b}},
                                                 {"slip_length_m", {dc}},
                                                 {"reference_speed_m_s", {v0}}});
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  RigState<double> state;
  const double h = 1.0e-4;
  double x = 0.0;
  const auto slide = [&](double speed, double slip) {
    Input begin, end;
    for (double gone = 0.0; gone < slip; gone += speed * h) {
      begin.displacement_m = x;
      begin.velocity_m_s = end.velocity_m_s = speed;
      x += speed * h;
      end.displacement_m = x;
      rig.step(state, begin, end, 0.0, h, n);
    }
    return state.friction / load_n;
  };
  const double v1 = 1.0e-3, v2 = 1.0e-2;
  const double steady_before = slide(v1, 20.0 * dc);
  EXPECT_NEAR(steady_before, mu, 1.0e-5);  // by definition at the reference speed
  const double peak = slide(v2, 1.0e-3 * dc);
  EXPECT_NEAR(peak - steady_before, a * std::log(v2 / v1), 0.02 * b);
  // After slip s the age has gone from Dc/v1 to Dc/v2 (1 + (v2/v1 - 1) exp(-s/Dc)).
  const double gone = v2 * h;
  slide(v2, dc);
  const double slipped = gone + std::ceil(dc / (v2 * h)) * v2 * h;
  const double age = 1.0 + (v2 / v1 - 1.0) * std::exp(-slipped / dc);
  EXPECT_NEAR(state.friction / load_n, mu + a * std::log(v2 / v0) + b * std::log(age * v0 / v2),
              0.03 * b);
  const double steady_after = slide(v2, 30.0 * dc);
  EXPECT_NEAR(steady_after - steady_before, (a - b) * std::log(v2 / v1), 1.0e-5);
}

// At rest contacts age: after a hold of t the static level has grown by b ln(t).
TEST(FrictionLaws, RateAndStateStrengthensAtRest) {
  const double b = 0.02, dc = 1.0e-5, v0 = 1.0e-3;
  const Model model = imposed("rate_and_state", {{"mu", {0.6}},
                                                 {"direct_effect", {0.01}},
                                                 {"evolution_effect", {b}},
                                                 {"slip_length_m", {dc}},
                                                 {"reference_speed_m_s", {v0}}});
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  const auto age_after = [&](double hold_s) {
    RigState<double> state;
    const double h = 1.0e-3;
    for (double t = 0.0; t < hold_s; t += h) rig.step(state, {}, {}, t, h, n);
    return state.s[state::contact];
  };
  EXPECT_NEAR(age_after(10.0) - age_after(1.0), std::log(10.0), 0.02);
}

// Derivatives with respect to parameters are those of the integration itself.
TEST(FrictionLaws, DerivativesAgreeWithDifferences) {
  for (const Effect* law : friction_laws()) {
    const Card& card = law->card();
    std::map<std::string, Parameter> values;
    for (std::size_t i = 0; i < card.parameters.size(); ++i) {
      values[std::string(card.parameters[i].name)] = {card.example[i]};
    }
    const Model model = with_law(test::rigid_bench(), std::string(card.id), values);
    const Rig rig(model);
    const std::vector<double> base = rig.parameter_values();
    const auto run = [&]<class T>(const std::vector<T>& parameters) {
      const auto n = rig.numbers<T>(std::span<const T>(parameters));
      RigState<T> state;
      state.s[state::v] = T(0.05);
      const double h = 5.0e-4;
      Input begin, end;
      for (int i = 0; i < 300; ++i) {
        const double t = h * i;
        begin.base_acceleration_m_s2 = 4.0 * std::sin(15.0 * t);
        end.base_acceleration_m_s2 = 4.0 * std::sin(15.0 * (t + h));
        rig.step(state, begin, end, t, h, n);
      }
      return state.s[state::x];
    };
    for (std::size_t p = 0; p < base.size(); ++p) {
      if (!rig.parameter_paths()[p].starts_with("friction.") || base[p] == 0.0) continue;
      std::vector<Dual> seeded(base.begin(), base.end());
      seeded[p].d[0] = static_cast<Dual::Slope>(base[p]);  // relative
      const Dual exact = run(seeded);
      const double by = 1.0e-5;
      std::vector<double> up = base, down = base;
      up[p] *= 1.0 + by;
      down[p] *= 1.0 - by;
      const double difference = (run(up) - run(down)) / (2.0 * by);
      EXPECT_NEAR(static_cast<double>(exact.d[0]), difference,
                  2.0e-3 * std::abs(difference) + 1.0e-6)
          << card.id << ' ' << rig.parameter_paths()[p];
    }
  }
}

}  // namespace
}  // namespace stickslip::physics
