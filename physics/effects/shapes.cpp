// Physics that nobody has named: a force, a friction or a load that depends on one quantity in a
// way that the recording itself draws. A straight line from knot to knot over the range that the
// recording visits; constant beyond it.
#include <algorithm>
#include <array>
#include <cmath>

#include "physics/effects/effect.h"
#include "physics/effects/entries.h"
#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

constexpr int knots = 8;

constexpr ParameterCard knot(std::string_view name, std::string_view unit) {
  return ParameterCard{.name = name,
                       .unit = unit,
                       .meaning = "height of the shape at that knot, of eight from low to high",
                       .low = -10.0,
                       .high = 10.0,
                       .positive = false,
                       .fixed_default = std::nullopt};
}

constexpr std::array<ParameterCard, knots + 2> cards(std::string_view unit,
                                                     std::string_view abscissa) {
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

/// The straight line between the knots around `u`.
template <class T>
T height(const T& u, const T* p) {
  const double low = value_of(p[knots]);
  const double high = value_of(p[knots + 1]);
  const T position = (u - low) * ((knots - 1) / std::max(high - low, 1.0e-12));
  const double at = value_of(position);
  if (!(at > 0.0)) return p[0];
  if (!(at < knots - 1.0)) return p[knots - 1];
  const auto left = static_cast<int>(at);
  const T share = position - static_cast<double>(left);
  return p[left] + (p[left + 1] - p[left]) * share;
}

enum class Over { displacement, velocity, time, load };
enum class Of { force, friction, load };

template <class T>
T abscissa(Over over, const Instant<T>& at, Of of) {
  switch (over) {
    case Over::displacement:
      return at.x;
    case Over::velocity:
      return of == Of::force ? at.v : at.slip;
    case Over::time:
      return T(at.time_s);
    case Over::load:
      return at.load;
  }
  return at.x;
}

constexpr std::array<std::string_view, 1> on_displacement = {"displacement"};
constexpr std::array<std::string_view, 1> on_velocity = {"velocity"};
constexpr std::array<std::string_view, 1> on_time = {"time"};
constexpr std::array<std::string_view, 1> on_load = {"normal_load"};
constexpr std::array<std::string_view, 0> no_rivals = {};

class Shape final : public EffectOf<Shape> {
 public:
  Shape(const Card& card, Of of, Over over) : card_(card), of_(of), over_(over) {}

  const Card& card() const override { return card_; }

  bool can_be_missing_from(const Model& model) const override {
    switch (of_) {
      case Of::force:
        return model.oscillator.excitation != Excitation::imposed;
      case Of::friction:
        return model.friction.law != FrictionLaw::none &&
               (over_ != Over::load || (model.normal_load.has_value() &&
                                        model.normal_load->law != NormalLoadLaw::constant));
      case Of::load:
        return model.normal_load && model.normal_load->law != NormalLoadLaw::measured;
    }
    return false;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override {
    std::vector<double> start(knots + 2, 0.0);
    switch (over_) {
      case Over::displacement:
        start[knots] = -scales.displacement_m;
        start[knots + 1] = scales.displacement_m;
        break;
      case Over::velocity:
        start[knots] = -2.0 * scales.velocity_m_s;
        start[knots + 1] = 2.0 * scales.velocity_m_s;
        break;
      case Over::time:
        start[knots] = 0.0;
        start[knots + 1] = scales.duration_s;
        break;
      case Over::load:
        start[knots] = scales.lowest_load_n;
        start[knots + 1] = std::max(scales.highest_load_n, scales.lowest_load_n * 1.01 + 1.0e-9);
        break;
    }
    return {start};
  }
  std::string statement(std::span<const double> p) const override {
    const auto [low, high] = std::minmax_element(p.begin(), p.begin() + knots);
    return std::string(card_.sentence.substr(0, card_.sentence.size() - 1)) + ": from " +
           number_text(*low) + " to " + number_text(*high) +
           std::string(of_ == Of::force ? " N" : " of itself") + " between " +
           number_text(p[knots]) + " and " + number_text(p[knots + 1]) + ' ' +
           std::string(card_.parameters[knots].unit) + ", first and last " + number_text(p[0]) +
           " and " + number_text(p[knots - 1]) + ".";
  }

  unsigned hooks() const override {
    switch (of_) {
      case Of::force:
        return hook::force;
      case Of::friction:
        return over_ == Over::velocity ? hook::slip_friction : hook::friction;
      case Of::load:
        return hook::load;
    }
    return 0;
  }
  template <class T>
  T force_of(const Instant<T>& at, const T* p, const T* /*s*/) const {
    return height(abscissa(over_, at, of_), p);
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const Instant<T>& at, const T* p,
                         const T* /*s*/) const {
    const T factor = 1.0 + height(abscissa(over_, at, of_), p);
    f.mu = f.mu * (factor > 0.0 ? factor : T(0.0));
  }
  template <class T>
  void scale_load_of(T& load, const Instant<T>& at, const T* p, const T* /*s*/) const {
    load = load * (1.0 + height(abscissa(over_, at, of_), p));
  }

 private:
  Card card_;
  Of of_;
  Over over_;
};

constexpr auto force_x = cards("N", "m");
constexpr auto force_v = cards("N", "m/s");
constexpr auto force_t = cards("N", "s");
constexpr auto share_x = cards("1", "m");
constexpr auto share_v = cards("1", "m/s");
constexpr auto share_t = cards("1", "s");
constexpr auto share_n = cards("1", "N");

constexpr Card card_of(std::string_view id, Relation relation, std::string_view name,
                       std::string_view sentence, std::string_view equation,
                       std::span<const ParameterCard> parameters, std::string_view experiment,
                       std::span<const std::string_view> depends_on) {
  return Card{.id = id,
              .relation = relation,
              .name = name,
              .sentence = sentence,
              .equation = equation,
              .parameters = parameters,
              .experiment = experiment,
              .rivals = no_rivals,
              .depends_on = depends_on,
              .tier = Tier::drawn_shape};
}

}  // namespace

const Effect& force_over_displacement() {
  static const Shape effect(
      card_of("force_over_displacement", Relation::force_balance, "force that depends on x",
              "A force that nobody listed depends on the displacement.",
              "s(x) added to the restoring force, s a line through eight knots", force_x,
              "a slow sweep over the whole range of the displacement", on_displacement),
      Of::force, Over::displacement);
  return effect;
}

const Effect& force_over_velocity() {
  static const Shape effect(
      card_of("force_over_velocity", Relation::force_balance, "force that depends on v",
              "A force that nobody listed depends on the velocity.",
              "s(v) added to the restoring force, s a line through eight knots", force_v,
              "free decays from several amplitudes", on_velocity),
      Of::force, Over::velocity);
  return effect;
}

const Effect& force_over_time() {
  static const Shape effect(
      card_of("force_over_time", Relation::force_balance, "force that changes in time",
              "A force that nobody listed changes in the course of the recording.",
              "s(t) added to the restoring force, s a line through eight knots", force_t,
              "the same run again", on_time),
      Of::force, Over::time);
  return effect;
}

const Effect& friction_over_displacement() {
  static const Shape effect(
      card_of("friction_over_displacement", Relation::friction_law, "friction that depends on x",
              "Friction depends on the place in a way that nobody listed.",
              "mu (1 + s(x)), s a line through eight knots", share_x,
              "a slow sweep over the whole track", on_displacement),
      Of::friction, Over::displacement);
  return effect;
}

const Effect& friction_over_velocity() {
  static const Shape effect(
      card_of("friction_over_velocity", Relation::friction_law, "friction that depends on v",
              "Friction depends on the slip velocity in a way that nobody listed.",
              "mu (1 + s(v)), s a line through eight knots", share_v,
              "a wide range of slip speeds in both directions", on_velocity),
      Of::friction, Over::velocity);
  return effect;
}

const Effect& friction_over_time() {
  static const Shape effect(
      card_of("friction_over_time", Relation::friction_law, "friction that changes in time",
              "Friction changes in time in a way that nobody listed.",
              "mu (1 + s(t)), s a line through eight knots", share_t, "the same run again",
              on_time),
      Of::friction, Over::time);
  return effect;
}

const Effect& friction_over_load() {
  static const Shape effect(
      card_of("friction_over_load", Relation::friction_law, "friction that depends on N",
              "The coefficient of friction depends on the load in a way that nobody listed.",
              "mu (1 + s(N)), s a line through eight knots", share_n,
              "the same run at another dead weight", on_load),
      Of::friction, Over::load);
  return effect;
}

const Effect& load_over_displacement() {
  static const Shape effect(
      card_of("load_over_displacement", Relation::normal_load, "load that depends on x",
              "The normal load depends on the displacement in a way that nobody listed.",
              "N (1 + s(x)), s a line through eight knots", share_x,
              "a slow sweep over the whole track with the normal-load bridge recorded",
              on_displacement),
      Of::load, Over::displacement);
  return effect;
}

const Effect& load_over_time() {
  static const Shape effect(
      card_of("load_over_time", Relation::normal_load, "load that changes in time",
              "The normal load changes in time in a way that nobody listed.",
              "N (1 + s(t)), s a line through eight knots", share_t, "the same run again", on_time),
      Of::load, Over::time);
  return effect;
}

}  // namespace stickslip::physics
