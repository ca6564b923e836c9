// SPDX-License-Identifier: Apache-2.0
// physics::Model, the content of model.toml: integrated by the simulated rig, assumed by the
// observer and extended by a diagnosis. Symbols and signs are those of docs/physics.md:
//
//   m x'' + c x' + k x + f = -m b''            base-excited rig
//   m x'' + c x' + k x + f = F                 force-excited rig
//   m_l y'' + c_l y' + k_l y - f = -m_l b''    load cell; the force channel reads k_l y
//   f = mu N theta                             friction law
//
// with x the deflection of the mass in the moving frame, b the frame, y the load cell.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"

namespace stickslip::physics {

/// A number with its standard deviation. sigma 0: known exactly. sigma > 0: a Gaussian prior, which
/// a diagnosis calibrates on the recording.
struct Parameter {
  double value = 0.0;
  double sigma = 0.0;

  friend bool operator==(const Parameter&, const Parameter&) = default;
};

enum class Excitation {
  base,     ///< the frame moves by b(t)
  force,    ///< a force F(t) acts on the mass
  imposed,  ///< x(t) is the recorded motion itself: no force balance, only the friction law
};

/// Magnets of the two-well rig: restoring force -linear x + cubic x^3 in place of k x.
struct TwoWell {
  Parameter linear_n_m;
  Parameter cubic_n_m3;

  friend bool operator==(const TwoWell&, const TwoWell&) = default;
};

/// The mass on its spring. Exactly one of natural_frequency_hz and stiffness_n_m, and exactly one
/// of damping_ratio and damping_n_s_m, is present; with imposed motion none of them is.
struct Oscillator {
  Excitation excitation = Excitation::base;
  Parameter mass_kg;
  std::optional<Parameter> natural_frequency_hz;
  std::optional<Parameter> stiffness_n_m;
  std::optional<Parameter> damping_ratio;
  std::optional<Parameter> damping_n_s_m;
  std::optional<TwoWell> two_well;

  friend bool operator==(const Oscillator&, const Oscillator&) = default;
};

enum class NormalLoadLaw {
  constant,  ///< N = load_n
  wedge,     ///< N = max(0, load_n (1 + slope_per_m x)): skewed plates, unilateral contact
  measured,  ///< N = the recorded channel
};

struct NormalLoad {
  NormalLoadLaw law = NormalLoadLaw::constant;
  Parameter load_n;       ///< constant and wedge
  Parameter slope_per_m;  ///< wedge

  friend bool operator==(const NormalLoad&, const NormalLoad&) = default;
};

enum class FrictionLaw {
  none,
  coulomb,         ///< theta = g(v)
  state_variable,  ///< theta' = -rate (theta - g(v)), Eqs. (4) and (6) of the paper
};

/// g(v) = tanh(v / transition_speed_m_s); transition_speed_m_s = 0 is the set-valued Coulomb law,
/// sign(v) with any value in [-1, 1] at v = 0.
struct Friction {
  FrictionLaw law = FrictionLaw::none;
  Parameter mu;  ///< coefficient; in newtons where no normal load is declared (N = 1)
  Parameter transition_speed_m_s;
  Parameter rate_per_s;  ///< gamma, state_variable only

  friend bool operator==(const Friction&, const Friction&) = default;
};

enum class LoadCellDynamics {
  quasi_static,  ///< Eq. (1) taken as exact: k_l y = f - m_l b'', slip velocity x'
  resonant,      ///< the load cell's whole equation, slip velocity x' - y'
};

struct LoadCell {
  Parameter mass_kg;
  Parameter natural_frequency_hz;
  Parameter damping_ratio;
  LoadCellDynamics dynamics = LoadCellDynamics::resonant;

  friend bool operator==(const LoadCell&, const LoadCell&) = default;
};

/// The bridge of the normal load: the gauges of both pads, N1 = c1 v1 and N2 = c2 v2, form one
/// Wheatstone bridge, which measures v1 + v2 only, with (c1 + c2) / 2 assumed for both (section 4
/// of the paper). The reading is N times share / (1 + mismatch) + (1 - share) / (1 - mismatch),
/// where `share` is that of the first pad at the current displacement.
struct NormalLoadBridge {
  double mismatch = 0.0;           ///< (c1 - c2) / (c1 + c2)
  double share = 0.5;              ///< of N on the first pad at x = 0
  double share_slope_per_m = 0.0;  ///< its change with x; the share stays within 0 to 1

  friend bool operator==(const NormalLoadBridge&, const NormalLoadBridge&) = default;
};

enum class FilterKind { butterworth_lowpass, first_order_lowpass };

/// One analogue filter between a quantity and its reading.
struct Filter {
  FilterKind kind = FilterKind::butterworth_lowpass;
  int order = 4;  ///< 1 to 8; 1 for first_order_lowpass
  Parameter cutoff_hz{25.0};

  friend bool operator==(const Filter&, const Filter&) = default;
};

/// A channel's chain. The velocity chain continues the displacement chain.
struct Sensor {
  std::optional<double> noise_std;  ///< in the channel's unit; absent: unknown
  std::vector<Filter> filters;      ///< in the order of the signal
  // reading = gain (quantity, filtered, delay_s ago) + offset + noise. Absent: not declared, so
  // that a diagnosis allows for what a careful laboratory leaves; 1, 0 and 0 everywhere else.
  std::optional<Parameter> gain;
  std::optional<Parameter> offset;   ///< in the channel's unit
  std::optional<Parameter> delay_s;  ///< beyond the filters
  /// Of the noise; 0: white; absent: not declared.
  std::optional<double> noise_correlation_s;

  friend bool operator==(const Sensor&, const Sensor&) = default;
};

class FormulaEffect;

/// One [[physics]] term: an effect of the catalogue (physics/effects/), or a formula of the model
/// file, with its parameters by name, e.g. {"k3_n_m3", {1e4, 0}}. Or a law of friction by name.
struct Term {
  std::string id;
  std::optional<Channel> channel;  ///< sensor effects: the channel with the error
  std::map<std::string, Parameter> parameters;
  std::optional<Channel> from = {};  ///< crosstalk: the source channel
  /// The effect, where a formula of the model file is one; shared by copies of the model.
  std::shared_ptr<const FormulaEffect> formula = {};
  /// The law of [friction] by that name (physics/friction_laws.h) in place of those of
  /// Friction::law, which is then `none`; the first of the terms where a model declares it.
  bool law = false;

  /// Formulas are equal if they are declared alike.
  friend bool operator==(const Term& a, const Term& b);
};

struct Model {
  Oscillator oscillator;
  std::optional<NormalLoad> normal_load;  ///< absent: N = 1 N
  Friction friction;
  std::optional<LoadCell> load_cell;                   ///< absent: rigid attachment
  std::optional<NormalLoadBridge> normal_load_bridge;  ///< absent: the reading is N
  std::array<Sensor, channel_count> sensors;
  std::vector<Term> terms;
  /// Formulas that a diagnosis tries beside the catalogue; no part of the equations. Values: where
  /// an estimate begins, sigma: its prior, 0: none.
  std::vector<Term> candidates;
  /// True if every unit is 1: texts and pictures then name none.
  bool dimensionless = false;

  friend bool operator==(const Model&, const Model&) = default;
};

/// A parameter of a model by its path in the model file, e.g. "oscillator.mass_kg",
/// "physics.cubic_stiffness.k3_n_m3" or, for an effect on one channel,
/// "physics.gain_error.velocity.gain".
struct NamedParameter {
  std::string path;
  Parameter* parameter;
};

/// "physics.cubic_stiffness", "physics.gain_error.velocity"; of a law by name "friction"
std::string path_of(const Term& term);

/// "sensors.velocity.", with which the paths of that channel's instrument begin
std::string instrument_path(Channel channel);

enum class InstrumentQuantity { gain, offset, delay };

struct InstrumentParameter {
  Channel channel = Channel::displacement;
  InstrumentQuantity quantity = InstrumentQuantity::gain;
};

/// The gain, offset or delay that a path names, if it does.
std::optional<InstrumentParameter> instrument_parameter(std::string_view path);

/// Every parameter of the model: first the declared ones, then those of each term by name. The
/// pointers lead into `model` and are valid while it is neither moved nor changed in structure.
std::vector<NamedParameter> parameters_of(Model& model);

/// Number of declared parameters: the index of the first term's first parameter.
std::size_t declared_parameter_count(const Model& model);

}  // namespace stickslip::physics
