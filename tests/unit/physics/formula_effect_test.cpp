// SPDX-License-Identifier: Apache-2.0
#include "physics/formula_effect.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "physics/catalogue.h"
#include "physics/model_consistency.h"
#include "physics/rig.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

using test::bench;
using test::rigid_bench;

using Values = std::map<std::string, Parameter>;

FormulaDeclaration declared(FormulaQuantity quantity, const std::string& text,
                            const Values& values) {
  FormulaDeclaration out{.id = "mine",
                         .quantity = quantity,
                         .channel = {},
                         .text = text,
                         .parameters = {},
                         .states = {}};
  for (const auto& [name, value] : values) out.parameters.push_back({name, ""});
  return out;
}

Term term_of(const FormulaDeclaration& declaration, const Values& values,
             const FormulaSurroundings& around = {.dimensionless = false, .loaded = true}) {
  Term term;
  term.id = declaration.id;
  term.channel = declaration.channel;
  term.parameters = values;
  term.formula = FormulaEffect::make(declaration, values, around);
  return term;
}

Term formula_term(FormulaQuantity quantity, const std::string& text, const Values& values) {
  return term_of(declared(quantity, text, values), values);
}

Model with(Model model, Term term) {
  model.terms.push_back(std::move(term));
  return model;
}

// Two seconds of a shaken base: everything that a rig computes at the end.
std::vector<double> run(const Model& model, double seconds = 2.0) {
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  const auto input_at = [](double t) {
    const double w = 2.0 * std::numbers::pi * 2.5;
    Input input;
    input.base_displacement_m = 0.006 * std::sin(w * t);
    input.base_acceleration_m_s2 = -w * w * input.base_displacement_m;
    return input;
  };
  RigState<double> state;
  rig.complete(state, input_at(0.0), 0.0, n);
  constexpr double h = 2.5e-4;
  const int steps = static_cast<int>(std::lround(seconds / h));
  for (int k = 0; k < steps; ++k) {
    rig.step(state, input_at(h * k), input_at(h * (k + 1)), h * k, h, n);
  }
  std::vector<double> out(state.s.begin(), state.s.end());
  out.push_back(state.friction);
  out.push_back(state.load);
  return out;
}

void expect_alike(const std::vector<double>& a, const std::vector<double>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a[i], b[i], 1.0e-12 * std::max(1.0, std::abs(b[i]))) << i;
  }
}

TEST(FormulaEffect, MovesTheRigAsTheEffectOfTheSameEquation) {
  expect_alike(
      run(with(rigid_bench(), formula_term(FormulaQuantity::force, "c*v*abs(v)", {{"c", {0.3}}}))),
      run(with(rigid_bench(), {"quadratic_drag", {}, {{"drag_n_s2_m2", {0.3}}}})));
  expect_alike(run(with(bench(), formula_term(FormulaQuantity::force, "k*x^3", {{"k", {7.0e3}}}))),
               run(with(bench(), {"cubic_stiffness", {}, {{"k3_n_m3", {7.0e3}}}})));
  expect_alike(
      run(with(bench(),
               formula_term(FormulaQuantity::friction, "mu*(1 + (q - 1)*exp(-(abs(w)/vs)))",
                            {{"vs", {0.02}}, {"q", {1.3}}}))),
      run(with(bench(), formula_term(FormulaQuantity::friction, "mu + mu*(q - 1)*exp(-abs(w)/vs)",
                                     {{"vs", {0.02}}, {"q", {1.3}}}))));
}

TEST(FormulaEffect, ChangesFrictionLoadAndReading) {
  const auto plain = run(rigid_bench());
  // The same coefficient and the same load change nothing.
  expect_alike(run(with(rigid_bench(), formula_term(FormulaQuantity::friction, "mu", {}))), plain);
  expect_alike(run(with(rigid_bench(), formula_term(FormulaQuantity::load, "N", {}))), plain);
  // Twice the load is twice the coefficient.
  const auto loaded = run(with(rigid_bench(), formula_term(FormulaQuantity::load, "2*N", {})));
  const auto rough = run(with(rigid_bench(), formula_term(FormulaQuantity::friction, "2*mu", {})));
  EXPECT_NEAR(loaded[state::x], rough[state::x], 1.0e-12);
  EXPECT_NE(loaded[state::x], plain[state::x]);

  FormulaDeclaration reading = declared(FormulaQuantity::reading, "r + a*r^2", {{"a", {2.0}}});
  reading.channel = Channel::velocity;
  const Model model = with(rigid_bench(), term_of(reading, {{"a", {2.0}}}));
  const Rig rig(model);
  const auto laws = rig.numbers<double>(rig.parameter_values()).reading;
  double value = 0.5;
  const ReadingLaw<double>& law = laws.of[index_of(Channel::velocity)];
  ASSERT_NE(law.characteristic, nullptr);
  law.characteristic->distort(value, law.characteristic_parameters.data());
  EXPECT_DOUBLE_EQ(value, 1.0);
  EXPECT_EQ(path_of(model.terms.front()), "physics.mine.velocity");
}

// A Dahl spring: z' = v - abs(v) z / x0 has the solution x0 (1 - exp(-x / x0)) in steady motion.
TEST(FormulaEffect, HasStatesOfItsOwn) {
  FormulaDeclaration spring =
      declared(FormulaQuantity::force, "k*z", {{"k", {40.0}}, {"x0", {2.0e-3}}});
  spring.states.push_back({.name = "z", .rate = "v - abs(v)*z/x0", .within = "x0"});
  const Model model = with(rigid_bench(), term_of(spring, {{"k", {40.0}}, {"x0", {2.0e-3}}}));
  const Effect& effect = *effect_of(model.terms.front());
  ASSERT_EQ(effect.state_count(), 1);
  OperatingPoint<double> at;
  at.v = 0.05;
  double z = 0.0;
  const std::array<double, 2> p = {40.0, 2.0e-3};
  const double h = 1.0e-6;
  for (int k = 0; k < 40000; ++k) {
    double rate = 0.0;
    effect.rates(&rate, at, p.data(), &z);
    z += h * rate;
  }
  EXPECT_NEAR(z, 2.0e-3 * (1.0 - std::exp(-1.0)), 1.0e-7);
  EXPECT_NEAR(effect.force(at, p.data(), &z), 40.0 * z, 1.0e-15);
  z = -1.0;
  effect.confine(&z, p.data());
  EXPECT_EQ(z, -2.0e-3);
  for (const double each : run(model)) EXPECT_TRUE(std::isfinite(each));
}

TEST(FormulaEffect, IsKnownByTheParameterThatMeasuresIt) {
  const auto strength = [](const Term& term) { return effect_of(term)->card().strength; };
  EXPECT_EQ(strength(formula_term(FormulaQuantity::force, "c*v*exp(-(x/a)^2)",
                                  {{"a", {0.01}}, {"c", {0.1}}})),
            1U);
  EXPECT_EQ(strength(formula_term(FormulaQuantity::friction, "mu*(1 + s*x)", {{"s", {2.0}}})), 0U);
  EXPECT_EQ(strength(formula_term(FormulaQuantity::load, "N + c", {{"c", {2.0}}})), 0U);
  EXPECT_EQ(
      strength(formula_term(FormulaQuantity::force, "c*v + d*x", {{"c", {2.0}}, {"d", {1.0}}})),
      std::nullopt);
}

std::string rejection_of(FormulaDeclaration declaration,
                         const FormulaSurroundings& around = {.dimensionless = false,
                                                              .loaded = true}) {
  try {
    (void)FormulaEffect::make(std::move(declaration), {}, around);
  } catch (const FormulaRejection& rejection) {
    std::string text = rejection.key;
    if (rejection.offset) text.append("@").append(std::to_string(*rejection.offset));
    return text.append(": ").append(rejection.what());
  }
  return "accepted";
}

TEST(FormulaEffect, RefusesWhatHasNoMeaning) {
  using testing::StartsWith;
  const auto of = [](FormulaQuantity quantity, const std::string& text) {
    return rejection_of(declared(quantity, text, {}));
  };
  EXPECT_THAT(of(FormulaQuantity::force, "q*v"), StartsWith("force@0: unknown symbol q"));
  EXPECT_THAT(of(FormulaQuantity::force, "mu*v"), StartsWith("force@0: unknown symbol mu"));
  EXPECT_THAT(of(FormulaQuantity::friction, "mu*(1 + v)"), StartsWith("friction@8: friction dep"));
  EXPECT_THAT(of(FormulaQuantity::load, "N*(1 + w)"), StartsWith("load@7: the normal load is"));

  FormulaDeclaration taken = declared(FormulaQuantity::force, "v", {});
  taken.id = "stribeck";
  EXPECT_THAT(rejection_of(taken), StartsWith("id: \"stribeck\" is an effect of the catalogue"));
  FormulaDeclaration reserved = declared(FormulaQuantity::force, "v", {{"N", {1.0}}});
  EXPECT_THAT(rejection_of(reserved), StartsWith("parameters.N: N has a meaning of its own"));
  FormulaDeclaration reading = declared(FormulaQuantity::reading, "r + x", {});
  reading.channel = Channel::displacement;
  EXPECT_THAT(rejection_of(reading), StartsWith("reading.displacement@4: a reading depends"));
  FormulaDeclaration bound = declared(FormulaQuantity::force, "z", {});
  bound.states.push_back({.name = "z", .rate = "v", .within = "abs(x)"});
  EXPECT_THAT(rejection_of(bound), StartsWith("states.z.within@4: a bound depends on parameters"));
}

TEST(FormulaEffect, ChecksUnitsAsFarAsTheyAreGiven) {
  FormulaDeclaration drag = declared(FormulaQuantity::force, "c*v", {{"c", {1.0}}});
  EXPECT_EQ(rejection_of(drag), "accepted") << "none given";
  drag.parameters[0].unit = "N s/m";
  EXPECT_EQ(rejection_of(drag), "accepted");
  drag.parameters[0].unit = "N/m";
  EXPECT_EQ(rejection_of(drag), "force@0: has the unit N/s, expected N");
  EXPECT_EQ(rejection_of(drag, {.dimensionless = true}), "accepted");
  drag.parameters[0].unit = "N/mm";
  EXPECT_THAT(rejection_of(drag), testing::StartsWith("parameters.c.unit: expected SI units"));

  FormulaDeclaration level = declared(FormulaQuantity::friction, "mu + c", {{"c", {1.0}}});
  level.parameters[0].unit = "N";
  EXPECT_EQ(rejection_of(level, {.dimensionless = false, .loaded = false}), "accepted");
  EXPECT_EQ(rejection_of(level, {}), "accepted") << "nothing is known of the model";
  EXPECT_THAT(rejection_of(level), testing::StartsWith("friction@3: combines the units 1 and N"));

  // The unit of a state follows from its rate.
  FormulaDeclaration spring = declared(FormulaQuantity::force, "k*z", {{"k", {1.0}}});
  spring.parameters[0].unit = "N/m^2";
  spring.states.push_back({.name = "z", .rate = "v"});
  EXPECT_EQ(rejection_of(spring), "force@0: has the unit N/m, expected N");
}

TEST(FormulaEffect, IsAnEffectToTheModelAroundIt) {
  Model model = rigid_bench();
  const Term drag = formula_term(FormulaQuantity::force, "c*v", {{"c", {1.0}}});
  const Effect& effect = *effect_of(drag);
  EXPECT_TRUE(can_be_missing(effect, model));
  model.terms.push_back(drag);
  EXPECT_FALSE(can_be_missing(effect, model)) << "it is there already";
  EXPECT_TRUE(inconsistencies_of(model).empty());
  Model imposed;
  imposed.oscillator.excitation = Excitation::imposed;
  EXPECT_FALSE(can_be_missing(effect, imposed));
  EXPECT_FALSE(inconsistencies_of(with(imposed, drag)).empty());
  Model bare = rigid_bench();
  bare.friction = {};
  EXPECT_FALSE(can_be_missing(*effect_of(formula_term(FormulaQuantity::friction, "mu", {})), bare));
  Model candidates = rigid_bench();
  candidates.candidates = {drag, drag};
  ASSERT_EQ(inconsistencies_of(candidates).size(), 1U);
  EXPECT_EQ(inconsistencies_of(candidates)[0].path, "candidate.mine");

  Model same = model;
  EXPECT_EQ(same, model);
  same.terms[0] = formula_term(FormulaQuantity::force, "c*v", {{"c", {1.0}}});
  EXPECT_EQ(same, model) << "declared alike";
  same.terms[0] = formula_term(FormulaQuantity::force, "c*v + 0", {{"c", {1.0}}});
  EXPECT_NE(same, model);
}

}  // namespace
}  // namespace stickslip::physics
