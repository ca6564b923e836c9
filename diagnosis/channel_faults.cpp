// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/channel_faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include "diagnosis/median.h"
#include "diagnosis/spectrum.h"
#include "diagnosis/wide_band.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

namespace {

using physics::Excitation;
using physics::Model;
using physics::NormalLoadLaw;

// Most samples from which balances are computed: enough for any rig, and no more work for a long
// recording.
constexpr std::size_t most_samples = 1U << 16U;
// Rows that may be missing within a stretch.
constexpr std::size_t longest_fill = 16;
// Ends of a stretch in which derivatives are inaccurate.
constexpr double margin_s = 0.35;
constexpr double stuck_s = 5.0;
constexpr std::size_t stuck_samples = 100;
// Motion above its noise that counts as one.
constexpr double over_noise = 10.0;
// Correlation from which two signals are one and the same.
constexpr double same_signal = 0.9;
// How far a factor may be from 1000, as a ratio.
constexpr double near_factor = 1.25;

std::string column(Channel channel) { return std::string(info(channel).column); }
std::string unit(Channel channel) { return std::string(" ").append(info(channel).unit); }
std::string number(double value) { return physics::number_text(value, 3); }

// The longest stretch without a gap, on a uniform grid; few missing samples are interpolated.
struct Stretch {
  double period_s = 0.0;
  std::array<std::vector<double>, channel_count> values;

  bool has(Channel channel) const { return !values[index_of(channel)].empty(); }
  const std::vector<double>& of(Channel channel) const { return values[index_of(channel)]; }
};

// First frame and the one behind the last of the longest stretch.
std::pair<std::size_t, std::size_t> longest_stretch(const std::vector<Frame>& frames,
                                                    double period_s) {
  std::pair<std::size_t, std::size_t> best{0, 0};
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= frames.size(); ++i) {
    const bool goes_on = i < frames.size() &&
                         static_cast<double>(frames[i].time_ns - frames[i - 1].time_ns) * 1.0e-9 <
                             period_s * static_cast<double>(longest_fill) &&
                         i - begin < most_samples;
    if (goes_on) continue;
    if (i - begin > best.second - best.first) best = {begin, i};
    begin = i;
  }
  return best;
}

std::vector<double> on_grid(const std::vector<Frame>& frames, std::size_t begin, std::size_t end,
                            Channel channel, double period_s) {
  std::vector<std::pair<double, double>> known;  // time in periods, value
  for (std::size_t i = begin; i < end; ++i) {
    if (!frames[i].has(channel)) continue;
    known.emplace_back(
        static_cast<double>(frames[i].time_ns - frames[begin].time_ns) * 1.0e-9 / period_s,
        frames[i][channel]);
  }
  if (known.size() < 64) return {};
  std::vector<double> out(static_cast<std::size_t>(known.back().first) + 1);
  std::size_t next = 0;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const auto at = static_cast<double>(k);
    while (next + 1 < known.size() && known[next].first < at) ++next;
    const auto& [right, value] = known[next];
    out[k] = value;
    if (next == 0 || right <= at) continue;
    const auto& [left, before] = known[next - 1];
    out[k] = before + (value - before) * (at - left) / (right - left);
  }
  return out;
}

Stretch stretch_of(const protocol::Recording& recording) {
  Stretch out;
  out.period_s = protocol::median_period_s(recording.frames);
  const auto [begin, end] = longest_stretch(recording.frames, out.period_s);
  std::size_t shortest = most_samples * longest_fill;
  for (const Channel channel : all_channels) {
    auto& values = out.values[index_of(channel)];
    values = on_grid(recording.frames, begin, end, channel, out.period_s);
    if (!values.empty()) shortest = std::min(shortest, values.size());
  }
  for (auto& values : out.values) {
    if (!values.empty()) values.resize(shortest);
  }
  return out;
}

struct Moments {
  double mean = 0.0;
  double std = 0.0;
};

Moments moments(const std::vector<double>& values) {
  Moments out;
  for (const double v : values) out.mean += v / static_cast<double>(values.size());
  for (const double v : values) {
    out.std += (v - out.mean) * (v - out.mean) / static_cast<double>(values.size());
  }
  out.std = std::sqrt(out.std);
  return out;
}

bool is_near(double value, double expected) {
  const double ratio = value / expected;
  return ratio > 1.0 / near_factor && ratio < near_factor;
}

// 1000 or 0.001 where `ratio` is one of them.
std::optional<double> thousand(double ratio) {
  for (const double factor : {1000.0, 0.001}) {
    if (is_near(ratio, factor)) return factor;
  }
  return std::nullopt;
}

double stiffness_of(const Model& model) {
  const auto& o = model.oscillator;
  if (o.stiffness_n_m) return o.stiffness_n_m->value;
  if (!o.natural_frequency_hz) return 0.0;
  return o.mass_kg.value * std::pow(2.0 * std::numbers::pi * o.natural_frequency_hz->value, 2);
}

double damping_of(const Model& model) {
  const auto& o = model.oscillator;
  if (o.damping_n_s_m) return o.damping_n_s_m->value;
  if (!o.damping_ratio || !o.natural_frequency_hz) return 0.0;
  return 4.0 * std::numbers::pi * o.damping_ratio->value * o.mass_kg.value *
         o.natural_frequency_hz->value;
}

// --- Dead and stuck channels ---------------------------------------------------------------------

// A run of exactly equal readings, by frames.
struct Run {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::size_t count = 0;
  double value = 0.0;
};

struct Runs {
  Run longest;
  std::size_t second = 0;  // readings in the longest run elsewhere
  std::size_t readings = 0;

  bool throughout() const { return longest.count == readings; }
};

Runs runs_of(const std::vector<Frame>& frames, Channel channel) {
  Runs out;
  Run run;
  const auto close = [&out](const Run& done) {
    if (done.count > out.longest.count) {
      out.second = out.longest.count;
      out.longest = done;
    } else {
      out.second = std::max(out.second, done.count);
    }
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].has(channel)) continue;
    ++out.readings;
    if (run.count == 0 || frames[i][channel] != run.value) {
      close(run);
      run = {i, i, 0, frames[i][channel]};
    }
    run.end = i + 1;
    ++run.count;
  }
  close(run);
  return out;
}

std::vector<double> readings_within(const std::vector<Frame>& frames, Channel channel,
                                    std::size_t begin, std::size_t end) {
  std::vector<double> out;
  for (std::size_t i = begin; i < end; ++i) {
    if (frames[i].has(channel)) out.push_back(frames[i][channel]);
  }
  return out;
}

// True if the channel goes up and down within these frames, beyond noise and resolution.
bool swings(const std::vector<Frame>& frames, Channel channel, const Run& run) {
  constexpr int least_turns = 4;
  const auto values = readings_within(frames, channel, run.begin, run.end);
  if (values.size() < 32) return false;
  const Moments m = moments(values);
  if (!(m.std > over_noise * noise_of(values)) || !(m.std > 0.0)) return false;
  int turns = 0;
  double side = 0.0;
  for (const double v : values) {
    const double now = v > m.mean + 0.5 * m.std ? 1.0 : v < m.mean - 0.5 * m.std ? -1.0 : side;
    if (now * side < 0.0) ++turns;
    side = now;
  }
  return turns >= least_turns;
}

// True if the swing of the mass grows within these frames, or lasts where half of the declared
// damping would have stopped it, as neither can without a drive.
bool is_driven(const std::vector<Frame>& frames, const Run& run, const Model& model) {
  if (model.oscillator.two_well) return false;  // its wells differ in what a swing costs
  const auto x = readings_within(frames, Channel::displacement, run.begin, run.end);
  const std::size_t block = x.size() / 12;
  if (block < 32) return false;
  const double noise = noise_of(x);
  std::vector<double> swing;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t begin = 0; begin + block <= x.size(); begin += block) {
    const std::vector<double> part(x.begin() + static_cast<std::ptrdiff_t>(begin),
                                   x.begin() + static_cast<std::ptrdiff_t>(begin + block));
    swing.push_back(moments(part).std);
    if (swing.back() > 3.0 * least + 20.0 * noise) return true;
    least = std::min(least, swing.back());
  }
  const double seconds = frames[run.end - 1].time_s() - frames[run.begin].time_s();
  const double decay_per_s = 0.5 * 0.5 * damping_of(model) / model.oscillator.mass_kg.value;
  const double kept = swing.back() / swing.front();
  return swing.back() > over_noise * noise && kept > 0.5 &&
         std::exp(-decay_per_s * seconds * 11.0 / 12.0) < 0.2 * kept;
}

// Evidence that the quantity did not stand still during the run; empty: none.
std::string contradiction(const std::vector<Frame>& frames, Channel channel, const Run& run,
                          const Model& model) {
  const auto moved = [&](Channel other) { return swings(frames, other, run); };
  switch (channel) {
    case Channel::displacement:
      return moved(Channel::velocity) ? "velocity_m_s swings to and fro" : "";
    case Channel::velocity:
      return moved(Channel::displacement) ? "displacement_m swings to and fro" : "";
    case Channel::friction_force:
      if (run.value == 0.0 && physics::is_frictionless(model)) return "";
      return moved(Channel::displacement) ? "the mass slides to and fro under it" : "";
    case Channel::normal_load:
      return "";
    case Channel::base_displacement:
    case Channel::drive_force:
      if (model.oscillator.excitation == Excitation::imposed) return "";
      return is_driven(frames, run, model) ? "the mass keeps swinging, which takes a drive" : "";
  }
  return "";
}

std::optional<std::string> dead_or_stuck(const std::vector<Frame>& frames, Channel channel,
                                         const Model& model) {
  const Runs runs = runs_of(frames, channel);
  const Run& run = runs.longest;
  if (run.count < stuck_samples) return std::nullopt;
  const double from_s = frames[run.begin].time_s();
  const double to_s = frames[run.end - 1].time_s();
  const bool stuck = to_s - from_s >= stuck_s && run.count > 20 * runs.second;
  if (!runs.throughout() && !stuck) return std::nullopt;
  std::string why = contradiction(frames, channel, run, model);
  // A load has no partner to be compared with; that its noise stops is enough.
  if (channel == Channel::normal_load && !runs.throughout() && runs.second < 4) {
    why = "its noise stops there";
  }
  if (why.empty()) return std::nullopt;
  const std::string when = runs.throughout()
                               ? " throughout"
                               : " from " + number(from_s) + " s to " + number(to_s) + " s";
  return column(channel) + " is " + number(run.value) + unit(channel) + when + ", while " + why +
         ": the channel is " + (runs.throughout() ? "dead" : "stuck") +
         ". Expected a reading that follows the motion; check its cable and amplifier, and " +
         (runs.throughout() ? "leave the column out" : "cut these seconds out of the recording");
}

// --- Velocity and displacement -------------------------------------------------------------------

struct Relation {
  double correlation = 0.0;
  double gain = 0.0;
};

bool is_rate(const Relation& r) {
  return r.correlation > same_signal && r.gain > 0.5 && r.gain < 2.0;
}

// Of `second` to the rate of `first`, where they have power.
Relation rate_relation(const std::vector<double>& first, const std::vector<double>& second,
                       double period_s, const physics::FilterChain& chain) {
  auto expected = windowed_spectrum(wide_band(first, period_s, {}, noise_of(first)).rate);
  const auto found = windowed_spectrum(second);
  const double step_hz = 0.5 / (period_s * static_cast<double>(expected.size()));
  double most_expected = 0.0;
  double most_found = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    expected[i] *= chain.response(step_hz * static_cast<double>(i));
    most_expected = std::max(most_expected, std::norm(expected[i]));
    most_found = std::max(most_found, std::norm(found[i]));
  }
  double product = 0.0;
  double of_expected = 0.0;
  double of_found = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (std::norm(expected[i]) < 1.0e-3 * most_expected &&
        std::norm(found[i]) < 1.0e-3 * most_found) {
      continue;
    }
    product += (std::conj(expected[i]) * found[i]).real();
    of_expected += std::norm(expected[i]);
    of_found += std::norm(found[i]);
  }
  if (!(of_expected > 0.0) || !(of_found > 0.0)) return {};
  return {product / std::sqrt(of_expected * of_found), product / of_expected};
}

bool moves(const std::vector<double>& values) {
  return moments(values).std > over_noise * noise_of(values);
}

// A column whose exchange with that of the displacement or of the velocity makes one the rate of
// the other.
std::optional<std::string> exchanged_motion(const Stretch& s, const physics::FilterChain& chain,
                                            const Relation& found) {
  const auto words = [&](Channel one, Channel other, const Relation& better) {
    return "velocity_m_s is not the rate of displacement_m (correlation " +
           number(found.correlation) + ", factor " + number(found.gain) + "), but is if " +
           column(one) + " and " + column(other) + " are exchanged (" + number(better.correlation) +
           " and " + number(better.gain) +
           "; expected 1 and 1): exchange the names of these columns";
  };
  const auto fits = [&found](const Relation& r) {
    return is_rate(r) && 1.0 - r.correlation < 0.25 * (1.0 - found.correlation);
  };
  const auto& x = s.of(Channel::displacement);
  const auto& v = s.of(Channel::velocity);
  const Relation turned = rate_relation(v, x, s.period_s, {});
  if (fits(turned)) return words(Channel::displacement, Channel::velocity, turned);
  for (const Channel other : all_channels) {
    if (other == Channel::displacement || other == Channel::velocity || !s.has(other)) continue;
    const Relation as_velocity = rate_relation(x, s.of(other), s.period_s, chain);
    if (fits(as_velocity)) return words(Channel::velocity, other, as_velocity);
    const Relation as_displacement = rate_relation(s.of(other), v, s.period_s, chain);
    if (fits(as_displacement)) return words(Channel::displacement, other, as_displacement);
  }
  return std::nullopt;
}

std::optional<std::string> velocity_fault(const Stretch& s, const Model& model) {
  if (!s.has(Channel::displacement) || !s.has(Channel::velocity)) return std::nullopt;
  const auto& x = s.of(Channel::displacement);
  const auto& v = s.of(Channel::velocity);
  if (!moves(x) || !moves(v)) return std::nullopt;
  const physics::FilterChain chain(model.sensors[index_of(Channel::velocity)].filters, s.period_s);
  const Relation found = rate_relation(x, v, s.period_s, chain);
  const std::string numbers = " (correlation " + number(found.correlation) + ", factor " +
                              number(found.gain) + "; expected 1 and 1)";
  if (found.correlation < -same_signal) {
    const bool right_size = std::abs(found.gain) > 0.5 && std::abs(found.gain) < 2.0;
    if (right_size) {
      return "velocity_m_s is the rate of displacement_m with the sign reversed" + numbers +
             ": one of the two is reversed; swap the leads of that channel, or change its sign "
             "with the factor -1 when importing";
    }
  }
  if (!is_rate(found)) {
    if (auto words = exchanged_motion(s, chain, found)) return words;
  }
  const auto factor = thousand(std::abs(found.gain));
  if (model.dimensionless || !factor || std::abs(found.correlation) < same_signal) {
    return std::nullopt;
  }
  const bool fast = *factor > 1.0;
  return std::string("velocity_m_s is ") + number(found.gain) +
         " times the rate of displacement_m" + numbers + ": " +
         (fast ? "it seems to be in mm/s, not m/s" : "displacement_m seems to be in mm, not m") +
         "; convert it, or name its unit when importing (--unit " +
         (fast ? "velocity_m_s=mm/s)" : "displacement_m=mm)");
}

// --- Normal load ---------------------------------------------------------------------------------

// The column of the friction force holds a load, and that of the load a force that follows the
// motion.
bool loads_exchanged(const Stretch& s, double declared_n) {
  if (!s.has(Channel::friction_force) || !s.has(Channel::velocity)) return false;
  const Moments load = moments(s.of(Channel::normal_load));
  const Moments friction = moments(s.of(Channel::friction_force));
  if (std::abs(load.mean) > 0.3 * load.std || friction.mean < 3.0 * friction.std) return false;
  if (friction.mean < 0.5 * declared_n || friction.mean > 2.0 * declared_n) return false;
  const auto& v = s.of(Channel::velocity);
  const auto& n = s.of(Channel::normal_load);
  double product = 0.0;
  for (std::size_t k = 0; k < v.size(); ++k) product += std::copysign(n[k], n[k] * v[k]);
  return product > 0.5 * load.std * static_cast<double>(v.size());
}

std::optional<std::string> load_fault(const Stretch& s, const Model& model) {
  const auto& declared = model.normal_load;
  if (!declared || declared->law == NormalLoadLaw::measured || !s.has(Channel::normal_load)) {
    return std::nullopt;
  }
  const double expected = declared->load_n.value;
  if (!(expected > 0.0) || 5.0 * declared->load_n.sigma > expected) return std::nullopt;
  if (loads_exchanged(s, expected)) {
    return "normal_load_n reverses with the motion, and friction_force_n does not (mean " +
           number(moments(s.of(Channel::friction_force)).mean) + " N, declared load " +
           number(expected) + " N): the two columns are exchanged; exchange their names";
  }
  const Moments found = moments(s.of(Channel::normal_load));
  const std::string numbers = "normal_load_n is " + number(found.mean) +
                              " N on average, and the model declares load_n = " + number(expected) +
                              " N: ";
  const double ratio = found.mean / expected;
  if (std::abs(found.mean) + found.std < 0.02 * expected) {
    return numbers +
           "the gauge measures no load; check its cable and supply, or leave the column out";
  }
  if (ratio < -0.5 && ratio > -2.0 && found.mean < -2.0 * found.std) {
    return numbers +
           "its sign is reversed; expected N > 0 where the pads are pressed together. "
           "Change its sign with the factor -1 when importing";
  }
  const auto factor = thousand(ratio);
  if (model.dimensionless || !factor) return std::nullopt;
  return numbers + "a factor of " + number(ratio) +
         "; expected newtons in both: convert the column, or name its unit when importing "
         "(--unit normal_load_n=" +
         (*factor > 1.0 ? "mN)" : "kN)");
}

// --- Forces --------------------------------------------------------------------------------------

WideBand before_filters(const std::vector<double>& values, const Stretch& s, const Model& model,
                        Channel channel) {
  const physics::FilterChain chain(model.sensors[index_of(channel)].filters, s.period_s);
  const double noise =
      std::max({noise_of(values), model.sensors[index_of(channel)].noise_std.value_or(0.0),
                1.0e-3 * moments(values).std});
  return wide_band(values, s.period_s, chain, noise);
}

// Forces on the mass in the places of the columns that they come from; their sum is 0.
struct Forces {
  std::vector<double> motion;    // inertia, damping, spring: displacement
  std::vector<double> friction;  // as recorded; empty: part of `motion`, by the model
  std::vector<double> drive;     // of the base, its load cell included, or the drive force
};

double declared_friction_n(const Model& model, const Stretch& s) {
  double load = 1.0;
  if (model.normal_load) {
    const bool measured = model.normal_load->law == NormalLoadLaw::measured;
    load = measured && s.has(Channel::normal_load) ? moments(s.of(Channel::normal_load)).mean
                                                   : model.normal_load->load_n.value;
  }
  return physics::friction_coefficient(model).value * load;
}

std::vector<double> forces_of_motion(const std::vector<double>& displacement, const Stretch& s,
                                     const Model& model) {
  const WideBand x = before_filters(displacement, s, model, Channel::displacement);
  const auto& o = model.oscillator;
  const double k = stiffness_of(model);
  const double c = damping_of(model);
  const double rubs = s.has(Channel::friction_force) ? 0.0 : declared_friction_n(model, s);
  const double transition = std::max(model.friction.transition_speed_m_s.value, 1.0e-6);
  std::vector<double> out(displacement.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double spring = o.two_well ? -o.two_well->linear_n_m.value * x.value[i] +
                                           o.two_well->cubic_n_m3.value * std::pow(x.value[i], 3)
                                     : k * x.value[i];
    out[i] = o.mass_kg.value * x.acceleration[i] + c * x.rate[i] + spring +
             rubs * std::tanh(x.rate[i] / transition);
  }
  return out;
}

std::vector<double> forces_of_base(const std::vector<double>& base, const Stretch& s,
                                   const Model& model) {
  std::vector<double> out = before_filters(base, s, model, Channel::base_displacement).acceleration;
  const bool reads_inertia = model.load_cell && s.has(Channel::friction_force);
  const double mass =
      model.oscillator.mass_kg.value + (reads_inertia ? model.load_cell->mass_kg.value : 0.0);
  for (double& each : out) each *= mass;
  return out;
}

// Power of the residual over that of the forces, without their means: zeros of channels that are
// off say nothing. The median over parts of the recording: what happens once says nothing either.
double imbalance(const Forces& forces, double of_friction, double of_drive, std::size_t margin) {
  constexpr std::size_t parts = 15;
  const std::size_t length = (forces.motion.size() - 2 * margin) / parts;
  std::vector<double> ratios;
  for (std::size_t p = 0; p < parts; ++p) {
    const auto first = static_cast<std::ptrdiff_t>(margin + p * length);
    const auto last = first + static_cast<std::ptrdiff_t>(length);
    std::vector<double> sum(length, 0.0);
    double power = 0.0;
    const auto add = [&](const std::vector<double>& force, double factor) {
      if (force.empty()) return;
      const std::vector<double> part(force.begin() + first, force.begin() + last);
      power += std::pow(factor * moments(part).std, 2);
      for (std::size_t i = 0; i < length; ++i) sum[i] += factor * part[i];
    };
    add(forces.motion, 1.0);
    add(forces.friction, of_friction);
    add(forces.drive, of_drive);
    ratios.push_back(power > 0.0 ? std::pow(moments(sum).std, 2) / power : 0.0);
  }
  return median(std::move(ratios));
}

// An explanation of forces that do not balance: the smallest imbalance over what it may be.
struct Explanation {
  double over_limit = 1.0;
  double imbalance = 1.0;
  std::string words;
};

// Imbalance far from any that a physics that the model lacks may leave: with the wrong sign, ...
constexpr double broken = 0.75;
// ... and with one force beside which all others vanish: by whatever it is not balanced.
constexpr double lone_force = 0.99;
// Largest imbalance that a right explanation leaves.
constexpr double balanced = 0.1;
constexpr double roughly_balanced = 0.4;

Forces forces_of(const Stretch& s, const Model& model) {
  Forces out;
  out.motion = forces_of_motion(s.of(Channel::displacement), s, model);
  if (s.has(Channel::friction_force)) {
    out.friction =
        before_filters(s.of(Channel::friction_force), s, model, Channel::friction_force).value;
  }
  if (model.oscillator.excitation == Excitation::base) {
    out.drive = forces_of_base(s.of(Channel::base_displacement), s, model);
  } else {
    out.drive = s.of(Channel::drive_force);
    for (double& each : out.drive) each = -each;
  }
  return out;
}

Channel drive_of(const Model& model) {
  return model.oscillator.excitation == Excitation::base ? Channel::base_displacement
                                                         : Channel::drive_force;
}

std::string factor_words(Channel channel, double factor) {
  const std::string name = column(channel);
  if (factor < 0.0) {
    return name +
           " has its sign reversed: swap its leads, or change its sign with the factor -1 "
           "when importing";
  }
  std::string wrong = factor < 1.0 ? "m" : "k";
  wrong += info(channel).unit;
  return name + " is " + (factor < 1.0 ? "1000 times too large" : "1000 times too small") +
         ", as if it were in " + wrong + ": convert it, or name its unit when importing (--unit " +
         name + "=" + wrong + ")";
}

void keep_better(Explanation& best, double found, double limit, const std::string& words) {
  if (found / limit < best.over_limit) best = {found / limit, found, words};
}

// Factors of the recorded columns that would restore the balance. A channel in its right unit
// balances most of what is left without it; one that is mostly noise is only removed by a small
// factor.
void try_factors(const Forces& forces, const Stretch& s, const Model& model, std::size_t margin,
                 bool is_lone, Explanation& best) {
  const Channel drive = drive_of(model);
  const auto of_displacement = [&](double factor) {
    Forces other = forces;
    std::vector<double> x = s.of(Channel::displacement);
    for (double& each : x) each *= factor;
    other.motion = forces_of_motion(x, s, model);
    return imbalance(other, 1.0, 1.0, margin);
  };
  const auto of_friction = [&](double factor) { return imbalance(forces, factor, 1.0, margin); };
  const auto of_drive = [&](double factor) { return imbalance(forces, 1.0, factor, margin); };
  const auto consider = [&](Channel channel, double factor, auto&& imbalance_with) {
    const double limit = factor > 0.0 ? roughly_balanced : balanced;
    const double found = imbalance_with(factor);
    if (factor > 0.0 && found > 0.5 * imbalance_with(0.0)) return;
    keep_better(best, found, limit, factor_words(channel, factor));
  };
  for (const double factor : {-1.0, 0.001, 1000.0}) {
    if (factor > 0.0 && (model.dimensionless || !is_lone)) continue;
    consider(drive, factor, of_drive);
    if (!forces.friction.empty()) consider(Channel::friction_force, factor, of_friction);
    // Otherwise the same as that of the drive.
    if (factor > 0.0 || !forces.friction.empty()) {
      consider(Channel::displacement, factor, of_displacement);
    }
  }
}

void try_exchanges(const Forces& forces, const Stretch& s, const Model& model, std::size_t margin,
                   Explanation& best) {
  const auto words = [](Channel one, Channel other) {
    return column(one) + " and " + column(other) + " are exchanged: exchange their names";
  };
  const Channel drive = drive_of(model);
  Forces other = forces;
  if (drive == Channel::base_displacement) {
    other.motion = forces_of_motion(s.of(drive), s, model);
    other.drive = forces_of_base(s.of(Channel::displacement), s, model);
    keep_better(best, imbalance(other, 1.0, 1.0, margin), balanced,
                words(Channel::displacement, drive));
  } else if (!forces.friction.empty()) {
    std::swap(other.friction, other.drive);
    keep_better(best, imbalance(other, -1.0, -1.0, margin), balanced,
                words(Channel::friction_force, drive));
  }
}

std::optional<std::string> balance_fault(const Stretch& s, const Model& model) {
  if (!s.has(Channel::displacement) || !s.has(drive_of(model)) ||
      !moves(s.of(Channel::displacement)) || !moves(s.of(drive_of(model)))) {
    return std::nullopt;
  }
  const std::size_t n = s.of(Channel::displacement).size();
  const auto margin = static_cast<std::size_t>(margin_s / s.period_s);
  if (n < 2 * margin + 1024) return std::nullopt;
  const Forces forces = forces_of(s, model);
  const double as_recorded = imbalance(forces, 1.0, 1.0, margin);
  if (as_recorded < broken) return std::nullopt;
  Explanation best;
  try_factors(forces, s, model, margin, as_recorded > lone_force && as_recorded < 1.01, best);
  try_exchanges(forces, s, model, margin, best);
  if (best.words.empty()) return std::nullopt;
  return best.words + ". As recorded, " + number(100.0 * as_recorded) +
         " % of the power of the forces on the mass is unbalanced; corrected, " +
         number(100.0 * best.imbalance) + " %";
}

std::optional<std::string> friction_sign_fault(const Stretch& s, const Model& model) {
  const double declared = declared_friction_n(model, s);
  if (!s.has(Channel::friction_force) || !s.has(Channel::displacement) || !(declared > 0.0)) {
    return std::nullopt;
  }
  const WideBand x = before_filters(s.of(Channel::displacement), s, model, Channel::displacement);
  auto force =
      before_filters(s.of(Channel::friction_force), s, model, Channel::friction_force).value;
  if (model.load_cell && s.has(Channel::base_displacement)) {
    const auto base =
        before_filters(s.of(Channel::base_displacement), s, model, Channel::base_displacement);
    for (std::size_t i = 0; i < force.size(); ++i) {
      force[i] += model.load_cell->mass_kg.value * base.acceleration[i];  // Eq. (1)
    }
  }
  const auto margin = static_cast<std::size_t>(margin_s / s.period_s);
  double power = 0.0;
  double of_force = 0.0;
  double of_velocity = 0.0;
  for (std::size_t i = margin; i + margin < force.size(); ++i) {
    power += force[i] * x.rate[i];
    of_force += force[i] * force[i];
    of_velocity += x.rate[i] * x.rate[i];
  }
  const double correlation = power / std::sqrt(of_force * of_velocity);
  const double size = std::sqrt(of_force / static_cast<double>(force.size() - 2 * margin));
  if (!(correlation < -0.6) || size < 0.3 * declared || size > 3.0 * declared) return std::nullopt;
  return "friction_force_n drives the motion in place of opposing it (correlation with the "
         "velocity " +
         number(correlation) +
         ", expected above 0): its sign is reversed; swap its leads, or change its sign with the "
         "factor -1 when importing";
}

}  // namespace

std::optional<std::string> channel_fault(const protocol::Recording& recording, const Model& model) {
  if (recording.frames.size() < 64) return std::nullopt;
  for (const Channel channel : all_channels) {
    if (auto words = dead_or_stuck(recording.frames, channel, model)) return words;
  }
  const Stretch stretch = stretch_of(recording);
  if (auto words = velocity_fault(stretch, model)) return words;
  if (auto words = load_fault(stretch, model)) return words;
  const bool balances = model.oscillator.excitation != Excitation::imposed && model.terms.empty();
  if (balances) {
    if (auto words = balance_fault(stretch, model)) return words;
  }
  return friction_sign_fault(stretch, model);
}

void refuse_faulty_channels(const protocol::Recording& recording, const Model& model) {
  if (auto words = channel_fault(recording, model)) {
    throw InputError(Problem{recording.source, 0, 0, *words});
  }
}

}  // namespace stickslip::diagnosis
