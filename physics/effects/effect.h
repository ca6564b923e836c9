// An effect: one piece of physics that a model may lack. Its class is the only place that knows it:
// the sentence that names it, its equation, its parameters, the relation it enters, and the term
// itself. Simulator, observer, diagnosis, report and documentation read that one entry. To add an
// effect is to add one file here and its name to the list in catalogue.cpp.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "physics/dual.h"
#include "physics/model.h"

namespace stickslip::physics {

/// Where in the description of the rig an effect lives (section 5 of the contract).
enum class Relation { kinematics, force_balance, friction_law, normal_load, load_cell, sensor };

std::string_view name_of(Relation relation);

/// How much a name says: the diagnosis prefers the lower tier of two that explain equally well.
enum class Tier {
  listed,       ///< in the catalogue of docs/formats.md: reported under its id
  formula,      ///< a formula that the catalogue does not list: reported as `unlisted`
  drawn_shape,  ///< a curve free to bend anywhere: reported as `unlisted`
};

/// One parameter of an effect.
struct ParameterCard {
  std::string_view name;  ///< as in the contract, with its unit as suffix
  std::string_view unit;
  std::string_view meaning;
  double low = 0.0;  ///< plausible range on a bench like ours, for documentation and checks
  double high = 0.0;
  bool positive = false;  ///< only values > 0 make sense; estimated by its logarithm
  /// Present: not estimated; a model file may leave it out, and this is what it then is.
  std::optional<double> fixed_default;
  bool estimated = false;  ///< in spite of a default
  /// At which the effect is not there; intervals of estimates are about the distance from it.
  double neutral = 0.0;
  /// How far the value can be off because nature does not follow the formula to the letter: a
  /// standard deviation, relative to the distance from `neutral`.
  double formula_uncertainty = 0.03;
  double start_sigma = 0.0;  ///< how well a start is known, standard deviation; 0: not at all
};

/// What a person reads about an effect.
struct Card {
  std::string_view id;  ///< of the contract's section 6, or our own where `depends_on` is not empty
  Relation relation = Relation::force_balance;
  std::string_view name;      ///< "hardening or softening spring"
  std::string_view sentence;  ///< "The spring hardens (k3 > 0) or softens with deflection."
  std::string_view equation;  ///< "k3 x^3 added to the restoring force"
  std::span<const ParameterCard> parameters;
  std::string_view experiment;               ///< the run that shows it best
  std::span<const std::string_view> rivals;  ///< ids that look like it on a poor recording
  /// Column stems, of physics that the contract does not list: reports call it `unlisted`. Of a
  /// sensor effect those of the channels that it can act on.
  std::span<const std::string_view> depends_on = {};
  /// Which parameter says how much of the effect there is: at its `neutral` there is none. None
  /// where no single number does.
  std::optional<std::size_t> strength = 0;
  Tier tier = Tier::listed;
};

/// Where an effect acts, as far as that is a choice.
struct Place {
  std::optional<Channel> channel;  ///< relation sensor: the channel that is read wrongly
  std::optional<Channel> from;     ///< the other channel that takes part, crosstalk only

  friend bool operator==(const Place&, const Place&) = default;
};

/// A sine that stands out of what a model leaves unexplained: amplitude sin(2 pi f t + phase).
struct Line {
  double frequency_hz = 50.0;
  double amplitude = 0.0;
  double phase_rad = 0.0;
};

/// The sizes of things in one channel.
struct ChannelScales {
  double largest = 1.0;  ///< largest magnitude of the readings
  double spread = 1.0;   ///< their standard deviation
  double pile = 1.0;     ///< magnitude at which the larger readings pile up
  Line line;             ///< the strongest above the frequencies of the drive
};

/// The sizes of things in a recording, from which starting values are made.
struct Scales {
  double displacement_m = 1.0;  ///< largest deflection
  double velocity_m_s = 1.0;    ///< root mean square
  double force_n = 1.0;         ///< largest of inertia, spring and drive, as far as they are known
  double friction_n = 0.0;      ///< mu N of the model; 0 where it has no friction
  double stiffness_n_m = 1.0;
  double mean_load_n = 1.0;
  double duration_s = 1.0;
  double sample_period_s = 1.0e-3;
  double mass_kg = 1.0;
  double transition_speed_m_s = 0.0;
  double cell_frequency_hz = 20.0;  ///< of the load cell, where one is declared
  double cell_damping_ratio = 0.02;
  double lowest_load_n = 1.0;   ///< of N
  double highest_load_n = 1.0;  ///< of N
  /// The most conspicuous frequencies of what is unexplained, strongest first.
  std::vector<double> frequencies_hz;
  ChannelScales channel;  ///< of the place on trial
  ChannelScales from;
  /// When the unexplained begins and ends, where it does not last: [s] from the beginning.
  std::vector<std::pair<double, double>> episodes_s;
};

/// How large a state of an effect is, for a prior on where a stretch of recording begins.
struct StateSize {
  double sigma = 1.0;
  double hidden = 0.0;  ///< other than 0: a typical size of a state that no channel shows
};

/// How theta follows the backbone g.
enum class Kinetics {
  instantaneous,  ///< theta = g(v)
  relaxing,       ///< theta' = -rate (theta - g(v))
  bristle,        ///< a tangential spring that slips: z' = v - abs(v) z k_c / (mu N), f = k_c z
};

/// What the integrator must know about a rig before it starts. An effect may change it.
struct Structure {
  Excitation excitation = Excitation::base;
  bool friction = false;
  Kinetics kinetics = Kinetics::instantaneous;
  /// Relaxing: theta is made of a fast part, the contact's, and a slow one, the first state of the
  /// effect that says so.
  bool two_processes = false;
  bool load_cell = false;
  bool resonant = false;  ///< the load cell's whole equation
  bool two_well = false;
  bool loaded = false;  ///< friction is mu N theta; otherwise mu theta with mu in newtons
  NormalLoadLaw load_law = NormalLoadLaw::constant;
};

/// The numbers of the equations.
template <class T>
struct Coefficients {
  T mass{1.0};
  T damping{0.0};
  T stiffness{0.0};
  T well_linear{0.0}, well_cubic{0.0};
  T load{1.0}, load_slope{0.0}, load_curvature{0.0};
  T mu{0.0}, transition_speed{0.0}, rate{0.0}, contact_stiffness{0.0}, contact_damping{0.0},
      contact_elastic_share{0.0};
  T rate_spread{0.0};  ///< two relaxation processes, with rates (1 +- spread) rate, 0 to below 1
  T cell_mass{1.0}, cell_damping{0.0}, cell_stiffness{1.0};
};

/// How one channel's reading departs from what its declared chain delivers; as it stands here, not
/// at all. reading = clip(bend(gain (late + leak other)) + drift + hum), late: delay_s ago,
/// bend(r) = r (1 + curvature r).
template <class T>
struct ReadingLaw {
  T gain{1.0};
  T curvature{0.0};
  T leak{0.0};
  std::optional<Channel> leak_from;
  T drift_per_s{0.0};       ///< at first
  T drift_settles_s{1e12};  ///< time constant with which the drift comes to an end
  T hum_amplitude{0.0}, hum_frequency_hz{0.0}, hum_phase_rad{0.0};
  /// How its amplitude wanders: cosine and sine of each harmonic of `hum_wander_over_s`.
  std::array<T, 8> hum_wander{};
  double hum_wander_over_s = 1.0;
  T delay_s{0.0};
  T limit{0.0};  ///< largest magnitude that is read; 0: none
};

template <class T>
struct ReadingLaws {
  std::array<ReadingLaw<T>, channel_count> of;
  T velocity_cutoff_hz{
      0.0};  ///< of the differentiator's roll-off, in place of the declared; 0: as declared
  bool wrong = false;  ///< whether anything departs at all
  bool late = false;   ///< whether any channel has a delay
};

/// The instant at which a term is evaluated.
template <class T>
struct Instant {
  double time_s = 0.0;
  T x{0.0}, v{0.0};  ///< deflection and velocity of the mass
  T slip{0.0};       ///< velocity across the friction contact
  T load{1.0};       ///< N
  double base_acceleration_m_s2 = 0.0;
  T friction{0.0};  ///< f at the beginning of the step; rates of states only
};

/// By how much an effect scales the friction: mu (and so the force at once), and the backbone g
/// that theta follows. The two differ only where theta has a memory.
template <class T>
struct FrictionFactors {
  T mu{1.0};
  T backbone{1.0};
};

/// What an effect does; hooks that it does not name are not called.
namespace hook {
inline constexpr unsigned coefficients = 1;  ///< changes numbers of the equations
inline constexpr unsigned force = 2;         ///< adds a force on the mass (against +x: restoring)
inline constexpr unsigned friction = 4;      ///< scales mu or the backbone of the friction law
inline constexpr unsigned slip_friction =
    64 + friction;                       ///< the same, by what the slip velocity is
inline constexpr unsigned load = 8;      ///< scales the normal load
inline constexpr unsigned seen = 16;     ///< the displacement gauge sees more than the mass
inline constexpr unsigned reading = 32;  ///< a channel is read wrongly
}  // namespace hook

inline constexpr int max_effect_states = 2;
inline constexpr int max_effect_parameters = 12;

class Effect {
 public:
  Effect() = default;
  Effect(const Effect&) = delete;
  Effect& operator=(const Effect&) = delete;
  virtual ~Effect() = default;

  virtual const Card& card() const = 0;

  /// Whether the effect can be missing from such a model (a model that has it, or that lacks what
  /// it acts on, cannot miss it).
  virtual bool can_be_missing_from(const Model& model) const = 0;

  /// What the laws of a model look like to other effects once it has this one as a term.
  virtual void mark(Model& /*model*/) const {}

  /// Which channels a sensor effect can act on, and from which others; any, before they are looked
  /// at. Not called for other relations.
  virtual bool acts_on(const Place& place) const { return !place.from.has_value(); }

  /// Values of the estimated parameters, in the order of the card, to start a fit from; several
  /// where one start does not reach every shape. A start that is as long as the card holds the
  /// fixed parameters as well.
  virtual std::vector<std::vector<double>> starts(const Scales& scales) const = 0;

  /// Fixed parameters (those with a default on the card) as this recording suggests them.
  virtual std::vector<double> fixed(const Scales& /*scales*/) const { return {}; }

  /// A sentence with numbers, for a report. `parameters` in the order of the card.
  virtual std::string statement(std::span<const double> parameters) const = 0;

  virtual unsigned hooks() const = 0;
  virtual int state_count() const { return 0; }
  virtual StateSize state_size(int /*index*/, std::span<const double> /*p*/,
                               const Scales& /*scales*/) const {
    return {};
  }
  virtual void shape(Structure& /*structure*/) const {}

  // The term itself, for plain numbers and for numbers with derivatives. `p`: all parameters in the
  // order of the card; `s`: the effect's own states.
  virtual void scale_load(double& load, const Instant<double>& at, const double* p,
                          const double* s) const = 0;
  virtual void scale_load(Dual& load, const Instant<Dual>& at, const Dual* p,
                          const Dual* s) const = 0;
  /// What the gauge of the displacement sees beside the mass, and its rate.
  virtual void see(double& x, double& v, const double* p, const double* s) const = 0;
  virtual void see(Dual& x, Dual& v, const Dual* p, const Dual* s) const = 0;
  virtual void misread(ReadingLaws<double>& laws, const Place& place, const double* p) const = 0;
  virtual void misread(ReadingLaws<Dual>& laws, const Place& place, const Dual* p) const = 0;
  virtual void set(Coefficients<double>& c, const double* p) const = 0;
  virtual void set(Coefficients<Dual>& c, const Dual* p) const = 0;
  virtual double force(const Instant<double>& at, const double* p, const double* s) const = 0;
  virtual Dual force(const Instant<Dual>& at, const Dual* p, const Dual* s) const = 0;
  virtual void scale_friction(FrictionFactors<double>& f, const Instant<double>& at,
                              const double* p, const double* s) const = 0;
  virtual void scale_friction(FrictionFactors<Dual>& f, const Instant<Dual>& at, const Dual* p,
                              const Dual* s) const = 0;
  virtual void rates(double* rate, const Instant<double>& at, const double* p,
                     const double* s) const = 0;
  virtual void rates(Dual* rate, const Instant<Dual>& at, const Dual* p, const Dual* s) const = 0;
  /// Brings states back to where exact integration keeps them; called after every step.
  virtual void confine(double* s, const double* p) const = 0;
  virtual void confine(Dual* s, const Dual* p) const = 0;
};

/// Lets an effect write each of its terms once: Derived hides whichever of the templates it uses.
template <class Derived>
class EffectOf : public Effect {
 public:
  template <class T>
  void set_coefficients(Coefficients<T>& /*c*/, const T* /*p*/) const {}
  template <class T>
  T force_of(const Instant<T>& /*at*/, const T* /*p*/, const T* /*s*/) const {
    return T(0.0);
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& /*f*/, const Instant<T>& /*at*/, const T* /*p*/,
                         const T* /*s*/) const {}
  template <class T>
  void scale_load_of(T& /*load*/, const Instant<T>& /*at*/, const T* /*p*/, const T* /*s*/) const {}
  template <class T>
  void see_of(T& /*x*/, T& /*v*/, const T* /*p*/, const T* /*s*/) const {}
  template <class T>
  void misread_of(ReadingLaws<T>& /*laws*/, const Place& /*place*/, const T* /*p*/) const {}
  template <class T>
  void rates_of(T* /*rate*/, const Instant<T>& /*at*/, const T* /*p*/, const T* /*s*/) const {}
  template <class T>
  void confine_of(T* /*s*/, const T* /*p*/) const {}

  void scale_load(double& load, const Instant<double>& at, const double* p,
                  const double* s) const final {
    self().scale_load_of(load, at, p, s);
  }
  void scale_load(Dual& load, const Instant<Dual>& at, const Dual* p, const Dual* s) const final {
    self().scale_load_of(load, at, p, s);
  }
  void see(double& x, double& v, const double* p, const double* s) const final {
    self().see_of(x, v, p, s);
  }
  void see(Dual& x, Dual& v, const Dual* p, const Dual* s) const final {
    self().see_of(x, v, p, s);
  }
  void misread(ReadingLaws<double>& laws, const Place& place, const double* p) const final {
    self().misread_of(laws, place, p);
  }
  void misread(ReadingLaws<Dual>& laws, const Place& place, const Dual* p) const final {
    self().misread_of(laws, place, p);
  }
  void set(Coefficients<double>& c, const double* p) const final { self().set_coefficients(c, p); }
  void set(Coefficients<Dual>& c, const Dual* p) const final { self().set_coefficients(c, p); }
  double force(const Instant<double>& at, const double* p, const double* s) const final {
    return self().force_of(at, p, s);
  }
  Dual force(const Instant<Dual>& at, const Dual* p, const Dual* s) const final {
    return self().force_of(at, p, s);
  }
  void scale_friction(FrictionFactors<double>& f, const Instant<double>& at, const double* p,
                      const double* s) const final {
    self().scale_friction_of(f, at, p, s);
  }
  void scale_friction(FrictionFactors<Dual>& f, const Instant<Dual>& at, const Dual* p,
                      const Dual* s) const final {
    self().scale_friction_of(f, at, p, s);
  }
  void rates(double* rate, const Instant<double>& at, const double* p,
             const double* s) const final {
    self().rates_of(rate, at, p, s);
  }
  void rates(Dual* rate, const Instant<Dual>& at, const Dual* p, const Dual* s) const final {
    self().rates_of(rate, at, p, s);
  }
  void confine(double* s, const double* p) const final { self().confine_of(s, p); }
  void confine(Dual* s, const Dual* p) const final { self().confine_of(s, p); }

 private:
  const Derived& self() const { return static_cast<const Derived&>(*this); }
};

}  // namespace stickslip::physics
