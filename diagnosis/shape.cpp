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

// Whether a curve says more than one number would.
bool bends(const Curve& curve) {
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

// What an effect without states does to forces, friction and load, over each variable.
std::vector<Curve> laws_over(std::span<const Variable> variables, const physics::Effect& effect,
                             std::span<const double> parameters, const Experiment& experiment,
                             int points) {
  const unsigned hooks = effect.hooks();
  const double v = experiment.largest.velocity_m_s;
  const double load = std::max(experiment.mean_load_n, 1.0e-12);
  const double last_s = experiment.period_s * static_cast<double>(experiment.samples);
  std::vector<Curve> curves;
  const auto add = [&](const char* quantity, const char* unit, auto&& value_at) {
    for (const Variable& variable : variables) {
      if (!(variable.high > variable.low)) continue;
      const std::string_view name = variable.name;
      Curve curve{variable.name, variable.unit, quantity, unit, {}, {}};
      for (int k = 0; k < points; ++k) {
        const double at = variable.low + (variable.high - variable.low) * k / (points - 1.0);
        physics::Instant<double> instant;
        instant.load = load;
        // In the middle of a recording, moving: where an effect that needs motion shows itself.
        instant.time_s = 0.5 * last_s;
        instant.slip = instant.v = name == "velocity" ? at : 0.3 * v;
        if (name == "displacement") instant.x = at;
        if (name == "normal_load") instant.load = at;
        if (name == "time") instant.time_s = at;
        curve.at.push_back(at);
        curve.value.push_back(value_at(instant));
      }
      curves.push_back(std::move(curve));
    }
  };
  const std::vector<double> states(physics::max_effect_states, 0.0);
  if ((hooks & physics::hook::force) != 0) {
    add("force against +x", "N", [&](const physics::Instant<double>& at) {
      return effect.force(at, parameters.data(), states.data());
    });
  }
  if ((hooks & physics::hook::friction) != 0) {
    add("factor on the friction law", "1", [&](const physics::Instant<double>& at) {
      physics::FrictionFactors<double> factors;
      effect.scale_friction(factors, at, parameters.data(), states.data());
      return factors.mu * factors.backbone;
    });
  }
  if ((hooks & physics::hook::load) != 0) {
    add("normal load", "N", [&](const physics::Instant<double>& at) {
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
  const double last_s = experiment.period_s * static_cast<double>(experiment.samples);
  return {{{"displacement", "m", -x, x},
           {"velocity", "m/s", -v, v},
           {"normal_load", "N", std::max(0.0, load - 2.0 * spread), load + 2.0 * spread},
           {"time", "s", 0.0, last_s}}};
}

// A parameter by its name, if the effect has one.
std::optional<double> named(const physics::Effect& effect, std::span<const double> parameters,
                            std::string_view name) {
  const auto& cards = effect.card().parameters;
  for (std::size_t i = 0; i < cards.size(); ++i) {
    if (cards[i].name == name) return parameters[i];
  }
  return std::nullopt;
}

template <class Value>
Curve drawn(const Variable& variable, const char* quantity, const char* unit, Value&& value_at) {
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

// How the reading of a channel departs from the truth.
std::vector<Curve> misreadings_of(const physics::Effect& effect, const physics::Place& place,
                                  std::span<const double> parameters,
                                  const Experiment& experiment) {
  if (!place.channel) return {};
  physics::ReadingLaws<double> laws;
  effect.misread(laws, place, parameters.data());
  const physics::ReadingLaw<double>& law = laws.of[index_of(*place.channel)];
  const ChannelInfo& name = info(*place.channel);
  const double reach = reach_of(experiment, *place.channel);
  const double last_s = experiment.period_s * static_cast<double>(experiment.samples);
  std::vector<Curve> curves;
  // Names of channels are constants that end with a zero.
  const Variable truth{name.stem.data(), name.unit.data(), -1.2 * reach, 1.2 * reach};
  curves.push_back(drawn(truth, "reading", name.unit.data(), [&](double at) {
    const double gained = law.gain * at;
    const double bent = gained * (1.0 + law.curvature * gained);
    return law.limit > 0.0 ? std::clamp(bent, -law.limit, law.limit) : bent;
  }));
  if (law.gain == 1.0 && law.curvature == 0.0 && law.limit == 0.0) curves.clear();
  if (law.drift_per_s != 0.0) {
    curves.push_back(
        drawn({"time", "s", 0.0, last_s}, "zero of the channel", name.unit.data(), [&](double at) {
          return -law.drift_per_s * law.drift_settles_s * std::expm1(-at / law.drift_settles_s);
        }));
  }
  if (law.hum_amplitude != 0.0 && law.hum_frequency_hz > 0.0) {
    curves.push_back(drawn(
        {"time", "s", 0.0, 0.06}, "what hums in the channel", name.unit.data(), [&](double at) {
          return law.hum_amplitude *
                 std::sin(2.0 * pi * law.hum_frequency_hz * at + law.hum_phase_rad);
        }));
  }
  if (law.leak != 0.0 && law.leak_from) {
    const ChannelInfo& other = info(*law.leak_from);
    const double far = reach_of(experiment, *law.leak_from);
    curves.push_back(drawn({other.stem.data(), other.unit.data(), -far, far}, "what leaks in",
                           name.unit.data(), [&](double at) { return law.leak * at; }));
  }
  return curves;
}

// The last of a few slow cycles through the range of the recording, for effects that remember.
std::vector<Curve> loops_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment) {
  constexpr int cycles = 4;
  constexpr int steps = 4000;
  const double x = experiment.largest.displacement_m;
  const double omega = experiment.largest.velocity_m_s / std::max(x, 1.0e-12);
  const bool pushes = (effect.hooks() & physics::hook::force) != 0;
  const bool rubs = (effect.hooks() & physics::hook::friction) != 0;
  if (!(omega > 0.0) || !(x > 0.0) || pushes == rubs) return {};
  std::array<double, physics::max_effect_states> states{};
  std::array<double, physics::max_effect_states> rate{};
  const double h = 2.0 * pi / omega / steps;
  Curve curve{pushes ? "displacement" : "velocity",
              pushes ? "m" : "m/s",
              pushes ? "force against +x" : "factor on the friction law",
              pushes ? "N" : "1",
              {},
              {}};
  for (int k = 0; k < cycles * steps; ++k) {
    physics::Instant<double> at;
    at.time_s = h * k;
    at.x = x * std::sin(omega * at.time_s);
    at.slip = at.v = x * omega * std::cos(omega * at.time_s);
    at.load = std::max(experiment.mean_load_n, 1.0e-12);
    if (k >= (cycles - 1) * steps && k % (steps / portrait_points) == 0) {
      curve.at.push_back(pushes ? at.x : at.v);
      physics::FrictionFactors<double> factors;
      if (rubs) effect.scale_friction(factors, at, parameters.data(), states.data());
      curve.value.push_back(pushes ? effect.force(at, parameters.data(), states.data())
                                   : factors.mu * factors.backbone);
    }
    effect.rates(rate.data(), at, parameters.data(), states.data());
    for (std::size_t i = 0; i < states.size(); ++i) states[i] += h * rate[i];
    effect.confine(states.data(), parameters.data());
  }
  return {curve};
}

// Laws that replace another one, each in the way in which people draw it.
std::vector<Curve> replaced_laws_of(const physics::Effect& effect,
                                    std::span<const double> parameters,
                                    std::span<const double> like, double friction_n) {
  const std::string_view id = effect.card().id;
  std::vector<Curve> curves;
  if (id == "friction_memory") {
    const double rate = *named(effect, parameters, "gamma_per_s");
    const double spread = named(effect, parameters, "spread").value_or(0.0);
    const Variable time{"time after a reversal", "s", 0.0,
                        5.0 / *named(effect, like, "gamma_per_s")};
    curves.push_back(drawn(time, "friction over mu N", "1", [&](double at) {
      return 1.0 - (1.0 + spread) * std::exp(-(1.0 + spread) * rate * at) -
             (1.0 - spread) * std::exp(-(1.0 - spread) * rate * at);
    }));
  } else if (id == "contact_compliance" && friction_n > 0.0) {
    const double stiffness = *named(effect, parameters, "contact_stiffness_n_m");
    const double far = 2.5 * friction_n / *named(effect, like, "contact_stiffness_n_m");
    curves.push_back(
        drawn({"deflection of the contact", "m", -far, far}, "friction force", "N",
              [&](double at) { return std::clamp(stiffness * at, -friction_n, friction_n); }));
  } else if (id == "load_cell_resonance") {
    const double own_hz = *named(effect, parameters, "frequency_hz");
    const double damping = *named(effect, parameters, "damping_ratio");
    const Variable hz{"frequency", "Hz", 0.0, 2.5 * *named(effect, like, "frequency_hz")};
    curves.push_back(drawn(hz, "reading over force", "1", [&](double at) {
      const double r = at / own_hz;
      return 1.0 / std::hypot(1.0 - r * r, 2.0 * damping * r);
    }));
  } else if (id == "differentiator_lag") {
    const double cutoff_hz = *named(effect, parameters, "cutoff_hz");
    const Variable hz{"frequency", "Hz", 0.0, 4.0 * *named(effect, like, "cutoff_hz")};
    curves.push_back(drawn(hz, "velocity reading over velocity", "1",
                           [&](double at) { return 1.0 / std::hypot(1.0, at / cutoff_hz); }));
  }
  return curves;
}

}  // namespace

std::vector<Curve> shape_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment) {
  constexpr int points = 81;
  if (effect.state_count() > 0) return {};
  auto curves = laws_over(ranges_of(experiment), effect, parameters, experiment, points);
  std::erase_if(curves, [](const Curve& curve) { return !bends(curve); });
  return curves;
}

std::vector<Curve> portrait_of(const physics::Effect& effect, const physics::Place& place,
                               std::span<const double> parameters, std::span<const double> like,
                               const Experiment& experiment, double friction_n) {
  std::vector<Curve> curves = replaced_laws_of(effect, parameters, like, friction_n);
  if (!curves.empty()) return curves;
  if ((effect.hooks() & physics::hook::reading) != 0) {
    curves = misreadings_of(effect, place, parameters, experiment);
  } else if (effect.state_count() > 0) {
    curves = loops_of(effect, parameters, experiment);
  } else {
    auto ranges = ranges_of(experiment);
    // What is periodic in time is drawn over three periods.
    const auto own_hz = named(effect, like, "frequency_hz");
    if (own_hz && *own_hz > 0.0) ranges.back().high = std::min(ranges.back().high, 3.0 / *own_hz);
    curves = laws_over(ranges, effect, parameters, experiment, portrait_points);
  }
  std::erase_if(curves, [](const Curve& curve) { return !bends(curve); });
  return curves;
}

void add_bands(std::vector<Curve>& curves, const Eigen::MatrixXd& correlation,
               const std::function<std::vector<Curve>(Eigen::Index, double)>& changed) {
  const Eigen::Index unknowns = correlation.rows();
  if (unknowns == 0) return;
  // By how much a curve moves for one standard deviation of each unknown.
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
  for (std::size_t i = 0; i < curves.size(); ++i) {
    for (std::size_t k = 0; k < curves[i].at.size(); ++k) {
      const Eigen::RowVectorXd row = slope[i].row(static_cast<Eigen::Index>(k));
      const double half = 1.96 * std::sqrt(std::max(0.0, (row * correlation).dot(row)));
      curves[i].low.push_back(curves[i].value[k] - half);
      curves[i].high.push_back(curves[i].value[k] + half);
    }
  }
}

}  // namespace stickslip::diagnosis
