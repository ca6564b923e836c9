#include "diagnosis/report/headline.h"

#include <algorithm>
#include <array>
#include <vector>

#include "diagnosis/report/formatting.h"

namespace stickslip::report {

using namespace diagnosis;

namespace {

constexpr double confident = 0.95;

bool is_ambiguous(const Finding& finding) {
  return finding.probability < confident && !finding.alternatives.empty();
}

const char* count_word(std::size_t count) {
  constexpr std::array<const char*, 4> words = {"no", "one", "two", "three"};
  return count < words.size() ? words[count] : "several";
}

// Sensor errors are named apart from the physics of the rig.
std::string number_of_effects(const Diagnosis& d) {
  const bool instrument =
      std::all_of(d.findings.begin(), d.findings.end(), [](const Finding& finding) {
        const physics::Relation relation = finding.effect->card().relation;
        return relation == physics::Relation::sensor || relation == physics::Relation::kinematics;
      });
  return std::string(count_word(d.findings.size())) + (instrument ? " instrument" : " physical") +
         (d.findings.size() == 1 ? " effect" : " effects");
}

std::string findings_text(const Diagnosis& d) {
  std::vector<std::string> names;
  for (const Finding& finding : d.findings) {
    names.push_back(effect_name({finding.effect, finding.place}));
  }
  return enumeration(names);
}

std::string oscillator_text(const physics::Oscillator& oscillator) {
  if (oscillator.excitation == physics::Excitation::imposed) return "An imposed motion";
  std::string out = "A mass of " + format_number(oscillator.mass_kg.value) + "\u00a0kg";
  if (oscillator.two_well) {
    out += " in a two-well potential";
  } else if (oscillator.natural_frequency_hz) {
    out += " on a spring (natural frequency " +
           format_number(oscillator.natural_frequency_hz->value) + "\u00a0Hz)";
  } else if (oscillator.stiffness_n_m && oscillator.stiffness_n_m->value > 0.0) {
    out += " on a spring of " + format_number(oscillator.stiffness_n_m->value) + "\u00a0N/m";
  }
  return out + (oscillator.excitation == physics::Excitation::base ? ", excited through its base"
                                                                   : ", excited by a force");
}

std::string friction_text(const physics::Model& model) {
  const physics::Friction& friction = model.friction;
  if (friction.law == physics::FrictionLaw::none) return ", without friction";
  std::string out = ", with ";
  out += model.normal_load ? "a coefficient of friction of " + format_number(friction.mu.value)
                           : "a friction force of " + format_number(friction.mu.value) + "\u00a0N";
  out +=
      friction.law == physics::FrictionLaw::state_variable
          ? " (state-variable law, rate " + format_number(friction.rate_per_s.value) + "\u00a01/s)"
          : " (Coulomb's law)";
  return out;
}

std::string load_text(const physics::NormalLoad& load) {
  switch (load.law) {
    case physics::NormalLoadLaw::constant:
      return " under a constant normal load of " + format_quantity(load.load_n.value, "N");
    case physics::NormalLoadLaw::wedge:
      return " under a normal load of " + format_quantity(load.load_n.value, "N") +
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
  return std::any_of(d.findings.begin(), d.findings.end(), is_ambiguous) ? Answer::ambiguous
                                                                         : Answer::named;
}

std::string headline_of(const Diagnosis& d) {
  const std::string names = findings_text(d);
  switch (answer_of(d)) {
    case Answer::consistent:
      return "No missing physics: the model explains the recording to within the noise.";
    case Answer::unexplained:
      return d.findings.empty()
                 ? "The model and the recording disagree, and none of the candidate effects "
                   "explains why."
                 : "The model and the recording disagree, and the effects found explain only part "
                   "of it: " +
                       names + ".";
    case Answer::ambiguous: {
      const auto open = std::find_if(d.findings.begin(), d.findings.end(), is_ambiguous);
      return "The model lacks " + number_of_effects(d) + ", most likely " + names +
             "; this recording alone does not rule out " +
             effect_name(open->alternatives.front().candidate) + ".";
    }
    case Answer::named:
      break;
  }
  return "The model lacks " + number_of_effects(d) + ": " + names + ".";
}

std::string rig_description(const physics::Model& model) {
  std::string out = oscillator_text(model.oscillator) + friction_text(model);
  if (model.normal_load) out += load_text(*model.normal_load);
  if (model.load_cell) {
    out += model.load_cell->dynamics == physics::LoadCellDynamics::resonant
               ? "; the friction force is measured by a load cell with a resonance"
               : "; the friction force is measured by a load cell that is assumed rigid";
  }
  return out + ".";
}

}  // namespace stickslip::report
