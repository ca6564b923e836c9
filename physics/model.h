// physics::Model is what model.toml says, what the simulated rig integrates, what the observer
// believes and what a diagnosis mends. Symbols and signs are those of the project's contract:
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
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"

namespace stickslip::physics {

/// A number and how well it is known. sigma 0: known exactly. sigma > 0: a Gaussian prior with that
/// standard deviation, to be calibrated on a recording before anything is called missing.
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

/// How the normal load is read: the gauges of both pads, N1 = c1 v1 and N2 = c2 v2, sit in one
/// Wheatstone bridge, so that only v1 + v2 is seen and (c1 + c2) / 2 is taken for both (section 4
/// of the paper). The reading is N times share / (1 + mismatch) + (1 - share) / (1 - mismatch),
/// where the share is that of the first pad at the present displacement.
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
  double cutoff_hz = 25.0;

  friend bool operator==(const Filter&, const Filter&) = default;
};

/// A channel's chain. The velocity chain starts where the displacement chain ends.
struct Sensor {
  std::optional<double> noise_std;  ///< in the channel's unit; absent: unknown
  std::vector<Filter> filters;      ///< in the order of the signal

  friend bool operator==(const Sensor&, const Sensor&) = default;
};

/// One term that a diagnosis added: an effect of the catalogue (physics/effects/) with its
/// parameters by their contract names, e.g. {"k3_n_m3", {1e4, 0}}.
struct Term {
  std::string id;
  std::optional<Channel> channel;  ///< sensor effects: the channel that is read wrongly
  std::map<std::string, Parameter> parameters;
  std::optional<Channel> from = {};  ///< crosstalk: the channel that leaks into it

  friend bool operator==(const Term&, const Term&) = default;
};

struct Model {
  Oscillator oscillator;
  std::optional<NormalLoad> normal_load;  ///< absent: N = 1 N
  Friction friction;
  std::optional<LoadCell> load_cell;                   ///< absent: rigid attachment
  std::optional<NormalLoadBridge> normal_load_bridge;  ///< absent: the reading is N
  std::array<Sensor, channel_count> sensors;
  std::vector<Term> terms;

  friend bool operator==(const Model&, const Model&) = default;
};

/// A parameter of a model by its path in the model file, e.g. "oscillator.mass_kg",
/// "physics.cubic_stiffness.k3_n_m3" or, for an effect on one channel,
/// "physics.gain_error.velocity.gain".
struct NamedParameter {
  std::string path;
  Parameter* parameter;
};

/// "physics.cubic_stiffness", "physics.gain_error.velocity"
std::string path_of(const Term& term);

/// Every parameter that this model has, in the order of the model file; the pointers lead into
/// `model` and are valid while it is neither moved nor changed in structure.
std::vector<NamedParameter> parameters_of(Model& model);

/// Where a model contradicts itself or the catalogue, in words; empty when it is sound. Each entry
/// names the path in the model file that it is about (which may be a table, or a key that is
/// missing), so that a loader can add line and column.
struct Inconsistency {
  std::string path;
  std::string message;
};
std::vector<Inconsistency> inconsistencies_of(const Model& model);

}  // namespace stickslip::physics
