// A model with what is unknown in it: parameters known within a sigma, and the parameters of terms
// that are on trial.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "physics/effects/effect.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::diagnosis {

/// One number to be found. It is searched as z: value = centre + scale z, or centre exp(scale z)
/// where only positive values make sense.
struct Unknown {
  std::size_t parameter = 0;  ///< index into Rig::parameter_values
  double centre = 0.0;
  double scale = 1.0;
  bool logarithmic = false;
  double prior_sigma = 0.0;  ///< of z around 0; 0: no prior
  bool of_model = false;     ///< declared with a sigma, as opposed to a term on trial
  bool refinement = false;   ///< only refines the shape of an effect
};

/// Whether numbers that only refine the shape of an effect are unknowns from the beginning. A fit
/// that starts far away does better to find the effect's size first.
enum class Detail { coarse, all };

/// A model and its unknowns. Immutable after it is made.
class Hypothesis {
 public:
  /// The declared model: its parameters with a sigma are the unknowns.
  explicit Hypothesis(const physics::Model& model);

  /// The same with `effect` added at `place`, its parameters starting at `start`: one of those that
  /// the effect names.
  Hypothesis with(const physics::Effect& effect, const physics::Place& place,
                  std::span<const double> start, std::span<const double> fixed,
                  Detail detail = Detail::all) const;

  /// The same with the refinements of all terms on trial as unknowns too, after those that it has.
  Hypothesis refined() const;

  /// The same under `factor` times the declared normal load, where one is declared.
  Hypothesis loaded(double factor) const;

  const physics::Model& model() const { return model_; }
  const physics::Rig& rig() const { return rig_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }

  double value(std::size_t unknown, double z) const;
  /// d value / d z.
  double slope(std::size_t unknown, double z) const;
  /// All parameter values of the rig at these z.
  std::vector<double> parameters(std::span<const double> z) const;
  /// The model with those values; parameters keep their sigma.
  physics::Model model_at(std::span<const double> z) const;

 private:
  Hypothesis(physics::Model model, std::vector<Unknown> of_terms, std::size_t declared_terms);
  std::vector<Unknown> of_terms() const;

  physics::Model model_;
  physics::Rig rig_;
  std::vector<Unknown> unknowns_;
  std::size_t declared_terms_;  // the model's first terms; those after them are on trial
};

}  // namespace stickslip::diagnosis
