// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/headline.h"

#include <algorithm>
#include <array>
#include <vector>

#include "diagnosis/held_out.h"
#include "diagnosis/report/formatting.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::ResultUnits;

namespace {

constexpr double confident = 0.95;
/// Of the chi-squared per sample, below which the noise was taken for more than it is.
constexpr double far_below_1 = 0.7;
/// Of the probability of the finding, from which on another explanation is as good as it.
constexpr double rival_share = 0.5;

bool is_ambiguous(const Finding& finding) {
  return finding.probability < confident && !finding.alternatives.empty();
}

// The augmented model leaves more than noise.
bool is_partial(const Diagnosis& d) {
  return d.augmented &&
         d.augmented->chi2_per_sample > explained_chi2(d.noise_estimated.empty(), Criteria{});
}

}  // namespace

bool has_rival(const Finding& finding) {
  return is_ambiguous(finding) &&
         finding.alternatives.front().probability >= rival_share * finding.probability;
}

namespace {

const char* count_word(std::size_t count) {
  constexpr std::array<const char*, 7> words = {"no", "one", "two", "three", "four", "five", "six"};
  return count < words.size() ? words[count] : "several";
}

// Sensor errors are named apart from the physics of the rig.
std::string number_of_effects(const Diagnosis& d) {
  const bool instrument =
      std::all_of(d.findings.begin(), d.findings.end(), [](const Finding& finding) {
        const physics::Relation relation = finding.relation();
        return relation == physics::Relation::sensor || relation == physics::Relation::kinematics;
      });
  return std::string(count_word(d.findings.size())) + (instrument ? " instrument" : " physical") +
         (d.findings.size() == 1 ? " effect" : " effects");
}

std::string findings_text(const Diagnosis& d) {
  std::vector<std::string> names;
  for (const Finding& finding : d.findings) {
    names.push_back(has_rival(finding) ? explanations_text(finding) : effect_name(finding));
  }
  // "and" beside "or" would leave open what belongs together.
  if (!std::any_of(d.findings.begin(), d.findings.end(), has_rival)) return enumeration(names);
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : "; ") + name;
  return out;
}

// A number with its unit behind a space that does not break.
std::string amount(double value, std::string_view unit, const ResultUnits& units) {
  const bool bare = units.of(unit) == "1";
  return format_number(value) + (bare ? "" : "\u00a0" + std::string(unit));
}

std::string oscillator_text(const physics::Oscillator& oscillator, const ResultUnits& units) {
  if (oscillator.excitation == physics::Excitation::imposed) return "An imposed motion";
  std::string out = "A mass of " + amount(oscillator.mass_kg.value, "kg", units);
  if (oscillator.two_well) {
    out += " in a two-well potential";
  } else if (oscillator.natural_frequency_hz) {
    out += " on a spring (natural frequency " +
           amount(oscillator.natural_frequency_hz->value, "Hz", units) + ")";
  } else if (oscillator.stiffness_n_m && oscillator.stiffness_n_m->value > 0.0) {
    out += " on a spring of " + amount(oscillator.stiffness_n_m->value, "N/m", units);
  }
  return out + (oscillator.excitation == physics::Excitation::base ? ", excited through its base"
                                                                   : ", excited by a force");
}

std::string friction_text(const physics::Model& model) {
  const physics::Friction& friction = model.friction;
  const physics::Term* law = physics::law_term(model);
  if (physics::is_frictionless(model)) return ", without friction";
  const double mu = physics::friction_coefficient(model).value;
  std::string out = ", with ";
  out += model.normal_load ? "a coefficient of friction of " + format_number(mu)
                           : "a friction force of " + amount(mu, "N", ResultUnits(model));
  if (law != nullptr) {
    return out + " (" + std::string(physics::find_law(law->id)->card().name) + ")";
  }
  out += friction.law == physics::FrictionLaw::state_variable
             ? " (state-variable law, rate " +
                   amount(friction.rate_per_s.value, "1/s", ResultUnits(model)) + ")"
             : " (Coulomb's law)";
  return out;
}

std::string load_text(const physics::NormalLoad& load, const ResultUnits& units) {
  switch (load.law) {
    case physics::NormalLoadLaw::constant:
      return " under a constant normal load of " +
             format_quantity(load.load_n.value, units.of("N"));
    case physics::NormalLoadLaw::wedge:
      return " under a normal load of " + format_quantity(load.load_n.value, units.of("N")) +
             " that varies along the track";
    case physics::NormalLoadLaw::measured:
      return " under the recorded normal load";
  }
  return "";
}

}  // namespace

Answer answer_of(const Diagnosis& d) {
  if (d.verdict == Verdict::consistent) return Answer::consistent;
  if (d.verdict == Verdict::unexplained) return Answer::unexplained;
  if (is_partial(d)) return Answer::partial;
  return std::any_of(d.findings.begin(), d.findings.end(), is_ambiguous) ? Answer::ambiguous
                                                                         : Answer::named;
}

std::string explanations_text(const Finding& finding) {
  std::string out = with_probability(effect_name(finding), format_percent(finding.probability));
  if (!has_rival(finding)) return out;
  const Alternative& other = finding.alternatives.front();
  return out + " or " +
         with_probability(effect_name(other.candidate), format_percent(other.probability));
}

std::string fit_remark(const Diagnosis& d) {
  const double chi2 = d.augmented ? d.augmented->chi2_per_sample : d.baseline.chi2_per_sample;
  if (!(chi2 < far_below_1)) return "";
  return std::string(" Chi-squared is far below 1: the noise was ") +
         (d.noise_estimated.empty() ? "declared" : "estimated") + " too large.";
}

std::string headline_of(const Diagnosis& d) {
  const std::string names = findings_text(d);
  const bool several = d.integrity.size() > 1;
  const std::string recording = several ? "recordings" : "recording";
  switch (answer_of(d)) {
    case Answer::consistent:
      return "No missing physics found: the model explains the " + recording +
             " to within the noise." + plain_text(noise_level_text(d));
    case Answer::unexplained:
      return d.findings.empty()
                 ? "The model and the " + recording +
                       " disagree, and none of the candidate effects explains why."
                 : "The model and the " + recording +
                       " disagree, and the effects found explain only part of it: " + names + ".";
    case Answer::partial:
      return "The model lacks " + number_of_effects(d) + ": " + names +
             ". Most of the mismatch is explained, not all: chi-squared per sample " +
             format_number(d.baseline.chi2_per_sample) + " \u2192 " +
             format_number(d.augmented->chi2_per_sample) + " (1: noise only).";
    case Answer::ambiguous: {
      if (std::any_of(d.findings.begin(), d.findings.end(), has_rival)) {
        return "The model lacks " + number_of_effects(d) + ": " + names + ".";
      }
      const auto open = std::find_if(d.findings.begin(), d.findings.end(), is_ambiguous);
      return "The model lacks " + number_of_effects(d) + ", most likely " + names +
             (several ? "; these recordings alone do not" : "; this recording alone does not") +
             " rule out " + effect_name(open->alternatives.front().candidate) + ".";
    }
    case Answer::named:
      break;
  }
  return "The model lacks " + number_of_effects(d) + ": " + names + ".";
}

std::string noise_level_text(const Diagnosis& d) {
  std::string out;
  for (const auto& [channel, level] : d.noise_level) {
    const bool estimated = std::find(d.noise_estimated.begin(), d.noise_estimated.end(), channel) !=
                           d.noise_estimated.end();
    out += " The noise of " + std::string(info(channel).stem) + " is " +
           physics::number_text(level) + " times the " + (estimated ? "estimated" : "declared") +
           " one.";
  }
  return out;
}

std::string rig_description(const physics::Model& model) {
  std::string out = oscillator_text(model.oscillator, ResultUnits(model)) + friction_text(model);
  if (model.normal_load) out += load_text(*model.normal_load, ResultUnits(model));
  if (model.load_cell) {
    out += model.load_cell->dynamics == physics::LoadCellDynamics::resonant
               ? "; the friction force is measured by a load cell with a resonance"
               : "; the friction force is measured by a load cell that is assumed rigid";
  }
  return out + ".";
}

}  // namespace stickslip::report
