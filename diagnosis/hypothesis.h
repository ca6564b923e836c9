// SPDX-License-Identifier: Apache-2.0
// A model with its unknowns: parameters declared with a standard deviation, and the parameters of
// the terms on trial.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "physics/campaign.h"
#include "physics/effect.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::diagnosis {

/// Part of a number that an unknown of a campaign stands for.
enum class Part : std::uint8_t {
  level,      ///< the number itself, in all recordings or in its own one
  deviation,  ///< of its own recording from the level
  slope,      ///< its change with a condition
};

/// One unknown number, searched as z: value = centre + scale z, or centre exp(scale z) where only
/// positive values are meaningful. In a campaign z is, for each recording, the weighted sum of the
/// unknowns of that number.
struct Unknown {
  std::size_t parameter = 0;  ///< index into Rig::parameter_values
  double centre = 0.0;
  double scale = 1.0;
  bool logarithmic = false;
  double prior_sigma = 0.0;   ///< of z around 0; 0: no prior
  bool of_model = false;      ///< declared with a standard deviation, not part of a term on trial
  bool refinement = false;    ///< only refines the shape of an effect
  bool not_negative = false;  ///< kept at 0 or above
  bool freed = false;         ///< a declared number without what is declared of it, on trial
  Part part = Part::level;
  std::optional<std::size_t> recording = {};  ///< the only one that it acts in
  std::vector<double> weight = {};            ///< by recording; empty: 1 in all
  std::vector<double> factor = {};            ///< of the number, by recording; empty: 1 in all
};

/// Whether parameters that only refine the shape of an effect are unknowns from the start. A fit
/// that starts far from its solution converges better on the size of the effect alone.
enum class Detail { coarse, all };

/// A model and its unknowns. Immutable.
class Hypothesis {
 public:
  /// The declared model; its parameters with a standard deviation are the unknowns, in a campaign
  /// shared among its recordings as that says.
  explicit Hypothesis(const physics::Model& model,
                      std::shared_ptr<const physics::Campaign> campaign = nullptr);

  /// The same with `effect` added at `place`, its parameters starting at `start` (one of
  /// Effect::starts).
  Hypothesis with(const physics::Effect& effect, const physics::Place& place,
                  std::span<const double> start, std::span<const double> fixed,
                  Detail detail = Detail::all) const;

  /// The same with a declared number of the rig free, whatever the model says of it: it keeps its
  /// value as the centre, and has no prior but a wide one where it is positive.
  Hypothesis freeing(std::size_t parameter) const;

  /// The same with these declared numbers exact.
  Hypothesis holding(std::span<const std::size_t> parameters) const;
  /// The same with the standard deviations of `model`, which has the same declared numbers.
  Hypothesis with_uncertainties_of(const physics::Model& model) const;

  /// The same with the refinements of all terms on trial as further unknowns, after the present
  /// ones.
  Hypothesis refined() const;

  /// The same with another sharing of a number among the recordings of the campaign; one that is
  /// not an unknown stays known.
  Hypothesis sharing(const physics::SharedNumber& number) const;

  /// The same under `factor` times the declared normal load, where one is declared.
  Hypothesis with_load_factor(double factor) const;

  const physics::Model& model() const { return model_; }
  const physics::Rig& rig() const { return rig_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  const physics::Campaign* campaign() const { return runs_.campaign.get(); }
  /// Recordings whose numbers may differ: those of the campaign, or one that stands for all.
  std::size_t recordings() const { return campaign() ? campaign()->runs.size() : 1; }
  /// Terms on trial, in the order in which they were added.
  std::span<const physics::BoundTerm> trial_terms() const {
    return rig_.terms().subspan(declared_terms_);
  }

  /// True if the channel is a prediction; the imposed displacement and a measured load are inputs.
  bool predicts(Channel channel) const;
  /// The unknown that is this number of the rig, the first of several; none where the number is
  /// not unknown.
  std::optional<std::size_t> unknown_of(std::size_t parameter) const;

  /// Numbers of instruments whose z, of a declared standard deviation, is farther from 0 than
  /// `most`: indices into Rig::parameter_values.
  std::vector<std::size_t> instruments_beyond(std::span<const double> z, double most) const;

  double value(std::size_t unknown, double z) const;
  /// The z at which the unknown has that value, as far as it can.
  double z_of(std::size_t unknown, double value) const;
  /// d value / d z.
  double slope(std::size_t unknown, double z) const;
  /// All parameter values of the rig at these z. In a campaign: for the mean recording, at the
  /// reference of each condition.
  std::vector<double> parameters(std::span<const double> z) const;
  /// The model with those values; parameters keep their standard deviations.
  physics::Model model_at(std::span<const double> z) const;

  /// Parameter values in one recording, and the model with them.
  std::vector<double> parameters(std::span<const double> z, std::size_t recording) const;
  physics::Model model_in(std::span<const double> z, std::size_t recording) const;
  /// The model of any run under the campaign's conditions, among its recordings or not. Of numbers
  /// that each recording has its own, it has the mean.
  physics::Model model_at(std::span<const double> z, const physics::Run& run) const;
  /// True if the number in that recording depends on the unknown.
  bool acts(std::size_t unknown, std::size_t recording) const;
  /// d number / d z of the unknown, in one recording.
  double slope(std::size_t unknown, std::span<const double> z, std::size_t recording) const;

 private:
  // A known number of one recording: `factor` times that of the model, and `shift`.
  struct Setting {
    std::size_t parameter = 0;
    double factor = 1.0;
    double shift = 0.0;
  };
  // A campaign bound to the numbers of the rig.
  struct Runs {
    std::shared_ptr<const physics::Campaign> campaign;
    std::vector<std::vector<Setting>> setting;  // by recording
  };

  Hypothesis(physics::Model model, std::vector<Unknown> trial_unknowns, std::size_t declared_terms,
             Runs runs);
  std::vector<Setting> settings(const physics::Run& run) const;
  void add(const Unknown& unknown);
  void share_last();
  double common_z(std::size_t first, std::span<const double> z) const;
  double z_in(std::size_t first, std::span<const double> z, std::size_t recording) const;
  std::vector<Unknown> trial_unknowns() const;
  bool is_unknown(int parameter) const;

  physics::Model model_;
  physics::Rig rig_;
  std::vector<Unknown> unknowns_;
  Runs runs_;
  std::size_t declared_terms_;  // leading terms of the model that are declared, not on trial
};

/// Numbers of `from` at `z` as unknowns of `to`: what both have keeps its value, the rest starts at
/// its centre.
std::vector<double> carried_over(const Hypothesis& from, std::span<const double> z,
                                 const Hypothesis& to);

/// Parameters of a term in the order of its effect's card, of the rig's parameter `values`.
std::vector<double> values_of(const physics::BoundTerm& term, std::span<const double> values);

}  // namespace stickslip::diagnosis
