// SPDX-License-Identifier: Apache-2.0
#include "physics/free_form.h"

#include <array>

#include "physics/number_text.h"

namespace stickslip::physics {

namespace {

constexpr std::size_t knots = 8;
using Parameters = std::array<ParameterCard, knots + 2>;

constexpr ParameterCard knot(std::string_view name, std::string_view unit) {
  return ParameterCard{.name = name,
                       .unit = unit,
                       .meaning = "ordinate of that knot, of eight from low to high",
                       .low = -10.0,
                       .high = 10.0,
                       .positive = false,
                       .fixed_default = std::nullopt};
}

constexpr Parameters parameters_in(std::string_view unit, std::string_view abscissa) {
  return {knot("at_1", unit),
          knot("at_2", unit),
          knot("at_3", unit),
          knot("at_4", unit),
          knot("at_5", unit),
          knot("at_6", unit),
          knot("at_7", unit),
          knot("at_8", unit),
          ParameterCard{.name = "low",
                        .unit = abscissa,
                        .meaning = "first knot",
                        .low = -1.0e3,
                        .high = 1.0e3,
                        .positive = false,
                        .fixed_default = -1.0},
          ParameterCard{.name = "high",
                        .unit = abscissa,
                        .meaning = "last knot",
                        .low = -1.0e3,
                        .high = 1.0e5,
                        .positive = false,
                        .fixed_default = 1.0}};
}

// By FreeFormOver.
constexpr std::array<std::string_view, 4> variables = {"displacement", "velocity", "time",
                                                       "normal_load"};
constexpr std::array<Parameters, 4> of_force = {parameters_in("N", "m"), parameters_in("N", "m/s"),
                                                parameters_in("N", "s"), parameters_in("N", "N")};
constexpr std::array<Parameters, 4> of_share = {parameters_in("1", "m"), parameters_in("1", "m/s"),
                                                parameters_in("1", "s"), parameters_in("1", "N")};

// Eight ordinates between the ends of the range on a bench, by FreeFormOver.
constexpr std::array<double, knots + 2> example_between(double low, double high) {
  return {0.0, 0.04, 0.1, 0.07, -0.02, -0.06, -0.03, 0.04, low, high};
}
constexpr std::array examples = {example_between(-0.02, 0.02), example_between(-0.3, 0.3),
                                 example_between(0.0, 60.0), example_between(0.1, 0.2)};

constexpr Relation relation_of(FreeFormOf of) {
  switch (of) {
    case FreeFormOf::force:
      return Relation::force_balance;
    case FreeFormOf::friction:
      return Relation::friction_law;
    case FreeFormOf::load:
      return Relation::normal_load;
  }
  return Relation::force_balance;
}

Card card_of(const FreeFormCard& card) {
  const auto over = static_cast<std::size_t>(card.over);
  return Card{.id = card.id,
              .relation = relation_of(card.of),
              .name = card.name,
              .sentence = card.sentence,
              .equation = card.equation,
              .parameters = card.of == FreeFormOf::force ? of_force[over] : of_share[over],
              .experiment = card.experiment,
              .rivals = {},
              .depends_on = std::span(variables).subspan(over, 1),
              .formula_residual = 0.1,
              .tier = Tier::free_form,
              .example = examples[over],
              .shows_by_load = card.over == FreeFormOver::load};
}

}  // namespace

FreeForm::FreeForm(const FreeFormCard& card)
    : of_(card.of), over_(card.over), card_(card_of(card)) {}

bool FreeForm::can_be_missing_from(const Model& model) const {
  switch (of_) {
    case FreeFormOf::force:
      return model.oscillator.excitation != Excitation::imposed;
    case FreeFormOf::friction:
      return model.friction.law != FrictionLaw::none &&
             (over_ != FreeFormOver::load || model.normal_load.has_value());
    case FreeFormOf::load:
      return model.normal_load && model.normal_load->law != NormalLoadLaw::measured;
  }
  return false;
}

std::vector<std::vector<double>> FreeForm::starts(const Scales& scales) const {
  std::vector<double> start(knots + 2, 0.0);
  switch (over_) {
    case FreeFormOver::displacement:
      start[knots] = -scales.displacement_m;
      start[knots + 1] = scales.displacement_m;
      break;
    case FreeFormOver::velocity:
      start[knots] = -2.0 * scales.velocity_m_s;
      start[knots + 1] = 2.0 * scales.velocity_m_s;
      break;
    case FreeFormOver::time:
      start[knots] = 0.0;
      start[knots + 1] = scales.duration_s;
      break;
    case FreeFormOver::load:
      start[knots] = scales.lowest_load_n;
      start[knots + 1] = std::max(scales.highest_load_n, scales.lowest_load_n * 1.01 + 1.0e-9);
      break;
  }
  return {start};
}

std::string FreeForm::statement(std::span<const double> p, const Place& /*place*/) const {
  const auto [low, high] = std::minmax_element(p.begin(), p.begin() + knots);
  return std::string(card_.sentence.substr(0, card_.sentence.size() - 1)) + ": from " +
         number_text(*low) + " to " + number_text(*high) +
         (of_ == FreeFormOf::force ? " N" : " of its nominal value") + " between " +
         number_text(p[knots]) + " and " + number_text(p[knots + 1]) + ' ' +
         std::string(card_.parameters[knots].unit) + ", at the first and last knot " +
         number_text(p[0]) + " and " + number_text(p[knots - 1]) + ".";
}

unsigned FreeForm::hooks() const {
  switch (of_) {
    case FreeFormOf::force:
      return hook::force;
    case FreeFormOf::friction:
      return over_ == FreeFormOver::velocity ? hook::slip_friction : hook::friction;
    case FreeFormOf::load:
      return hook::load;
  }
  return 0;
}

}  // namespace stickslip::physics
