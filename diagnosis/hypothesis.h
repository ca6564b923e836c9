// A model with its unknowns: parameters declared with a standard deviation, and the parameters of
// the terms on trial.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "physics/effect.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::diagnosis {

/// One unknown number, searched as z: value = centre + scale z, or centre exp(scale z) where only
/// positive values are meaningful.
struct Unknown {
  std::size_t parameter = 0;  ///< index into Rig::parameter_values
  double centre = 0.0;
  double scale = 1.0;
  bool logarithmic = false;
  double prior_sigma = 0.0;  ///< of z around 0; 0: no prior
  bool of_model = false;     ///< declared with a standard deviation, not part of a term on trial
  bool refinement = false;   ///< only refines the shape of an effect
};

/// Whether parameters that only refine the shape of an effect are unknowns from the start. A fit
/// that starts far from its solution converges better on the size of the effect alone.
enum class Detail { coarse, all };

/// A model and its unknowns. Immutable.
class Hypothesis {
 public:
  /// The declared model; its parameters with a standard deviation are the unknowns.
  explicit Hypothesis(const physics::Model& model);

  /// The same with `effect` added at `place`, its parameters starting at `start` (one of
  /// Effect::starts).
  Hypothesis with(const physics::Effect& effect, const physics::Place& place,
                  std::span<const double> start, std::span<const double> fixed,
                  Detail detail = Detail::all) const;

  /// The same with the refinements of all terms on trial as further unknowns, after the present
  /// ones.
  Hypothesis refined() const;

  /// The same under `factor` times the declared normal load, where one is declared.
  Hypothesis with_load_factor(double factor) const;

  const physics::Model& model() const { return model_; }
  const physics::Rig& rig() const { return rig_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  /// Terms on trial, in the order in which they were added.
  std::span<const physics::BoundTerm> trial_terms() const {
    return rig_.terms().subspan(declared_terms_);
  }

  double value(std::size_t unknown, double z) const;
  /// d value / d z.
  double slope(std::size_t unknown, double z) const;
  /// All parameter values of the rig at these z.
  std::vector<double> parameters(std::span<const double> z) const;
  /// The model with those values; parameters keep their standard deviations.
  physics::Model model_at(std::span<const double> z) const;

 private:
  Hypothesis(physics::Model model, std::vector<Unknown> trial_unknowns, std::size_t declared_terms);
  std::vector<Unknown> trial_unknowns() const;
  bool is_unknown(int parameter) const;

  physics::Model model_;
  physics::Rig rig_;
  std::vector<Unknown> unknowns_;
  std::size_t declared_terms_;  // leading terms of the model that are declared, not on trial
};

/// Parameters of a term in the order of its effect's card, of the rig's parameter `values`.
std::vector<double> values_of(const physics::BoundTerm& term, std::span<const double> values);

}  // namespace stickslip::diagnosis
