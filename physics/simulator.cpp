// SPDX-License-Identifier: Apache-2.0
#include "physics/simulator.h"

#include <cmath>
#include <optional>
#include <random>
#include <stdexcept>

#include "physics/reading.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::physics {

Input between(const Input& a, const Input& b, double fraction) {
  const auto mix = [fraction](double p, double q) { return p + fraction * (q - p); };
  return {mix(a.base_displacement_m, b.base_displacement_m),
          mix(a.base_acceleration_m_s2, b.base_acceleration_m_s2),
          mix(a.drive_force_n, b.drive_force_n),
          mix(a.displacement_m, b.displacement_m),
          mix(a.velocity_m_s, b.velocity_m_s),
          mix(a.normal_load_n, b.normal_load_n)};
}

struct RigSimulator::Implementation {
  Implementation(const Model& m, SimulationOptions o)
      : model(m),
        options(o),
        rig(m),
        numbers(rig.numbers<double>(rig.parameter_values())),
        random(o.seed) {
    if (!(options.step_s > 0.0)) {
      throw std::invalid_argument("simulation: step_s must be more than 0");
    }
    use_step(std::min(options.step_s, rig.longest_step_s()));
  }

  // The filter chains are designed for one step length; with a constant period this runs once.
  void use_step(double h) {
    step = h;
    bank = SensorBank(model, h);
    errors.emplace(numbers.reading, bank, h);
    if (time > 0.0) errors->settle(error_state, sensors);
    base = FilterChain(model.sensors[index_of(Channel::base_displacement)].filters, h);
    drive = FilterChain(model.sensors[index_of(Channel::drive_force)].filters, h);
    if (numbers.reading.any_delay) input_past.settle(input_outputs(), h);
  }

  void settle() {
    rig.complete(state, now, time, numbers);
    bank.settle(sensors, rig.quantities(state, now, numbers));
    errors->settle(error_state, sensors);
    base.settle(base_memory, now.base_displacement_m, 0.0);
    drive.settle(drive_memory, now.drive_force_n, 0.0);
    if (numbers.reading.any_delay) input_past.settle(input_outputs(), step);
    update_truth();
  }

  // Outputs of the input channels' chains: base displacement, drive force.
  std::array<double, 2> input_outputs() const {
    return {base.output(base_memory), drive.output(drive_memory)};
  }

  void update_truth() {
    truth.displacement_m = state.s[state::x];
    truth.velocity_m_s = state.s[state::v];
    truth.load_cell_deflection_m = state.s[state::y];
    truth.load_cell_velocity_m_s = state.s[state::u];
    truth.slip_velocity_m_s = state.slip;
    truth.theta = state.theta;
    truth.friction_force_n = state.friction;
    truth.normal_load_n = state.load;
  }

  // Of standard deviation 1; correlated where the model says so (a first-order process).
  double unit_noise(Channel channel) {
    const std::size_t c = index_of(channel);
    const double correlation_s = model.sensors[c].noise_correlation_s.value_or(0.0);
    double kept = 0.0;
    if (correlation_s > 0.0 && noise_time[c] >= 0.0) {
      kept = std::exp((noise_time[c] - time) / correlation_s);
    }
    noise_time[c] = time;
    last_noise[c] = kept * last_noise[c] + std::sqrt(1.0 - kept * kept) * normal(random);
    return last_noise[c];
  }

  double with_noise(Channel channel, double value) {
    const auto& noise = model.sensors[index_of(channel)].noise_std;
    if (options.noise && noise) value += *noise * unit_noise(channel);
    const double lsb = options.resolution[index_of(channel)];
    return lsb > 0.0 ? lsb * std::round(value / lsb) : value;
  }

  Model model;
  SimulationOptions options;
  Rig rig;
  RigNumbers<double> numbers;
  std::mt19937_64 random;
  std::normal_distribution<double> normal;
  std::array<double, channel_count> last_noise{};
  std::array<double, channel_count> noise_time = {-1.0, -1.0, -1.0, -1.0, -1.0, -1.0};
  double step = 0.0;
  double time = 0.0;
  std::uint64_t sequence = 0;
  Input now;
  RigState<double> state;
  RigTruth truth;
  SensorBank bank{model, 1.0e-4};
  FilterChain base, drive;
  std::optional<SensorErrors<double>> errors;
  SensorMemory<double> sensors;
  SensorErrorState<double> error_state;
  FilterMemory<double> base_memory, drive_memory;
  DelayLine<std::array<double, 2>> input_past;
};

RigSimulator::RigSimulator(const Model& model, SimulationOptions options, const RigTruth& start)
    : implementation_(std::make_unique<Implementation>(model, options)) {
  auto& s = implementation_->state.s;
  s[state::x] = start.displacement_m;
  s[state::v] = start.velocity_m_s;
  s[state::y] = start.load_cell_deflection_m;
  s[state::u] = start.load_cell_velocity_m_s;
  if (implementation_->rig.has_state(state::contact)) s[state::contact] = start.theta;
  implementation_->settle();
}

RigSimulator::~RigSimulator() = default;
RigSimulator::RigSimulator(RigSimulator&&) noexcept = default;
RigSimulator& RigSimulator::operator=(RigSimulator&&) noexcept = default;

void RigSimulator::set_input(const Input& now) {
  implementation_->now = now;
  if (implementation_->time == 0.0) implementation_->settle();
}

void RigSimulator::advance(double duration_s, const Input& end) {
  Implementation& i = *implementation_;
  const double longest = std::min(i.options.step_s, i.rig.longest_step_s());
  const int steps = std::max(1, static_cast<int>(std::ceil(duration_s / longest - 1.0e-9)));
  const double h = duration_s / steps;
  if (std::abs(h - i.step) > 1.0e-9 * h) i.use_step(h);
  const Input begin = i.now;
  const double start = i.time;
  for (int k = 1; k <= steps; ++k) {
    const Input next = between(begin, end, static_cast<double>(k) / steps);
    i.rig.step(i.state, i.now, next, i.time, h, i.numbers);
    i.now = next;
    i.time = start + k * h;
    i.bank.advance(i.sensors, i.rig.quantities(i.state, i.now, i.numbers));
    if (i.numbers.reading.any_error) i.errors->advance(i.error_state, i.sensors);
    i.base.advance(i.base_memory, next.base_displacement_m, 0.0);
    i.drive.advance(i.drive_memory, next.drive_force_n, 0.0);
    if (i.numbers.reading.any_delay) i.input_past.push(i.input_outputs());
  }
  i.update_truth();
}

Frame RigSimulator::read() {
  Implementation& i = *implementation_;
  const ReadingLaws<double>& laws = i.numbers.reading;
  const Readings<double> readings = laws.any_error
                                        ? i.errors->readings(i.error_state, i.sensors, i.time)
                                        : i.bank.readings(i.sensors);
  const auto input_read = [&](Channel channel, std::size_t which) {
    double value = i.input_outputs()[which];
    if (!laws.any_error) return value;
    const ReadingLaw<double>& law = laws.of[index_of(channel)];
    if (laws.any_delay && law.delay_s != 0.0) {
      value = i.input_past.delayed(
          law.delay_s,
          [which](const std::array<double, 2>& past) -> const double& { return past[which]; });
    }
    return reading_of(law, value, i.time);
  };
  const Structure& structure = i.rig.structure();
  Frame frame;
  frame.time_ns = std::llround(i.time * 1.0e9);
  frame.sequence = i.sequence++;
  const auto put = [&](Channel channel, double value) {
    frame.set(channel, i.with_noise(channel, value));
  };
  put(Channel::displacement, readings.displacement);
  put(Channel::velocity, readings.velocity);
  if (structure.friction) put(Channel::friction_force, readings.friction_force);
  if (structure.loaded) put(Channel::normal_load, readings.normal_load);
  if (structure.excitation == Excitation::base) {
    put(Channel::base_displacement, input_read(Channel::base_displacement, 0));
  }
  if (structure.excitation == Excitation::force) {
    put(Channel::drive_force, input_read(Channel::drive_force, 1));
  }
  return frame;
}

const RigTruth& RigSimulator::truth() const { return implementation_->truth; }

double RigSimulator::time_s() const { return implementation_->time; }

}  // namespace stickslip::physics
