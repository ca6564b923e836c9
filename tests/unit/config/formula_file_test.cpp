// SPDX-License-Identifier: Apache-2.0
// Formulas in model files: read, written, and refused with line and column.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "config/document.h"
#include "config/model_file.h"
#include "physics/formula_effect.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const std::string rig = R"toml(schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
stiffness_n_m = 200.0
damping_ratio = 0.01
[friction]
law = "coulomb"
mu = 0.4
transition_speed_m_s = 0.001
)toml";  // ten lines

std::vector<std::string> problems_of(const std::string& text) {
  std::vector<std::string> lines;
  try {
    parse_model(rig + text, "m");
  } catch (const InputError& error) {
    for (const Problem& problem : error.problems()) lines.push_back(problem.text());
  }
  return lines;
}

const std::string drag = R"toml([[physics]]
id = "my_drag"
relation = "force_balance"
force = "c1*v + c3*v*abs(v)*exp(-(x/x0)^2)"
parameters = { c1 = { value = 0.1, sigma = 0.01, unit = "N s/m" }, c3 = { value = 2.0 }, x0 = 0.01 }
)toml";

TEST(FormulaFile, IsReadWithItsParameters) {
  const physics::Model model = parse_model(rig + drag, "m");
  ASSERT_EQ(model.terms.size(), 1U);
  const physics::Term& term = model.terms[0];
  EXPECT_EQ(term.id, "my_drag");
  ASSERT_TRUE(term.formula);
  EXPECT_EQ(term.formula->declaration().text, "c1*v + c3*v*abs(v)*exp(-(x/x0)^2)");
  EXPECT_EQ(term.parameters.at("c1"), (physics::Parameter{0.1, 0.01}));
  EXPECT_EQ(term.parameters.at("c3"), (physics::Parameter{2.0, 0.0}));
  EXPECT_EQ(term.parameters.at("x0"), (physics::Parameter{0.01, 0.0}));
}

TEST(FormulaFile, IsWrittenAsItWasRead) {
  const std::string all = rig + drag + R"toml([[physics]]
id = "grip"
friction = "mu*(1 + a*z)"
parameters = { a = { value = 1.0, unit = "1/m" }, d = { value = 0.001, unit = "m" } }
states = { z = { rate = "w - abs(w)*z/d", within = "d", unit = "m", size = 0.001 } }
[[physics]]
id = "bent"
reading.displacement = "r + q*r^2"
parameters = { q = 0.5 }
[[candidate]]
id = "guess"
force = """
k*x
  + k*x"""
parameters = { k = { value = 1.0, sigma = 3.0 } }
)toml";
  const physics::Model model = parse_model(all, "m");
  ASSERT_EQ(model.terms.size(), 3U);
  EXPECT_EQ(model.terms[2].channel, Channel::displacement);
  ASSERT_EQ(model.candidates.size(), 1U);
  const std::string text = model_text(model);
  EXPECT_EQ(parse_model(text, "written"), model) << text;
  EXPECT_THAT(text, HasSubstr("force = \"c1*v + c3*v*abs(v)*exp(-(x/x0)^2)\"\n"));
  EXPECT_THAT(text, HasSubstr("c1 = { value = 0.1, sigma = 0.01, unit = \"N s/m\" }"));

  // A candidate that was found is a term, and tried no more.
  physics::Model found = model;
  found.terms.push_back(found.candidates[0]);
  const physics::Model read = parse_model(model_text(found), "found");
  EXPECT_EQ(read.terms, found.terms);
  EXPECT_TRUE(read.candidates.empty());
}

TEST(FormulaFile, NamesLineAndColumnOfAFormulasError) {
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"2*q*v\"\n"),
              ElementsAre(HasSubstr("m:13:12: physics.a.force: unknown symbol q")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"\"\"2*\nq*v\"\"\"\n"),
              ElementsAre(HasSubstr("m:14:1: physics.a.force: unknown symbol q")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"\"\"\nv*\n q*v\"\"\"\n"),
              ElementsAre(HasSubstr("m:15:2: physics.a.force: unknown symbol q")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"\"\"v*q\"\"\"\n"),
              ElementsAre(HasSubstr("m:13:14: physics.a.force: unknown symbol q")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"z\"\n"
                          "states = { z = { rate = \"v - \" } }\n"),
              ElementsAre(HasSubstr("m:14:30: physics.a.states.z.rate: expected a number")));
  EXPECT_THAT(problems_of("[[candidate]]\nid = \"a\"\nload = \"N*(1 + w)\"\n"),
              ElementsAre(HasSubstr("m:13:16: candidate.a.load: the normal load is known")));
}

TEST(FormulaFile, ChecksUnitsAgainstTheModel) {
  const auto force_of = [](const std::string& unit) {
    return "[[physics]]\nid = \"a\"\nforce = \"c*v\"\nparameters = { c = { value = 1, unit = \"" +
           unit + "\" } }\n";
  };
  EXPECT_THAT(problems_of(force_of("N s/m")), ElementsAre());
  EXPECT_THAT(problems_of(force_of("N/m")),
              ElementsAre(HasSubstr("m:13:10: physics.a.force: has the unit N/s, expected N")));
  EXPECT_THAT(problems_of(force_of("lbf")),
              ElementsAre(HasSubstr("m:14:40: physics.a.parameters.c.unit: expected SI units")));
  // Without a normal load mu is in newtons.
  const std::string level =
      "[[physics]]\nid = \"a\"\nfriction = \"mu + c\"\n"
      "parameters = { c = { value = 1, unit = \"1\" } }\n";
  EXPECT_THAT(problems_of(level), ElementsAre(HasSubstr("combines the units N and 1")));
}

TEST(FormulaFile, RefusesKeysThatContradict) {
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"v\"\nload = \"N\"\n"),
              ElementsAre(HasSubstr("expected one formula, force, friction, load or "
                                    "reading.CHANNEL, found force, load")));
  EXPECT_THAT(problems_of("[[candidate]]\nid = \"a\"\n"),
              ElementsAre(HasSubstr("reading.CHANNEL, found none")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"v\"\nrelation = \"sensor\"\n"),
              ElementsAre(HasSubstr("m:14:12: physics.a.relation: expected \"force_balance\" with "
                                    "force, found \"sensor\"")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"v\"\ncolour = 1\n"),
              ElementsAre(HasSubstr("unknown key physics.a.colour")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nforce = \"v\"\nparameters = { c = \"x\" }\n"),
              ElementsAre(HasSubstr("physics.a.parameters.c: expected a number or {")));
  EXPECT_THAT(
      problems_of("[[physics]]\nid = \"a\"\nforce = \"v\"\nstates = { z = { raet = \"v\" } }\n"),
      ElementsAre(HasSubstr("physics.a.states.z: lacks its rate"),
                  HasSubstr("unknown key raet: expected rate, within, unit, size")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"cubic_stiffness\"\nforce = \"v\"\n"),
              ElementsAre(HasSubstr("is an effect of the catalogue")));
  EXPECT_THAT(problems_of("[[physics]]\nid = \"a\"\nload = \"2*N\"\n"),
              ElementsAre(HasSubstr("cannot be added to a model with these laws (load = 2*N)")));
}

TEST(FormulaFile, OfACandidateNeedsAParameter) {
  EXPECT_THAT(problems_of("[[candidate]]\nid = \"a\"\nforce = \"v\"\n"),
              ElementsAre(HasSubstr("m:11:1: candidate.a: needs a parameter")));
}

TEST(FormulaFile, OfCandidatesExtendsAModel) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / "stickslip_candidates.toml";
  const std::string text =
      "schema = 1\n[[candidate]]\nid = \"a\"\nfriction = \"mu + c\"\n"
      "parameters = { c = { value = 0.1, unit = \"1\" } }\n";
  std::ofstream(file) << text;
  EXPECT_EQ(kind_of(text), FileKind::candidates);
  physics::Model model = parse_model(rig, "m");
  add_candidates(file, model);
  ASSERT_EQ(model.candidates.size(), 1U);
  EXPECT_EQ(model.candidates[0].id, "a");
  EXPECT_THROW(add_candidates(file, model), InputError) << "the same id twice";
  EXPECT_EQ(model.candidates.size(), 1U);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace stickslip::config
