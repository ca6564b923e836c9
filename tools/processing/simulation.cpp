// SPDX-License-Identifier: Apache-2.0
#include "tools/processing/simulation.h"

#include <algorithm>
#include <vector>

#include "physics/input.h"
#include "physics/integration_cost.h"
#include "physics/problem.h"

namespace stickslip::processing {

namespace {

// Derivatives of non-uniform samples by a quartic through five neighbours: a parabola is too coarse
// for the acceleration of the base.
struct Derivatives {
  double first = 0.0;
  double second = 0.0;
};

Derivatives derivatives_at(const std::vector<double>& t, const std::vector<double>& y,
                           std::size_t i) {
  const std::size_t n = t.size();
  const std::size_t points = std::min<std::size_t>(5, n);
  const std::size_t from = std::min(i >= 2 ? i - 2 : 0, n - points);
  // Derivatives at t[i] of the Lagrange basis polynomials.
  Derivatives out;
  for (std::size_t j = from; j < from + points; ++j) {
    double first = 0.0;
    double second = 0.0;
    for (std::size_t k = from; k < from + points; ++k) {
      if (k == j) continue;
      double product = 1.0;
      for (std::size_t l = from; l < from + points; ++l) {
        if (l != j && l != k) product *= (t[i] - t[l]) / (t[j] - t[l]);
      }
      first += product / (t[j] - t[k]);
      for (std::size_t l = from; l < from + points; ++l) {
        if (l == j || l == k) continue;
        double rest = 1.0;
        for (std::size_t q = from; q < from + points; ++q) {
          if (q != j && q != k && q != l) rest *= (t[i] - t[q]) / (t[j] - t[q]);
        }
        second += rest / ((t[j] - t[k]) * (t[j] - t[l]));
      }
    }
    out.first += first * y[j];
    out.second += second * y[j];
  }
  return out;
}

std::vector<physics::Input> inputs_of(const protocol::Recording& drive, const physics::Model& model,
                                      const std::vector<double>& time) {
  const auto column = [&](Channel channel, const char* role) {
    std::vector<double> values;
    for (const Frame& frame : drive.frames) {
      if (!frame.has(channel)) {
        throw InputError(Problem{drive.source, 0, 0,
                                 "lacks " + std::string(info(channel).column) + " at time " +
                                     std::to_string(frame.time_s()) + " s, which " + role});
      }
      values.push_back(frame[channel]);
    }
    return values;
  };
  std::vector<physics::Input> inputs(drive.frames.size());
  switch (model.oscillator.excitation) {
    case physics::Excitation::base: {
      const auto b = column(Channel::base_displacement, "drives a base-excited rig");
      for (std::size_t i = 0; i < b.size(); ++i) {
        inputs[i].base_displacement_m = b[i];
        inputs[i].base_acceleration_m_s2 = derivatives_at(time, b, i).second;
      }
      break;
    }
    case physics::Excitation::force: {
      const auto f = column(Channel::drive_force, "drives a force-excited rig");
      for (std::size_t i = 0; i < f.size(); ++i) inputs[i].drive_force_n = f[i];
      break;
    }
    case physics::Excitation::imposed: {
      const auto x = column(Channel::displacement, "is the imposed motion");
      for (std::size_t i = 0; i < x.size(); ++i) {
        inputs[i].displacement_m = x[i];
        inputs[i].velocity_m_s = derivatives_at(time, x, i).first;
      }
      break;
    }
  }
  if (model.normal_load && model.normal_load->law == physics::NormalLoadLaw::measured) {
    const auto load = column(Channel::normal_load, "the normal-load law \"measured\" takes as N");
    for (std::size_t i = 0; i < load.size(); ++i) inputs[i].normal_load_n = load[i];
  }
  return inputs;
}

// Sample times from 0. Refuses gaps over which an interpolated excitation has no meaning.
std::vector<double> times_of(const protocol::Recording& drive) {
  constexpr double longest_s = 3600.0;
  std::vector<double> time;
  for (const Frame& frame : drive.frames) {
    time.push_back(static_cast<double>(frame.time_ns - drive.frames.front().time_ns) * 1.0e-9);
    if (time.size() < 2) continue;
    const double gap_s = time.back() - time[time.size() - 2];
    if (gap_s <= longest_s) continue;
    throw InputError(Problem{drive.source, 0, 0,
                             "the sample at " + std::to_string(frame.time_s()) + " s comes " +
                                 std::to_string(gap_s) + " s after the one before; expected at " +
                                 "most " + std::to_string(longest_s) + " s"});
  }
  return time;
}

}  // namespace

protocol::Recording simulated(const physics::Model& model, const std::string& model_name,
                              const protocol::Recording& drive,
                              const physics::SimulationOptions& options,
                              const protocol::ProgressCallback& done) {
  if (drive.frames.size() < 5) {
    throw InputError(Problem{drive.source, 0, 0, "contains fewer than 5 samples"});
  }
  const std::vector<double> time = times_of(drive);
  const auto inputs = inputs_of(drive, model, time);
  const std::string wrong = physics::wrong_with_simulation(model, time.back());
  if (!wrong.empty()) throw InputError(Problem{model_name, 0, 0, wrong});

  physics::RigSimulator simulator(model, options);
  simulator.set_input(inputs.front());
  protocol::Recording out;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (done) done(static_cast<double>(i) / static_cast<double>(inputs.size()));
    if (i > 0) simulator.advance(time[i] - time[i - 1], inputs[i]);
    Frame frame = simulator.read();
    frame.time_ns = drive.frames[i].time_ns;
    out.channels |= frame.valid;
    out.frames.push_back(frame);
  }
  return out;
}

}  // namespace stickslip::processing
