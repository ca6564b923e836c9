// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

constexpr int portrait_points = 241;

// False for a constant curve, which a single number describes.
bool varies(const Curve& curve) {
  if (curve.value.empty()) return false;
  const auto [least, most] = std::minmax_element(curve.value.begin(), curve.value.end());
  const double size = std::max(std::abs(*least), std::abs(*most));
  return std::isfinite(size) && *most - *least > 1.0e-3 * size;
}

struct Variable {
  const char* name;
  const char* unit;
  double low;
  double high;
};

// The operating point in the middle of the recording, in motion, at which one variable has the
// value `at`.
physics::OperatingPoint<double> point_at(std::string_view variable, double at,
                                         const Experiment& experiment) {
  physics::OperatingPoint<double> point;
  point.load = std::max(experiment.mean_load_n, 1.0e-12);
  point.time_s = 0.5 * experiment.duration_s();
  point.slip = point.v = variable == "velocity" ? at : 0.3 * experiment.largest.velocity_m_s;
  if (variable == "displacement") point.x = at;
  if (variable == "normal_load") point.load = at;
  if (variable == "time") point.time_s = at;
  return point;
}

// The terms of an effect without states (force, friction factor, load) over each variable.
std::vector<Curve> laws_over(std::span<const Variable> variables, const physics::Effect& effect,
                             std::span<const double> parameters, const Experiment& experiment,
                             int points) {
  const unsigned hooks = effect.hooks();
  std::vector<Curve> curves;
  const auto add = [&](const char* quantity, const char* unit, auto&& value_at) {
    for (const Variable& variable : variables) {
      if (!(variable.high > variable.low)) continue;
      Curve curve{variable.name, variable.unit, quantity, unit, {}, {}};
      for (int k = 0; k < points; ++k) {
        const double at = variable.low + (variable.high - variable.low) * k / (points - 1.0);
        curve.at.push_back(at);
        curve.value.push_back(value_at(point_at(variable.name, at, experiment)));
      }
      curves.push_back(std::move(curve));
    }
  };
  const std::vector<double> states(physics::max_effect_states, 0.0);
  if ((hooks & physics::hook::force) != 0) {
    add("force against +x", "N", [&](const physics::OperatingPoint<double>& at) {
      return effect.force(at, parameters.data(), states.data());
    });
  }
  if ((hooks & physics::hook::friction) != 0) {
    add("factor on the friction law", "1", [&](const physics::OperatingPoint<double>& at) {
      physics::FrictionFactors<double> factors;
      effect.scale_friction(factors, at, parameters.data(), states.data());
      return factors.mu * factors.backbone;
    });
  }
  if ((hooks & physics::hook::load) != 0) {
    add("normal load", "N", [&](const physics::OperatingPoint<double>& at) {
      double n = at.load;
      effect.scale_load(n, at, parameters.data(), states.data());
      return n;
    });
  }
  return curves;
}

std::array<Variable, 4> ranges_of(const Experiment& experiment) {
  const double x = experiment.largest.displacement_m;
  const double v = experiment.largest.velocity_m_s;
  const double load = std::max(experiment.mean_load_n, 1.0e-12);
  const double spread = experiment.channel_std[index_of(Channel::normal_load)];
  const double last_s = experiment.duration_s();
  return {{{"displacement", "m", -x, x},
           {"velocity", "m/s", -v, v},
           {"normal_load", "N", std::max(0.0, load - 2.0 * spread), load + 2.0 * spread},
           {"time", "s", 0.0, last_s}}};
}

template <class Value>
Curve sampled(const Variable& variable, const char* quantity, const char* unit, Value&& value_at) {
  Curve curve{variable.name, variable.unit, quantity, unit, {}, {}};
  for (int k = 0; k < portrait_points; ++k) {
    const double at = variable.low + (variable.high - variable.low) * k / (portrait_points - 1.0);
    curve.at.push_back(at);
    curve.value.push_back(value_at(at));
  }
  return curve;
}

double reach_of(const Experiment& experiment, Channel channel) {
  const std::size_t c = index_of(channel);
  double reach = 0.0;
  if (c < predicted_channels) {
    for (const auto& reading : experiment.reading) reach = std::max(reach, std::abs(reading[c]));
  }
  return std::max({reach, 2.0 * experiment.channel_std[c], 1.0e-12});
}

// The errors of a sensor: characteristic, drift, hum and crosstalk of its channel.
std::vector<Curve> sensor_errors_of(const physics::Effect& effect, const physics::Place& place,
                                    std::span<const double> parameters,
                                    const Experiment& experiment) {
  if (!place.channel) return {};
  physics::ReadingLaws<double> laws;
  effect.set_reading_law(laws, place, parameters.data());
  const physics::ReadingLaw<double>& law = laws.of[index_of(*place.channel)];
  const ChannelInfo& name = info(*place.channel);
  const double reach = reach_of(experiment, *place.channel);
  const double last_s = experiment.duration_s();
  std::vector<Curve> curves;
  // Names of channels are null-terminated constants.
  const Variable truth{name.stem.data(), name.unit.data(), -1.2 * reach, 1.2 * reach};
  curves.push_back(sampled(truth, "reading", name.unit.data(), [&](double at) {
    const double gained = law.gain * at;
    double reading = gained * (1.0 + law.curvature * gained);
    if (law.characteristic != nullptr) {
      law.characteristic->distort(reading, law.characteristic_parameters.data());
    }
    return law.limit > 0.0 ? std::clamp(reading, -law.limit, law.limit) : reading;
  }));
  if (law.gain == 1.0 && law.curvature == 0.0 && law.limit == 0.0 &&
      law.characteristic == nullptr) {
    curves.clear();
  }
  if (law.drift_per_s != 0.0) {
    curves.push_back(sampled({"time", "s", 0.0, last_s}, "zero of the channel", name.unit.data(),
                             [&](double at) {
                               return -law.drift_per_s * law.drift_time_constant_s *
                                      std::expm1(-at / law.drift_time_constant_s);
                             }));
  }
  if (law.hum_amplitude != 0.0 && law.hum_frequency_hz > 0.0) {
    curves.push_back(
        sampled({"time", "s", 0.0, 0.06}, "hum in the channel", name.unit.data(), [&](double at) {
          return law.hum_amplitude *
                 std::sin(2.0 * pi * law.hum_frequency_hz * at + law.hum_phase_rad);
        }));
  }
  if (law.crosstalk != 0.0 && law.crosstalk_from) {
    const ChannelInfo& other = info(*law.crosstalk_from);
    const double far = reach_of(experiment, *law.crosstalk_from);
    curves.push_back(sampled({other.stem.data(), other.unit.data(), -far, far},
                             "share of the reading", name.unit.data(),
                             [&](double at) { return law.crosstalk * at; }));
  }
  return curves;
}

// The last of a few slow cycles through the range of the recording, for effects with states.
std::vector<Curve> loops_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment) {
  constexpr int cycles = 4;
  constexpr int steps = 4000;
  const double x = experiment.largest.displacement_m;
  const double omega = experiment.largest.velocity_m_s / std::max(x, 1.0e-12);
  const bool is_force = (effect.hooks() & physics::hook::force) != 0;
  const bool is_friction = (effect.hooks() & physics::hook::friction) != 0;
  if (!(omega > 0.0) || !(x > 0.0) || is_force == is_friction) return {};
  std::array<double, physics::max_effect_states> states{};
  std::array<double, physics::max_effect_states> rate{};
  const double h = 2.0 * pi / omega / steps;
  Curve curve{is_force ? "displacement" : "velocity",
              is_force ? "m" : "m/s",
              is_force ? "force against +x" : "factor on the friction law",
              is_force ? "N" : "1",
              {},
              {}};
  for (int k = 0; k < cycles * steps; ++k) {
    physics::OperatingPoint<double> at;
    at.time_s = h * k;
    at.x = x * std::sin(omega * at.time_s);
    at.slip = at.v = x * omega * std::cos(omega * at.time_s);
    at.load = std::max(experiment.mean_load_n, 1.0e-12);
    if (k >= (cycles - 1) * steps && k % (steps / portrait_points) == 0) {
      curve.at.push_back(is_force ? at.x : at.v);
      physics::FrictionFactors<double> factors;
      if (is_friction) effect.scale_friction(factors, at, parameters.data(), states.data());
      curve.value.push_back(is_force ? effect.force(at, parameters.data(), states.data())
                                     : factors.mu * factors.backbone);
    }
    effect.rates(rate.data(), at, parameters.data(), states.data());
    for (std::size_t i = 0; i < states.size(); ++i) states[i] += h * rate[i];
    effect.confine(states.data(), parameters.data());
  }
  curve.at.push_back(curve.at.front());
  curve.value.push_back(curve.value.front());
  return {curve};
}

// The curves of an effect that replaces a law.
std::vector<Curve> replaced_laws_of(const physics::Effect& effect,
                                    std::span<const double> parameters,
                                    std::span<const double> reference, double friction_n) {
  std::vector<Curve> curves;
  for (const physics::LawCurve& law : effect.law_curves(parameters, reference, friction_n)) {
    const Variable variable{law.variable.data(), law.variable_unit.data(), law.low, law.high};
    curves.push_back(sampled(variable, law.quantity.data(), law.unit.data(), law.value));
  }
  return curves;
}

}  // namespace

std::vector<Curve> shape_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment) {
  constexpr int points = 81;
  if (effect.state_count() > 0) return {};
  auto curves = laws_over(ranges_of(experiment), effect, parameters, experiment, points);
  std::erase_if(curves, [](const Curve& curve) { return !varies(curve); });
  return curves;
}

std::vector<Curve> portrait_of(const physics::Effect& effect, const physics::Place& place,
                               std::span<const double> parameters,
                               std::span<const double> reference, const Experiment& experiment,
                               double friction_n) {
  std::vector<Curve> curves = replaced_laws_of(effect, parameters, reference, friction_n);
  if (!curves.empty()) return curves;
  if ((effect.hooks() & physics::hook::reading) != 0) {
    curves = sensor_errors_of(effect, place, parameters, experiment);
  } else if (effect.state_count() > 0) {
    curves = loops_of(effect, parameters, experiment);
  } else {
    auto ranges = ranges_of(experiment);
    // Over three periods of an oscillation.
    const auto& frequency = effect.card().frequency;
    const double own_hz = frequency ? reference[frequency->parameter] : 0.0;
    if (own_hz > 0.0) ranges.back().high = std::min(ranges.back().high, 3.0 / own_hz);
    curves = laws_over(ranges, effect, parameters, experiment, portrait_points);
    // N over N shows nothing.
    std::erase_if(curves, [](const Curve& curve) {
      return curve.variable == "normal_load" && curve.quantity == "normal load";
    });
  }
  std::erase_if(curves, [](const Curve& curve) { return !varies(curve); });
  return curves;
}

namespace {

// Half widths of the 95 % intervals: slope of each point times the covariance of the unknowns.
void add_band(Curve& curve, const Eigen::MatrixXd& slope, const Eigen::MatrixXd& correlation) {
  for (std::size_t k = 0; k < curve.at.size(); ++k) {
    const Eigen::RowVectorXd row = slope.row(static_cast<Eigen::Index>(k));
    const double half = 1.96 * std::sqrt(std::max(0.0, (row * correlation).dot(row)));
    curve.low.push_back(curve.value[k] - half);
    curve.high.push_back(curve.value[k] + half);
  }
}

}  // namespace

void add_bands(std::vector<Curve>& curves, const Eigen::MatrixXd& correlation,
               const std::function<std::vector<Curve>(Eigen::Index, double)>& changed) {
  const Eigen::Index unknowns = correlation.rows();
  if (unknowns == 0) return;
  // Change of each curve for one standard deviation of each unknown.
  std::vector<Eigen::MatrixXd> slope;
  for (const Curve& curve : curves) {
    slope.push_back(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(curve.at.size()), unknowns));
  }
  for (Eigen::Index u = 0; u < unknowns; ++u) {
    const std::vector<Curve> up = changed(u, 1.0);
    const std::vector<Curve> down = changed(u, -1.0);
    for (std::size_t i = 0; i < curves.size(); ++i) {
      const auto same = [&](const Curve& other) {
        return other.variable == curves[i].variable && other.quantity == curves[i].quantity &&
               other.at.size() == curves[i].at.size();
      };
      const auto high = std::find_if(up.begin(), up.end(), same);
      const auto low = std::find_if(down.begin(), down.end(), same);
      if (high == up.end() || low == down.end()) continue;
      for (std::size_t k = 0; k < curves[i].at.size(); ++k) {
        slope[i](static_cast<Eigen::Index>(k), u) = 0.5 * (high->value[k] - low->value[k]);
      }
    }
  }
  for (std::size_t i = 0; i < curves.size(); ++i) add_band(curves[i], slope[i], correlation);
}

}  // namespace stickslip::diagnosis
