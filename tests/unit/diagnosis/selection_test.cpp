// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/selection.h"

#include <gtest/gtest.h>

#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

constexpr double loss_of_a_window = 100.0;  // nat, without an effect

physics::Model bench() {
  physics::Model model = test::driven_mass();
  model.sensors[index_of(Channel::displacement)].offset = physics::Parameter{0.0, 1.0e-4};
  return model;
}

// An effect that takes `gain_nat` in each of twelve windows, with the zero of the displacement
// `offset_sigmas` off, which is a part of its loss.
FittedCandidate candidate(const char* id, double gain_nat, double offset_sigmas = 0.0) {
  FittedCandidate out;
  out.candidate.effect = physics::find_effect(id);
  std::vector<double> start(out.candidate.effect->card().parameters.size(), 0.0);
  if (tier_of(out.candidate) == physics::Tier::free_form) start.back() = 1.0;
  const Hypothesis declared(bench());
  out.hypothesis = extended(declared, out.candidate, start, {}, Detail::coarse);
  out.fitted.z.assign(out.hypothesis->unknowns().size(), 0.0);
  const auto& paths = out.hypothesis->rig().parameter_paths();
  const auto offset = std::ranges::find(paths, "sensors.displacement.offset") - paths.begin();
  out.fitted.z[*out.hypothesis->unknown_of(static_cast<std::size_t>(offset))] = offset_sigmas;
  out.held_out.loss.assign(12, loss_of_a_window - gain_nat);
  out.held_out.prior_penalty = 0.5 * offset_sigmas * offset_sigmas;
  out.held_out.chi2 = 1.0;
  return out;
}

std::string_view first_of(std::vector<FittedCandidate> candidates) {
  SearchData data;
  data.noise_is_known = true;
  HeldOut current;
  current.loss.assign(12, loss_of_a_window);
  rank(candidates, data, current, 1);
  return candidates.front().candidate.effect->card().id;
}

// Of 1080 nats, its formula may leave 0.8 %.
TEST(Ranking, PrefersAListedEffectWithinWhatItsFormulaMayLeave) {
  EXPECT_EQ(
      first_of({candidate("cubic_stiffness", 89.5), candidate("force_over_displacement", 90.0)}),
      "cubic_stiffness");
  EXPECT_EQ(
      first_of({candidate("cubic_stiffness", 86.0), candidate("force_over_displacement", 90.0)}),
      "force_over_displacement");
}

// A zero that is off is a finding of its own, and a shape bends as it does.
TEST(Ranking, DoesNotCountAnInstrumentThatIsOffAgainstAListedEffect) {
  EXPECT_EQ(first_of({candidate("cubic_stiffness", 90.0, 10.0),
                      candidate("force_over_displacement", 90.0)}),
            "cubic_stiffness");
  EXPECT_EQ(first_of({candidate("cubic_stiffness", 86.0, 10.0),
                      candidate("force_over_displacement", 90.0)}),
            "force_over_displacement");
}

}  // namespace
}  // namespace stickslip::diagnosis
