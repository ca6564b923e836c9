// SPDX-License-Identifier: Apache-2.0
// The equations of a rig, built from its Model, and their integrator, shared by the simulated rig,
// the observer's predictions and the fits of a diagnosis.
//
// Integrator: the additive Runge-Kutta scheme ARS(2,2,2) of Ascher, Ruuth and Spiteri (1997). The
// contact (friction force, its state theta or bristle) is implicit, everything else explicit. The
// implicit part is L-stable and stiffly accurate, so the set-valued Coulomb law sticks exactly,
// large gamma does not shorten the step, and smooth motion is integrated to second order.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "physics/effect.h"
#include "physics/input.h"
#include "physics/model.h"

namespace stickslip::physics {

inline constexpr int max_terms = 6;
inline constexpr int max_rig_states = 5 + max_effect_states;

/// Indices into RigState::s; states of effects follow from `first_effect` on.
namespace state {
inline constexpr int x = 0;        ///< deflection of the mass [m]
inline constexpr int v = 1;        ///< its velocity [m/s]
inline constexpr int y = 2;        ///< deflection of the load cell [m]
inline constexpr int u = 3;        ///< its velocity [m/s]
inline constexpr int contact = 4;  ///< theta, or the bristle's deflection [m]
inline constexpr int first_effect = 5;
}  // namespace state

template <class T>
struct RigState {
  std::array<T, max_rig_states> s{};
  T friction{0.0};  ///< friction force [N]
  T theta{0.0};     ///< friction over mu N
  T slip{0.0};      ///< velocity across the contact [m/s]
  T load{1.0};      ///< normal load [N]
  /// Excitation in addition to the input: acceleration of the frame [m/s^2], the drive force [N] of
  /// a force-excited rig, or the velocity of an imposed motion [m/s], whose derivatives the caller
  /// adds to `s`. For callers whose input is uncertain.
  T unrecorded{0.0};
};

/// The inputs of the sensor chains.
template <class T>
struct Quantities {
  T displacement{0.0};
  T velocity{0.0};
  T friction_reading{0.0};  ///< k_l y, or f where no load cell is declared
  T normal_load{0.0};
};

/// The numbers of the equations for one set of parameter values; see Rig::numbers.
template <class T>
struct RigNumbers {
  Coefficients<T> c;
  T inverse_mass{1.0};
  T inverse_cell_mass{0.0};
  std::array<std::array<T, max_effect_parameters>, max_terms> term{};
  ReadingLaws<T> reading;
  /// True over given excitation; other than 1 for recorded inputs whose channel has a gain error.
  T input_gain{1.0};
  /// Relative change of the cut-offs of the channel of the excitation, beyond that of its lag.
  T input_cutoff_change{0.0};
  /// Time by which the true excitation leads the given one, whose channel is delayed [s].
  T input_lead_s{0.0};
  T input_offset_n{0.0};  ///< of a recorded drive force
  /// Of a recorded normal load: the true one is load_gain (reading - load_offset_n).
  T load_gain{1.0}, load_offset_n{0.0};
};

/// A term of a model, resolved once: its effect, its states and its parameters are indices.
struct BoundTerm {
  const Effect* effect = nullptr;
  unsigned hooks = 0;  ///< effect->hooks()
  Place place;
  int first_state = 0;  ///< index into RigState::s of the first of the effect's own states
  /// By position on the effect's card: the index into parameters_of(model), -1 where the model
  /// omits the parameter, and the default for that case.
  std::array<int, max_effect_parameters> parameter{};
  std::array<double, max_effect_parameters> fallback{};

  /// Value of the parameter at that position of the card, among those of all parameters.
  template <class T>
  T value(std::size_t position, std::span<const T> parameters) const {
    const int index = parameter[position];
    return index >= 0 ? parameters[static_cast<std::size_t>(index)] : T(fallback[position]);
  }
  /// The values of all parameters of the effect, in the order of its card.
  template <class T>
  std::vector<T> values(std::span<const T> parameters) const {
    std::vector<T> out;
    const std::size_t count = effect->card().parameters.size();
    for (std::size_t i = 0; i < count; ++i) out.push_back(value(i, parameters));
    return out;
  }
};

/// The terms of a model without inconsistencies, in its order.
std::vector<BoundTerm> bound_terms(const Model& model);

/// The equations of one model. Immutable; all state is in RigState.
class Rig {
 public:
  /// Throws std::invalid_argument where inconsistencies_of(model) is not empty, or where the model
  /// has more terms than max_terms or more states than max_rig_states.
  explicit Rig(const Model& model);

  /// The model's parameters in the order of parameters_of(model).
  const std::vector<double>& parameter_values() const { return values_; }
  const std::vector<std::string>& parameter_paths() const { return paths_; }

  const Structure& structure() const { return structure_; }

  /// The terms of the model, in its order.
  std::span<const BoundTerm> terms() const { return terms_; }

  /// True if the state at that index is part of this rig's motion.
  bool has_state(int index) const;
  int state_count() const { return state_count_; }

  /// The numbers of the equations for these parameter values (order of parameters_of).
  template <class T>
  RigNumbers<T> numbers(std::span<const T> parameters) const;

  /// Completes a state whose s is given: load, slip, friction and theta follow from s. At rest a
  /// set-valued law yields 0 here; its holding force results from the first step.
  template <class T>
  void complete(RigState<T>& state, const Input& now, double time_s, const RigNumbers<T>& n) const;

  /// One step of `h` seconds from `time_s`, while the input goes linearly from `begin` to `end`.
  /// Where friction reverses or sets in, the step is halved up to four times around that instant:
  /// an error of its time by part of a step would be the largest of all.
  template <class T>
  void step(RigState<T>& state, const Input& begin, const Input& end, double time_s, double h,
            const RigNumbers<T>& n) const;

  template <class T>
  Quantities<T> quantities(const RigState<T>& state, const Input& now,
                           const RigNumbers<T>& n) const;

  /// The normal load in a state; for the law "measured" that of the input.
  template <class T>
  T normal_load(const RigState<T>& state, const Input& now, double time_s,
                const RigNumbers<T>& n) const;

  /// The longest step that resolves the fastest oscillation and decay of the explicit part.
  double longest_step_s() const { return longest_step_s_; }

 private:
  template <class T>
  T frame_acceleration(const RigState<T>& state, const Input& now, const RigNumbers<T>& n) const;
  template <class T>
  void explicit_rates(std::array<T, max_rig_states>& rate, const RigState<T>& state,
                      const Input& now, double time_s, const RigNumbers<T>& n) const;
  bool is_transition(double slip, double next, double transition_speed) const;
  template <class T>
  void undivided_step(RigState<T>& state, const Input& begin, const Input& end, double time_s,
                      double h, const RigNumbers<T>& n) const;
  template <class T>
  void halving_step(RigState<T>& state, const Input& begin, const Input& end, double time_s,
                    double h, const RigNumbers<T>& n, int halvings) const;
  /// Changes `factors` by those of all terms at that slip velocity.
  template <class T>
  void scale_friction(FrictionFactors<T>& factors, const RigState<T>& state, const T& slip,
                      const Input& now, double time_s, const RigNumbers<T>& n) const;
  /// Turns the explicit prediction of a stage into the stage itself: the contact acts for `alpha`
  /// seconds with the force at the end of them.
  template <class T>
  void close_contact(RigState<T>& state, double alpha, const Input& now, double time_s,
                     const RigNumbers<T>& n) const;

  Model model_;
  Structure structure_;
  std::vector<BoundTerm> terms_;
  std::vector<double> values_;
  std::vector<std::string> paths_;
  int state_count_ = state::first_effect;
  unsigned hooks_ = 0;  ///< of all terms together
  int own_state_ = -1;  ///< first of the contact's states beside state::contact; -1: none
  bool friction_depends_on_slip_ = false;
  bool terms_have_rates_ = false;  ///< true if a term adds a force or has states of its own
  bool set_valued_ = false;
  double longest_step_s_ = 1.0e-3;
};

}  // namespace stickslip::physics
