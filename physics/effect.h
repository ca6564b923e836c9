// SPDX-License-Identifier: Apache-2.0
// Effect: one piece of physics that a model may lack. Its class holds everything about it:
// the sentence that names it, its equation, its parameters, the relation it enters, how a report
// draws it, and the term itself. Simulator, observer, diagnosis, report and documentation read that
// entry. An effect is added by one file in physics/effects/ (see effects.cmake).
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "physics/dual.h"
#include "physics/model.h"
#include "physics/place.h"

namespace stickslip::physics {

class Effect;

/// The relation of the rig's description that an effect enters (docs/formats.md, section 5).
enum class Relation { kinematics, force_balance, friction_law, normal_load, load_cell, sensor };

std::string_view name_of(Relation relation);

/// Specificity of an effect: of two that explain equally well the diagnosis prefers the lower tier.
enum class Tier {
  listed,     ///< in the catalogue of docs/formats.md: reported under its id
  formula,    ///< a formula that the catalogue does not list: reported as `unlisted`
  free_form,  ///< a piecewise linear curve: reported as `unlisted`
};

/// One parameter of an effect.
struct ParameterCard {
  std::string_view name;  ///< as in docs/formats.md, with its unit as suffix
  std::string_view unit;
  std::string_view meaning;
  double low = 0.0;  ///< plausible range on a bench like ours, for documentation and checks
  double high = 0.0;
  bool positive = false;  ///< restricted to values > 0; estimated by its logarithm
  /// Present: not estimated, and optional in a model file, with this default.
  std::optional<double> fixed_default;
  bool estimated = false;  ///< estimated in spite of a default
  /// Value at which the effect vanishes; intervals of estimates refer to the distance from it.
  double neutral = 0.0;
  /// Modelling error of the formula: standard deviation, relative to the distance from `neutral`.
  /// Where rigs have other forms, as tests/benchmark/formula_table measures it.
  double formula_uncertainty = 0.03;
  double start_sigma = 0.0;  ///< standard deviation of a starting value; 0: unknown
};

/// The parameters between which an effect acts, by position on its card [s].
struct Episode {
  std::size_t begin_s = 0;
  std::size_t end_s = 0;
};

/// The parameter that is the frequency of an oscillation [Hz], by position on its card.
struct Frequency {
  std::size_t parameter = 0;
  std::string_view spectral_mark = {};  ///< label of its line in live spectra; empty: none
  bool tone = false;  ///< forced from outside, not a resonance: its frequency may show its source
};

/// Card::formula_residual of an instrument's error and of linear laws, which have no other form.
inline constexpr double exact_formula = 1.0e-5;

/// The description of an effect, for people and for the rooms that use it.
struct Card {
  std::string_view id;  ///< of docs/formats.md, section 6, if listed
  Relation relation = Relation::force_balance;
  std::string_view name;      ///< "hardening or softening spring"
  std::string_view sentence;  ///< "The spring hardens or softens with deflection."
  std::string_view equation;  ///< "k3_n_m3 x^3 added to the restoring force"
  std::span<const ParameterCard> parameters;
  std::string_view experiment;               ///< the run that shows it best
  std::span<const std::string_view> rivals;  ///< ids that resemble it in a poor recording
  /// Column stems, of physics that the catalogue does not list, reported as `unlisted`. For a
  /// sensor effect those of the channels that it can act on.
  std::span<const std::string_view> depends_on = {};
  /// Share of the excess chi-squared explained by the effect that its formula may leave where the
  /// rig has another form (measured likewise).
  double formula_residual = 1.0e-3;
  /// The parameter that measures the size of the effect: at its `neutral` there is none. Absent
  /// where no single parameter does.
  std::optional<std::size_t> strength = 0;
  Tier tier = Tier::listed;
  std::optional<Episode> episode = {};      ///< present where the effect does not last
  std::optional<Frequency> frequency = {};  ///< present where the effect oscillates
  /// Transition speed of a friction law [m/s], by position; at 0 the law is set-valued.
  std::optional<std::size_t> transition_speed = {};
  /// Literature: authors, title, place of publication, year. Empty where there is none.
  std::span<const std::string_view> references = {};
  /// Parameters with which the catalogue's page (docs/effects.md) draws it, plausible on a bench
  /// like ours; empty: no picture.
  std::span<const double> example = {};
  /// A whole law of friction (physics/laws/), with a coefficient of its own: no candidate of a
  /// diagnosis, but the law of [friction] by name.
  bool law = false;
  /// Ids of the effects that a law has in it, which a model with that law cannot lack.
  std::span<const std::string_view> includes = {};
  /// Shows only where the load differs, within a recording or between recordings.
  bool shows_by_load = false;
};

/// A spectral line of what a model leaves unexplained: amplitude sin(2 pi f t + phase).
struct Line {
  double frequency_hz = 50.0;
  double amplitude = 0.0;
  double phase_rad = 0.0;
};

/// Typical magnitudes in one channel.
struct ChannelScales {
  double largest = 1.0;  ///< largest magnitude of the readings
  double spread = 1.0;   ///< their standard deviation
  double pile = 1.0;     ///< magnitude at which the large readings accumulate
  Line line;             ///< the strongest above the frequencies of the drive
};

/// Typical magnitudes in a recording, from which starting values are derived.
struct Scales {
  double displacement_m = 1.0;  ///< largest deflection
  double velocity_m_s = 1.0;    ///< root mean square
  double force_n = 1.0;         ///< largest of inertia, spring and drive, as far as known
  double friction_n = 0.0;      ///< mu N of the model; 0 without friction
  double stiffness_n_m = 1.0;
  double mean_load_n = 1.0;
  double duration_s = 1.0;
  double sample_period_s = 1.0e-3;
  double mass_kg = 1.0;
  double transition_speed_m_s = 0.0;
  double cell_frequency_hz = 20.0;  ///< of the load cell, where one is declared
  double cell_damping_ratio = 0.02;
  double lowest_load_n = 1.0;
  double highest_load_n = 1.0;
  /// Most prominent frequencies of the residuals, strongest first.
  std::vector<double> frequencies_hz;
  ChannelScales channel;  ///< of the place under test
  ChannelScales from;
  /// Begin and end of residuals that do not last [s from the beginning].
  std::vector<std::pair<double, double>> episodes_s;
};

/// Prior of a state of an effect at the beginning of a window.
struct StateSize {
  double sigma = 1.0;
  double hidden = 0.0;  ///< other than 0: typical magnitude of a state that no channel observes
};

/// Relation of theta to the backbone g.
enum class Kinetics {
  instantaneous,  ///< theta = g(v)
  relaxing,       ///< theta' = -rate (theta - g(v))
  bristle,        ///< a tangential spring that slips: z' = v - abs(v) z k_c / (mu N), f = k_c z
  ageing,         ///< theta = g(v, age): the contact's state is the logarithm of its age
};

/// The structure of the equations, fixed before integration starts. Effects may change it.
struct Structure {
  Excitation excitation = Excitation::base;
  bool friction = false;
  Kinetics kinetics = Kinetics::instantaneous;
  /// Relaxing: theta is the sum of a fast part, the contact's, and a slow one, the first state of
  /// the effect that sets this.
  bool two_processes = false;
  /// Bristle: slips along a loop of Bouc and Wen in place of Dahl's.
  bool loop = false;
  /// Bristle: number of parallel elements, each of which sticks until it slips (Jenkins). The
  /// deflections of those after the first are the first states of the effect that sets this.
  int elements = 1;
  bool load_cell = false;
  bool resonant = false;  ///< the load cell's whole equation
  bool two_well = false;
  bool loaded = false;  ///< friction is mu N theta; otherwise mu theta with mu in newtons
  NormalLoadLaw load_law = NormalLoadLaw::constant;
};

/// The coefficients of the equations.
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
  T contact_viscosity{0.0};  ///< a force in proportion to the slip velocity, beside mu N theta
  T loop_shape{0.0}, loop_sharpness{1.0};  ///< of a loop; 1 and 1: Dahl's bristle
  T yield_spread{0.0};                     ///< of the slip forces of parallel elements, 0 to 1
  /// Ageing: changes per e-fold of the speed and of the age, relative to mu; the slip that renews
  /// contacts; and the speed at which theta is 1 in steady sliding.
  T direct_share{0.0}, evolution_share{0.0}, slip_length{1.0}, reference_speed{1.0};
  T cell_mass{1.0}, cell_damping{0.0}, cell_stiffness{1.0};
};

inline constexpr int max_effect_states = 4;  ///< of the terms of a model together
inline constexpr int max_effect_parameters = 12;
inline constexpr int max_characteristic_parameters = 4;

/// Errors of one channel's reading relative to the output of its declared chain; the defaults mean
/// none. reading = clip(d(bend(gain (delayed + crosstalk other))) + offset + drift + hum), delayed:
/// delay_s ago, bend(r) = r (1 + curvature r), d: the characteristic of an effect.
template <class T>
struct ReadingLaw {
  T gain{1.0};
  T curvature{0.0};
  T crosstalk{0.0};
  std::optional<Channel> crosstalk_from;
  T offset{0.0};
  T drift_per_s{0.0};             ///< initial rate
  T drift_time_constant_s{1e12};  ///< of the drift's exponential approach to its final value
  T hum_amplitude{0.0}, hum_frequency_hz{0.0}, hum_phase_rad{0.0};
  /// Amplitude modulation: cosine and sine of each harmonic of `hum_modulation_s`.
  std::array<T, 8> hum_modulation{};
  double hum_modulation_s = 1.0;
  T delay_s{0.0};
  /// Relative change of the cut-offs of the channel's filters, weighted by their lags.
  T cutoff_change{0.0};
  /// The share of delay_s by that change, and for the velocity by the displacement's. Not a delay
  /// of readings whose filters have the changed cut-offs.
  T lag_s{0.0};
  T limit{0.0};  ///< largest magnitude of the reading; 0: none
  /// Effect whose Effect::distort is the characteristic d; nullptr: none.
  const Effect* characteristic = nullptr;
  std::array<T, max_characteristic_parameters> characteristic_parameters{};
};

template <class T>
struct ReadingLaws {
  std::array<ReadingLaw<T>, channel_count> of;
  /// Cut-off of the differentiator, in place of the declared one; 0: as declared.
  T velocity_cutoff_hz{0.0};
  bool any_error = false;  ///< true if any member departs from its default
  bool any_delay = false;  ///< true if any channel has a delay
};

/// The operating point at which a term is evaluated.
template <class T>
struct OperatingPoint {
  double time_s = 0.0;
  T x{0.0}, v{0.0};  ///< deflection and velocity of the mass
  T slip{0.0};       ///< velocity across the friction contact
  T load{1.0};       ///< N
  double base_acceleration_m_s2 = 0.0;
  T friction{0.0};  ///< f at the beginning of the step; rates of states only
};

/// Friction as effects change it, one after the other: mu, which scales the force immediately, and
/// a factor on the backbone g that theta follows. The two differ only where theta has dynamics. In
/// a rig mu begins as the declared coefficient; where it begins as 1 it is a factor, too.
template <class T>
struct FrictionFactors {
  T mu{1.0};
  T backbone{1.0};
};

/// The parts of the equations that an effect changes; the functions of other parts are not called.
namespace hook {
inline constexpr unsigned coefficients = 1;  ///< coefficients of the equations
inline constexpr unsigned force = 2;         ///< a force on the mass (against +x: restoring)
inline constexpr unsigned friction = 4;      ///< factors on mu or the backbone
inline constexpr unsigned slip_friction =
    64 + friction;                               ///< the same, depending on the slip velocity
inline constexpr unsigned load = 8;              ///< a factor on the normal load
inline constexpr unsigned measured_motion = 16;  ///< motion that the displacement gauge adds
inline constexpr unsigned reading = 32;          ///< errors of a sensor
}  // namespace hook

/// A law over one variable as the literature plots it, for reports. Texts have static storage.
struct LawCurve {
  std::string_view variable;
  std::string_view variable_unit;
  double low = 0.0;  ///< range of the variable
  double high = 0.0;
  std::string_view quantity;
  std::string_view unit;
  std::function<double(double)> value;
};

class Effect {
 public:
  Effect() = default;
  Effect(const Effect&) = delete;
  Effect& operator=(const Effect&) = delete;
  virtual ~Effect() = default;

  virtual const Card& card() const = 0;

  /// True if a model with such laws can lack the effect: it has what the effect acts on, and does
  /// not include the effect yet.
  virtual bool can_be_missing_from(const Model& model) const = 0;

  /// Changes the laws of a model to what other effects meet once this one is among its terms.
  virtual void amend(Model& /*model*/) const {}

  /// Itself, where it is a formula of a model file; otherwise null.
  virtual std::shared_ptr<const FormulaEffect> own_formula() const { return nullptr; }

  /// True if a sensor effect can act there. Not called for other relations.
  virtual bool acts_on(const Place& place) const { return !place.from.has_value(); }

  /// Starting values of the estimated parameters, in the order of the card; several where a fit
  /// does not converge to every shape from one. A start as long as the card includes the fixed
  /// parameters.
  virtual std::vector<std::vector<double>> starts(const Scales& scales) const = 0;

  /// Fixed parameters (those with a default on the card) as this recording suggests them.
  virtual std::vector<double> fixed(const Scales& /*scales*/) const { return {}; }

  /// A sentence with numbers and units, for a report. `parameters` in the order of the card;
  /// `place`: the channels of a sensor effect.
  virtual std::string statement(std::span<const double> parameters, const Place& place) const = 0;

  /// Curves of an effect that replaces a law of the model; empty: the report plots the term itself.
  /// Ranges follow from `reference`, so that curves of similar `parameters` share their abscissae.
  /// Both in the order of the card. `friction_n`: friction force of the model at its mean load.
  virtual std::vector<LawCurve> law_curves(std::span<const double> /*parameters*/,
                                           std::span<const double> /*reference*/,
                                           double /*friction_n*/) const {
    return {};
  }

  virtual unsigned hooks() const = 0;
  virtual int state_count() const { return 0; }
  virtual StateSize state_size(int /*index*/, std::span<const double> /*p*/,
                               const Scales& /*scales*/) const {
    return {};
  }
  virtual void set_structure(Structure& /*structure*/) const {}

  // The term itself, for plain numbers and for numbers with derivatives. `p`: all parameters in the
  // order of the card; `s`: the effect's own states.
  virtual void scale_load(double& load, const OperatingPoint<double>& at, const double* p,
                          const double* s) const = 0;
  virtual void scale_load(Dual& load, const OperatingPoint<Dual>& at, const Dual* p,
                          const Dual* s) const = 0;
  /// Adds to the deflection and velocity that the displacement gauge measures.
  virtual void add_measured_motion(double& x, double& v, const double* p,
                                   const double* s) const = 0;
  virtual void add_measured_motion(Dual& x, Dual& v, const Dual* p, const Dual* s) const = 0;
  virtual void set_reading_law(ReadingLaws<double>& laws, const Place& place,
                               const double* p) const = 0;
  virtual void set_reading_law(ReadingLaws<Dual>& laws, const Place& place,
                               const Dual* p) const = 0;
  /// Characteristic of a sensor: replaces the true reading by the actual one. Increasing.
  virtual void distort(double& reading, const double* p) const = 0;
  virtual void distort(Dual& reading, const Dual* p) const = 0;
  virtual void set_coefficients(Coefficients<double>& c, const double* p) const = 0;
  virtual void set_coefficients(Coefficients<Dual>& c, const Dual* p) const = 0;
  virtual double force(const OperatingPoint<double>& at, const double* p,
                       const double* s) const = 0;
  virtual Dual force(const OperatingPoint<Dual>& at, const Dual* p, const Dual* s) const = 0;
  virtual void scale_friction(FrictionFactors<double>& f, const OperatingPoint<double>& at,
                              const double* p, const double* s) const = 0;
  virtual void scale_friction(FrictionFactors<Dual>& f, const OperatingPoint<Dual>& at,
                              const Dual* p, const Dual* s) const = 0;
  virtual void rates(double* rate, const OperatingPoint<double>& at, const double* p,
                     const double* s) const = 0;
  virtual void rates(Dual* rate, const OperatingPoint<Dual>& at, const Dual* p,
                     const Dual* s) const = 0;
  /// Limits states to the set that exact integration would keep them in; called after every step.
  virtual void confine(double* s, const double* p) const = 0;
  virtual void confine(Dual* s, const Dual* p) const = 0;
};

/// Implements each term of an effect from one template: Derived hides those that it uses.
template <class Derived>
class EffectOf : public Effect {
 public:
  template <class T>
  void coefficients_of(Coefficients<T>& /*c*/, const T* /*p*/) const {}
  template <class T>
  T force_of(const OperatingPoint<T>& /*at*/, const T* /*p*/, const T* /*s*/) const {
    return T(0.0);
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& /*f*/, const OperatingPoint<T>& /*at*/, const T* /*p*/,
                         const T* /*s*/) const {}
  template <class T>
  void scale_load_of(T& /*load*/, const OperatingPoint<T>& /*at*/, const T* /*p*/,
                     const T* /*s*/) const {}
  template <class T>
  void measured_motion_of(T& /*x*/, T& /*v*/, const T* /*p*/, const T* /*s*/) const {}
  /// By default a sensor effect with a characteristic of its own, see distort_of; with at most
  /// max_characteristic_parameters parameters.
  template <class T>
  void reading_law_of(ReadingLaws<T>& laws, const Place& place, const T* p) const {
    ReadingLaw<T>& law = laws.of[index_of(*place.channel)];
    law.characteristic = this;
    const std::size_t count =
        std::min(card().parameters.size(), law.characteristic_parameters.size());
    std::copy_n(p, count, law.characteristic_parameters.begin());
    laws.any_error = true;
  }
  template <class T>
  void distort_of(T& /*reading*/, const T* /*p*/) const {}
  template <class T>
  void rates_of(T* /*rate*/, const OperatingPoint<T>& /*at*/, const T* /*p*/,
                const T* /*s*/) const {}
  template <class T>
  void confine_of(T* /*s*/, const T* /*p*/) const {}

  void scale_load(double& load, const OperatingPoint<double>& at, const double* p,
                  const double* s) const final {
    self().scale_load_of(load, at, p, s);
  }
  void scale_load(Dual& load, const OperatingPoint<Dual>& at, const Dual* p,
                  const Dual* s) const final {
    self().scale_load_of(load, at, p, s);
  }
  void add_measured_motion(double& x, double& v, const double* p, const double* s) const final {
    self().measured_motion_of(x, v, p, s);
  }
  void add_measured_motion(Dual& x, Dual& v, const Dual* p, const Dual* s) const final {
    self().measured_motion_of(x, v, p, s);
  }
  void set_reading_law(ReadingLaws<double>& laws, const Place& place, const double* p) const final {
    self().reading_law_of(laws, place, p);
  }
  void set_reading_law(ReadingLaws<Dual>& laws, const Place& place, const Dual* p) const final {
    self().reading_law_of(laws, place, p);
  }
  void distort(double& reading, const double* p) const final { self().distort_of(reading, p); }
  void distort(Dual& reading, const Dual* p) const final { self().distort_of(reading, p); }
  void set_coefficients(Coefficients<double>& c, const double* p) const final {
    self().coefficients_of(c, p);
  }
  void set_coefficients(Coefficients<Dual>& c, const Dual* p) const final {
    self().coefficients_of(c, p);
  }
  double force(const OperatingPoint<double>& at, const double* p, const double* s) const final {
    return self().force_of(at, p, s);
  }
  Dual force(const OperatingPoint<Dual>& at, const Dual* p, const Dual* s) const final {
    return self().force_of(at, p, s);
  }
  void scale_friction(FrictionFactors<double>& f, const OperatingPoint<double>& at, const double* p,
                      const double* s) const final {
    self().scale_friction_of(f, at, p, s);
  }
  void scale_friction(FrictionFactors<Dual>& f, const OperatingPoint<Dual>& at, const Dual* p,
                      const Dual* s) const final {
    self().scale_friction_of(f, at, p, s);
  }
  void rates(double* rate, const OperatingPoint<double>& at, const double* p,
             const double* s) const final {
    self().rates_of(rate, at, p, s);
  }
  void rates(Dual* rate, const OperatingPoint<Dual>& at, const Dual* p, const Dual* s) const final {
    self().rates_of(rate, at, p, s);
  }
  void confine(double* s, const double* p) const final { self().confine_of(s, p); }
  void confine(Dual* s, const Dual* p) const final { self().confine_of(s, p); }

 private:
  const Derived& self() const { return static_cast<const Derived&>(*this); }
};

}  // namespace stickslip::physics
