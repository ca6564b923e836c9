// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/balance_equations.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/channel_readings.h"
#include "diagnosis/fourier.h"
#include "diagnosis/outliers.h"
#include "diagnosis/time_grid.h"
#include "physics/catalogue.h"
#include "physics/model_consistency.h"
#include "physics/reading.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

namespace {

using physics::Excitation;
using physics::Model;
using std::numbers::pi;
using Complex = std::complex<double>;

constexpr double ramp_s = 0.35;  // as the margins of an experiment
// Power over that of the noise, averaged over neighbouring bins, of what stands out of it.
constexpr double standing_out = 3.0;
constexpr double averaged_hz = 0.5;
// Of the rate of a channel: above it interpolation between its readings is inexact.
constexpr double readable_share = 0.3;
// Of the highest frequency of the drive, beyond which its skirts are below the noise.
constexpr double beyond_drive = 1.3;
constexpr double contact_step_s = 5.0e-4;

physics::RigNumbers<double> numbers_of(const Model& model) {
  const physics::Rig rig(model);
  return rig.numbers<double>(rig.parameter_values());
}

HalfSpectrum half_spectrum(std::vector<double> samples, std::size_t padded) {
  samples.resize(padded);
  HalfSpectrum out = fourier(samples);
  out.resize(padded / 2 + 1);
  return out;
}

double taper_at(const ReadingSpectra& stretch, std::size_t k) {
  const auto from_end = static_cast<double>(std::min(k, stretch.count - 1 - k));
  const double share = std::min(1.0, from_end / static_cast<double>(stretch.ramp));
  return 0.5 - 0.5 * std::cos(pi * share);
}

HalfSpectrum tapered(const ReadingSpectra& stretch, std::vector<double> samples) {
  for (std::size_t k = 0; k < stretch.count; ++k) samples[k] *= taper_at(stretch, k);
  return half_spectrum(std::move(samples), stretch.padded);
}

// |spectrum|^2 averaged over neighbouring bins.
std::vector<double> mean_power(const HalfSpectrum& spectrum, double bin_hz) {
  const auto reach = std::max<std::size_t>(4, static_cast<std::size_t>(averaged_hz / bin_hz));
  std::vector<double> sum(spectrum.size() + 1, 0.0);
  for (std::size_t i = 0; i < spectrum.size(); ++i) sum[i + 1] = sum[i] + std::norm(spectrum[i]);
  std::vector<double> out(spectrum.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::size_t low = i > reach ? i - reach : 0;
    const std::size_t high = std::min(out.size(), i + reach + 1);
    out[i] = (sum[high] - sum[low]) / static_cast<double>(high - low);
  }
  return out;
}

// Of a coefficient of white noise.
double noise_power(const ReadingSpectra& stretch, double noise_std) {
  double weight = 0.0;
  for (std::size_t k = 0; k < stretch.count; ++k) weight += std::pow(taper_at(stretch, k), 2);
  return noise_std * noise_std * weight;
}

// A constant reading stands out at the lowest frequencies only.
void set_denoising(ReadingSpectra& stretch, std::size_t c, double noise_std) {
  const double bin_hz = stretch.bin_hz();
  const double noise = noise_power(stretch, noise_std);
  const std::vector<double> power = mean_power(stretch.spectrum[c], bin_hz);
  std::vector<double>& gain = stretch.denoising[c];
  std::size_t size = 1;
  for (std::size_t i = 0; i < power.size(); ++i) {
    const double frequency = bin_hz * static_cast<double>(i);
    if (frequency > stretch.readable_hz[c]) break;
    const bool stands_out = power[i] > standing_out * noise;
    gain.push_back(stands_out ? 1.0 - noise / power[i] : 0.0);
    if (!stands_out) continue;
    size = i + 1;
    stretch.highest_hz[c] = frequency;
  }
  gain.resize(size);
}

// The part of a reading that is there without a quantity, but for the constant offset.
double additive_part(const physics::ReadingLaw<double>& law, double time_s) {
  return physics::reading_of(law, 0.0, time_s) - law.offset;
}

void set_channel(ReadingSpectra& stretch, const ChannelReadings& readings, const TimeGrid& grid,
                 const Range& range, const physics::ReadingLaw<double>& law, double noise_std,
                 std::size_t c) {
  constexpr std::size_t fewest = 32;
  const Series series = series_over(readings, grid, range);
  if (series.value.size() < fewest) return;
  std::vector<double> samples(stretch.count);
  for (std::size_t k = 0; k < stretch.count; ++k) {
    samples[k] =
        interpolated(series.value, series.position(range.begin + k), 0, series.value.size()) -
        additive_part(law, stretch.period_s * static_cast<double>(k));
  }
  stretch.spectrum[c] = tapered(stretch, std::move(samples));
  stretch.readable_hz[c] = readable_share / (series.spacing * stretch.period_s);
  set_denoising(stretch, c, noise_std);
}

// Response of all filters between a quantity and its reading.
std::vector<Complex> response_of(const Model& model, Channel channel, double bin_hz,
                                 std::size_t bins) {
  std::vector<physics::Filter> filters;
  if (channel == Channel::velocity) filters = model.sensors[0].filters;
  const auto& own = model.sensors[index_of(channel)].filters;
  filters.insert(filters.end(), own.begin(), own.end());
  std::vector<Complex> out(bins, Complex(1.0));
  for (const physics::Filter& filter : filters) {
    const physics::FilterChain chain({&filter, 1}, 1.0e-3);
    for (std::size_t i = 0; i < bins; ++i) {
      out[i] *= chain.response(bin_hz * static_cast<double>(i));
    }
  }
  return out;
}

// The quantities behind the readings of a stretch, as a model's instruments state them.
class Quantities {
 public:
  Quantities(const ReadingSpectra& stretch, const Model& model)
      : stretch_(stretch), model_(model), n_(numbers_of(model)) {}

  const physics::RigNumbers<double>& numbers() const { return n_; }
  Complex s(std::size_t bin) const {
    return {0.0, 2.0 * pi * stretch_.bin_hz() * static_cast<double>(bin)};
  }

  // The first `bins` coefficients of the quantity; empty where it was not recorded.
  HalfSpectrum of(Channel channel, std::size_t bins) const {
    const std::size_t c = index_of(channel);
    const physics::ReadingLaw<double>& law = n_.reading.of[c];
    if (!stretch_.has(channel)) return {};
    const auto response = response_of(model_, channel, stretch_.bin_hz(), bins);
    HalfSpectrum out(bins);
    for (std::size_t i = 0; i < bins; ++i) {
      const Complex reading = stretch_.spectrum[c][i] - law.offset * stretch_.taper[i];
      out[i] = reading / (law.gain * response[i]);
      if (law.delay_s != 0.0) out[i] *= std::polar(1.0, s(i).imag() * law.delay_s);
    }
    return out;
  }

  // All of it, where it stands out of the noise (Wiener's filter).
  HalfSpectrum denoised(Channel channel) const {
    const std::size_t c = index_of(channel);
    const std::vector<double>& gain = stretch_.denoising[c];
    HalfSpectrum out = of(channel, gain.size());
    for (std::size_t i = 0; i < out.size(); ++i) out[i] *= gain[i];
    return out;
  }

  std::vector<double> samples(const HalfSpectrum& spectrum) const {
    if (spectrum.empty()) return {};
    std::vector<double> out = samples_of(spectrum, stretch_.padded, stretch_.padded);
    out.resize(stretch_.count);
    return out;
  }

  HalfSpectrum derivative(HalfSpectrum spectrum) const {
    for (std::size_t i = 0; i < spectrum.size(); ++i) spectrum[i] *= s(i);
    return spectrum;
  }

 private:
  const ReadingSpectra& stretch_;
  const Model& model_;
  physics::RigNumbers<double> n_;
};

bool is_resonant(const Model& model) {
  return model.load_cell && model.load_cell->dynamics == physics::LoadCellDynamics::resonant;
}

// The contact alone, under an imposed motion and the measured load; its own physics stays.
Model contact_of(const ReadingSpectra& stretch, Model model) {
  model.oscillator = {};
  model.oscillator.excitation = Excitation::imposed;
  model.load_cell.reset();
  model.normal_load_bridge.reset();
  if (model.normal_load && stretch.has(Channel::normal_load)) {
    model.normal_load = {physics::NormalLoadLaw::measured, {}, {}};
  }
  std::erase_if(model.terms, [](const physics::Term& term) {
    return physics::effect_of(term)->card().relation != physics::Relation::friction_law;
  });
  return model;
}

// The numbers that the contact's force depends on: its law, the instruments of motion and load.
Model dependence_of(const ReadingSpectra& stretch, const Model& model) {
  Model out = contact_of(stretch, model);
  if (is_resonant(model)) out.load_cell = model.load_cell;
  for (const Channel channel : {Channel::base_displacement, Channel::drive_force}) {
    out.sensors[index_of(channel)] = {};
  }
  if (!is_resonant(model)) out.sensors[index_of(Channel::friction_force)] = {};
  const bool anywhere = out.terms.empty() && stretch.has(Channel::velocity) &&
                        (!out.normal_load || stretch.has(Channel::normal_load));
  if (anywhere) {
    physics::Sensor& displacement = out.sensors[index_of(Channel::displacement)];
    displacement.gain = displacement.offset = displacement.delay_s = std::nullopt;
  }
  return out;
}

struct ContactMotion {
  std::vector<double> x, slip, load;
};

ContactMotion contact_motion(const ReadingSpectra& stretch, const Model& model) {
  const Quantities quantities(stretch, model);
  const HalfSpectrum x = quantities.denoised(Channel::displacement);
  HalfSpectrum slip = stretch.has(Channel::velocity) ? quantities.denoised(Channel::velocity)
                                                     : quantities.derivative(x);
  if (is_resonant(model) && stretch.has(Channel::friction_force)) {
    const HalfSpectrum rate = quantities.derivative(quantities.denoised(Channel::friction_force));
    const double stiffness = quantities.numbers().c.cell_stiffness;
    slip.resize(std::max(slip.size(), rate.size()));
    for (std::size_t i = 0; i < rate.size(); ++i) slip[i] -= rate[i] / stiffness;
  }
  return {quantities.samples(x), quantities.samples(slip),
          quantities.samples(quantities.denoised(Channel::normal_load))};
}

// Means over each period, against aliasing of what reverses within one.
std::vector<double> contact_force(const Model& contact, const ContactMotion& motion,
                                  double period_s, int steps) {
  const physics::Rig rig(contact);
  const auto n = rig.numbers<double>(rig.parameter_values());
  const auto input_at = [&](std::size_t k) {
    physics::Input input;
    input.displacement_m = motion.x[k];
    input.velocity_m_s = motion.slip[k];
    if (!motion.load.empty()) input.normal_load_n = motion.load[k];
    return input;
  };
  physics::RigState<double> state;
  physics::Input now = input_at(0);
  rig.complete(state, now, 0.0, n);
  std::vector<double> out(motion.x.size(), 0.0);
  const double h = period_s / steps;
  for (std::size_t k = 1; k < out.size(); ++k) {
    const physics::Input begin = input_at(k - 1);
    const physics::Input end = input_at(k);
    for (int part = 1; part <= steps; ++part) {
      const physics::Input next = physics::between(begin, end, static_cast<double>(part) / steps);
      const double time_s = period_s * static_cast<double>(k - 1) + h * (part - 1);
      rig.step(state, now, next, time_s, h, n);
      now = next;
      out[k] += state.friction / steps;
    }
  }
  return out;
}

// Undoes the mean over the last `steps` steps of each period.
void undo_mean(HalfSpectrum& spectrum, const ReadingSpectra& stretch, int steps) {
  const double h = stretch.period_s / steps;
  for (std::size_t i = 0; i < spectrum.size(); ++i) {
    const double angle = 2.0 * pi * stretch.bin_hz() * static_cast<double>(i) * h;
    if (i == 0 || steps == 1) continue;
    const double mean = std::sin(0.5 * steps * angle) / (steps * std::sin(0.5 * angle));
    spectrum[i] *= std::polar(1.0 / mean, 0.5 * (steps - 1) * angle);
  }
}

// The friction force as measured, by Eq. (1) or the load cell's whole equation.
HalfSpectrum measured_friction(const Quantities& quantities, const Model& model, std::size_t bins) {
  HalfSpectrum f = quantities.of(Channel::friction_force, bins);
  if (f.empty() || !model.load_cell) return f;
  const auto& c = quantities.numbers().c;
  const HalfSpectrum base = model.oscillator.excitation == Excitation::base
                                ? quantities.of(Channel::base_displacement, bins)
                                : HalfSpectrum();
  for (std::size_t i = 0; i < bins; ++i) {
    const Complex s = quantities.s(i);
    if (is_resonant(model)) {
      f[i] *= (c.cell_mass * s * s + c.cell_damping * s + c.cell_stiffness) / c.cell_stiffness;
    }
    if (!base.empty()) f[i] += c.cell_mass * s * s * base[i];
  }
  return f;
}

HalfSpectrum kinematics_residual(const Quantities& quantities, std::size_t bins) {
  HalfSpectrum out = quantities.derivative(quantities.of(Channel::displacement, bins));
  const HalfSpectrum v = quantities.of(Channel::velocity, bins);
  for (std::size_t i = 0; i < bins; ++i) out[i] -= v[i];
  return out;
}

// Forces that are no linear function of the motion: magnets, and force terms of the model.
HalfSpectrum other_forces(const ReadingSpectra& stretch, const Quantities& quantities,
                          const Model& model) {
  std::vector<physics::BoundTerm> terms = physics::bound_terms(model);
  std::erase_if(terms, [](const auto& term) { return (term.hooks & physics::hook::force) == 0; });
  if (!model.oscillator.two_well && terms.empty()) return {};
  const physics::Rig rig(model);
  const HalfSpectrum x_spectrum = quantities.denoised(Channel::displacement);
  const std::vector<double> x = quantities.samples(x_spectrum);
  const std::vector<double> v = quantities.samples(quantities.derivative(x_spectrum));
  std::array<std::vector<double>, physics::max_terms> p;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    p[i] = terms[i].values(std::span<const double>(rig.parameter_values()));
  }
  std::array<std::array<double, physics::max_effect_states>, physics::max_terms> state{};
  std::vector<double> out(stretch.count, 0.0);
  physics::OperatingPoint<double> at;
  for (std::size_t k = 0; k < stretch.count; ++k) {
    at.time_s = stretch.period_s * static_cast<double>(k);
    at.x = x[k];
    at.v = at.slip = v[k];
    if (model.oscillator.two_well) out[k] = quantities.numbers().c.well_cubic * std::pow(x[k], 3);
    for (std::size_t i = 0; i < terms.size(); ++i) {
      out[k] += terms[i].effect->force(at, p[i].data(), state[i].data());
      std::array<double, physics::max_effect_states> rate{};
      if (terms[i].effect->state_count() == 0) continue;
      terms[i].effect->rates(rate.data(), at, p[i].data(), state[i].data());
      for (std::size_t j = 0; j < rate.size(); ++j) state[i][j] += stretch.period_s * rate[j];
      terms[i].effect->confine(state[i].data(), p[i].data());
    }
  }
  return tapered(stretch, std::move(out));
}

// The motion is that of the displacement channel alone, so that an error of the velocity channel is
// none of this balance.
HalfSpectrum force_residual(const ReadingSpectra& stretch, const Quantities& quantities,
                            const Model& model, const HalfSpectrum& friction, std::size_t bins) {
  const auto& n = quantities.numbers();
  const double stiffness = model.oscillator.two_well ? -n.c.well_linear : n.c.stiffness;
  const bool by_base = model.oscillator.excitation == Excitation::base;
  const HalfSpectrum drive =
      quantities.of(by_base ? Channel::base_displacement : Channel::drive_force, bins);
  const HalfSpectrum others = other_forces(stretch, quantities, model);
  HalfSpectrum out = quantities.of(Channel::displacement, bins);
  for (std::size_t i = 0; i < bins; ++i) {
    const Complex s = quantities.s(i);
    out[i] *= n.c.mass * s * s + n.c.damping * s + stiffness;
    out[i] += by_base ? n.c.mass * s * s * drive[i] : -drive[i];
    if (!others.empty()) out[i] += others[i];
    if (!friction.empty()) out[i] += friction[i];
  }
  return out;
}

HalfSpectrum load_residual(const ReadingSpectra& stretch, const Quantities& quantities,
                           const Model& model, std::size_t bins) {
  const physics::Rig rig(model);
  const std::vector<double> x = quantities.samples(quantities.denoised(Channel::displacement));
  std::vector<double> law(stretch.count);
  physics::RigState<double> state;
  for (std::size_t k = 0; k < stretch.count; ++k) {
    const double time_s = stretch.period_s * static_cast<double>(k);
    state.s[physics::state::x] = x[k];
    state.load = rig.normal_load(state, {}, time_s, quantities.numbers());
    law[k] = rig.quantities(state, {}, quantities.numbers()).normal_load;
  }
  const HalfSpectrum predicted = tapered(stretch, std::move(law));
  HalfSpectrum out = quantities.of(Channel::normal_load, bins);
  for (std::size_t i = 0; i < bins; ++i) out[i] -= predicted[i];
  return out;
}

std::optional<Channel> drive_of(const Model& model) {
  switch (model.oscillator.excitation) {
    case Excitation::base:
      return Channel::base_displacement;
    case Excitation::force:
      return Channel::drive_force;
    case Excitation::imposed:
      break;
  }
  return std::nullopt;
}

// From 0 to the highest frequency of any of the channels, within what all of them can show.
BalanceBand band_of(const ReadingSpectra& stretch, std::initializer_list<Channel> channels) {
  double highest = 0.0;
  double readable = 1.0e300;
  for (const Channel channel : channels) {
    if (!stretch.has(channel)) return {};
    highest = std::max(highest, stretch.highest_hz[index_of(channel)]);
    readable = std::min(readable, stretch.readable_hz[index_of(channel)]);
  }
  const double to_hz = std::min(highest, readable);
  return {0, to_hz > 0.0 ? static_cast<std::size_t>(to_hz / stretch.bin_hz()) + 1 : 0};
}

BalanceBand excitation_band(const ReadingSpectra& stretch, Channel drive) {
  double reaction_hz = 0.0;
  for (const Channel channel :
       {Channel::displacement, Channel::velocity, Channel::friction_force}) {
    reaction_hz = std::max(reaction_hz, stretch.highest_hz[index_of(channel)]);
  }
  const double from_hz = beyond_drive * std::max(stretch.highest_hz[index_of(drive)], 1.0 / ramp_s);
  const double to_hz = std::min(reaction_hz, stretch.readable_hz[index_of(drive)]);
  if (to_hz < beyond_drive * from_hz) return {};
  return {static_cast<std::size_t>(from_hz / stretch.bin_hz()),
          static_cast<std::size_t>(to_hz / stretch.bin_hz()) + 1};
}

}  // namespace

std::size_t fast_length(std::size_t least) {
  for (std::size_t length = least + least % 2;; length += 2) {
    std::size_t rest = length;
    for (const std::size_t prime : {2U, 3U, 5U}) {
      while (rest % prime == 0) rest /= prime;
    }
    if (rest == 1) return length;
  }
}

std::vector<double> samples_of(const HalfSpectrum& spectrum, std::size_t padded,
                               std::size_t points) {
  std::vector<Complex> all(points, Complex(0.0));
  const double scale = static_cast<double>(points) / static_cast<double>(padded);
  all[0] = scale * spectrum[0].real();
  for (std::size_t i = 1; i < spectrum.size() && 2 * i < points; ++i) {
    all[i] = scale * spectrum[i];
    all[points - i] = std::conj(all[i]);
  }
  const std::vector<Complex> samples = inverse_fourier(all);
  std::vector<double> out(points);
  for (std::size_t k = 0; k < points; ++k) out[k] = samples[k].real();
  return out;
}

ReadingSpectra stretch_of(const protocol::Recording& as_recorded, const Experiment& experiment,
                          const Model& model, std::size_t most) {
  const Cleaned cleaned(as_recorded);
  const TimeGrid grid = time_grid_of(cleaned.recording().frames);
  const Segment segment = experiment.longest_segment();
  ReadingSpectra out;
  out.period_s = experiment.period_s;
  out.count = std::min(segment.end - segment.begin, most);
  out.padded = fast_length(out.count);
  out.ramp = std::clamp<std::size_t>(static_cast<std::size_t>(ramp_s / out.period_s), 1,
                                     std::max<std::size_t>(1, out.count / 16));
  out.taper = tapered(out, std::vector<double>(out.count, 1.0));
  const auto laws = numbers_of(model).reading;
  const Range range{segment.begin, segment.begin + out.count};
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!(experiment.noise_std[c] > 0.0)) continue;
    set_channel(out, readings_of(cleaned.recording().frames, grid, channel), grid, range,
                laws.of[c], experiment.noise_std[c], c);
  }
  return out;
}

BalanceBands bands_of(const ReadingSpectra& stretch, const Model& model) {
  BalanceBands out{};
  const auto of = [&out](Balance balance) -> BalanceBand& { return out[index_of(balance)]; };
  of(Balance::kinematics) = band_of(stretch, {Channel::displacement, Channel::velocity});
  const std::optional<Channel> drive = drive_of(model);
  const bool friction_measured = stretch.has(Channel::friction_force);
  if (drive) {
    of(Balance::force_balance) =
        friction_measured
            ? band_of(stretch, {Channel::displacement, *drive, Channel::friction_force})
            : band_of(stretch, {Channel::displacement, *drive});
    of(Balance::excitation) = excitation_band(stretch, *drive);
  }
  if (friction_measured) {
    of(Balance::friction_law) = band_of(stretch, {Channel::displacement, Channel::friction_force});
  }
  if (model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured) {
    of(Balance::normal_load) = band_of(stretch, {Channel::normal_load, Channel::displacement});
  }
  return out;
}

const HalfSpectrum& ContactForce::of(const ReadingSpectra& stretch, const Model& model,
                                     std::size_t bins) {
  Model dependence = dependence_of(stretch, model);
  if (model_ && *model_ == dependence) return force_;
  model_ = std::move(dependence);
  force_.clear();
  const Model contact = contact_of(stretch, model);
  if (contact.friction.law == physics::FrictionLaw::none && contact.terms.empty()) return force_;
  const int steps = std::max(1, static_cast<int>(std::ceil(stretch.period_s / contact_step_s)));
  force_ = tapered(stretch,
                   contact_force(contact, contact_motion(stretch, model), stretch.period_s, steps));
  force_.resize(bins);
  undo_mean(force_, stretch, steps);
  return force_;
}

BalanceResiduals residuals_of(const ReadingSpectra& stretch, const BalanceBands& bands,
                              const Model& model, ContactForce contact) {
  BalanceResiduals out;
  const Quantities quantities(stretch, model);
  const auto bins = [&bands](Balance balance) { return bands[index_of(balance)].last; };
  const auto of = [&out](Balance balance) -> HalfSpectrum& { return out[index_of(balance)]; };
  const std::size_t contact_bins =
      std::max(bins(Balance::force_balance), bins(Balance::friction_law));
  if (const std::size_t n = bins(Balance::kinematics); n > 0) {
    of(Balance::kinematics) = kinematics_residual(quantities, n);
  }
  if (const std::size_t n = bins(Balance::force_balance); n > 0) {
    const HalfSpectrum friction = stretch.has(Channel::friction_force)
                                      ? measured_friction(quantities, model, n)
                                      : contact.of(stretch, model, contact_bins);
    of(Balance::force_balance) = force_residual(stretch, quantities, model, friction, n);
  }
  if (const std::size_t n = bins(Balance::friction_law); n > 0) {
    HalfSpectrum f = measured_friction(quantities, model, n);
    const HalfSpectrum& law = contact.of(stretch, model, contact_bins);
    for (std::size_t i = 0; i < n && !law.empty(); ++i) f[i] -= law[i];
    of(Balance::friction_law) = std::move(f);
  }
  if (const std::size_t n = bins(Balance::normal_load); n > 0) {
    of(Balance::normal_load) = load_residual(stretch, quantities, model, n);
  }
  if (const BalanceBand band = bands[index_of(Balance::excitation)]; !band.empty()) {
    const HalfSpectrum& drive = stretch.spectrum[index_of(*drive_of(model))];
    HalfSpectrum& residual = of(Balance::excitation);
    residual.assign(drive.begin(), drive.begin() + static_cast<std::ptrdiff_t>(band.last));
    std::fill_n(residual.begin(), band.first, Complex(0.0));
  }
  return out;
}

std::vector<double> measured_velocity(const ReadingSpectra& stretch, const Model& model) {
  const Quantities quantities(stretch, model);
  return quantities.samples(quantities.derivative(quantities.denoised(Channel::displacement)));
}

}  // namespace stickslip::diagnosis
