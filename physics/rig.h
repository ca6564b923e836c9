// The equations of a rig, built from its Model, and the one integrator that everything uses: the
// simulated rig, the observer's predictions and the fits of a diagnosis.
//
// Integrator: the additive Runge-Kutta scheme ARS(2,2,2) of Ascher, Ruuth and Spiteri (1997). The
// contact (friction force, its state theta or bristle) is implicit, everything else explicit. The
// implicit part is L-stable and the last stage is the result, so the set-valued Coulomb law sticks
// exactly, large gamma costs nothing, and smooth motion is integrated to second order.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "physics/effects/effect.h"
#include "physics/input.h"
#include "physics/model.h"

namespace stickslip::physics {

inline constexpr int max_terms = 6;
inline constexpr int max_rig_states = 5 + 2 * max_effect_states;

/// Where the states stand in RigState::s; states of effects follow from `first_effect` on.
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
  T friction{0.0};  ///< friction force at this instant [N]
  T theta{0.0};     ///< friction over mu N
  T slip{0.0};      ///< velocity across the contact [m/s]
  T load{1.0};      ///< normal load [N]
  /// What drives the rig beside what the input says: acceleration of the frame [m/s^2], or the
  /// drive force [N] of a force-excited rig; set by whoever doubts the input.
  T unrecorded{0.0};
};

/// What the sensors are connected to, before their chains.
template <class T>
struct Quantities {
  T displacement{0.0};
  T velocity{0.0};
  T friction_reading{0.0};  ///< k_l y, or f where no load cell is declared
  T normal_load{0.0};
};

/// The numbers of a rig, ready for stepping; made by Rig::numbers.
template <class T>
struct RigNumbers {
  Coefficients<T> c;
  T inverse_mass{1.0};
  T inverse_cell_mass{0.0};
  std::array<std::array<T, max_effect_parameters>, max_terms> term{};
  ReadingLaws<T> reading;
  /// What acts on the rig over what the inputs say; other than 1 where they are a recording's and
  /// their channel is read with a wrong gain.
  T input_share{1.0};
  /// By how much earlier the inputs acted than they say: their channel is late [s].
  T input_lead_s{0.0};
};

/// A term of the model, resolved once when the rig is made.
struct BoundTerm {
  const Effect* effect = nullptr;
  unsigned hooks = 0;  ///< effect->hooks()
  Place place;
  int first_state = 0;  ///< index into RigState::s of the first of the effect's own states
  /// By position on the effect's card: the index into parameter_values(), -1 where the model leaves
  /// the parameter out, and the value that holds in that case.
  std::array<int, max_effect_parameters> parameter{};
  std::array<double, max_effect_parameters> fallback{};
};

/// The structure of a rig. Immutable; all state is in RigState.
class Rig {
 public:
  /// Throws std::invalid_argument where inconsistencies_of(model) is not empty, or where the model
  /// has more terms than max_terms.
  explicit Rig(const Model& model);

  /// The model's parameters in the order of parameters_of(model).
  const std::vector<double>& parameter_values() const { return values_; }
  const std::vector<std::string>& parameter_paths() const { return paths_; }

  const Structure& structure() const { return structure_; }

  /// The terms of the model, in its order.
  std::span<const BoundTerm> terms() const { return terms_; }

  /// Whether the state at that index takes part in this rig's motion.
  bool has_state(int index) const;
  int state_count() const { return state_count_; }

  /// The numbers of the equations for these parameter values (order of parameters_of).
  template <class T>
  RigNumbers<T> numbers(std::span<const T> parameters) const;

  /// Completes a state whose s is given: load, slip, and friction and theta as they follow from s.
  /// A set-valued law at rest gets its holding force with the first step, and 0 here.
  template <class T>
  void complete(RigState<T>& state, const Input& now, double time_s, const RigNumbers<T>& n) const;

  /// One step of `h` seconds from `time_s`, while the input goes linearly from `begin` to `end`.
  template <class T>
  void step(RigState<T>& state, const Input& begin, const Input& end, double time_s, double h,
            const RigNumbers<T>& n) const;

  template <class T>
  Quantities<T> quantities(const RigState<T>& state, const Input& now,
                           const RigNumbers<T>& n) const;

  /// The normal load of a state; measured ones are the input's.
  template <class T>
  T normal_load(const RigState<T>& state, const Input& now, double time_s,
                const RigNumbers<T>& n) const;

  /// The longest step that resolves the fastest free oscillation and rate of the explicit part.
  double longest_step_s() const { return longest_step_s_; }

 private:
  template <class T>
  struct Rates;
  template <class T>
  T frame_acceleration(const RigState<T>& state, const Input& now, const RigNumbers<T>& n) const;
  template <class T>
  void explicit_rates(std::array<T, max_rig_states>& rate, const RigState<T>& state,
                      const Input& now, double time_s, const RigNumbers<T>& n) const;
  template <class T>
  void close_contact(RigState<T>& state, double alpha, const Input& now, double time_s,
                     const RigNumbers<T>& n) const;

  Model model_;
  Structure structure_;
  std::vector<BoundTerm> terms_;
  std::vector<double> values_;
  std::vector<std::string> paths_;
  int state_count_ = state::first_effect;
  unsigned hooks_ = 0;   ///< of all terms together
  int slow_state_ = -1;  ///< of two relaxation processes the slower one's theta
  bool friction_depends_on_slip_ = false;
  bool terms_have_rates_ = false;  ///< whether one adds a force or has states of its own
  bool set_valued_ = false;
  double longest_step_s_ = 1.0e-3;
};

}  // namespace stickslip::physics
