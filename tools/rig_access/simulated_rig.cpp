// SPDX-License-Identifier: Apache-2.0
#include "tools/rig_access/simulated_rig.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "diagnosis/shooting.h"
#include "drivers/simulated/simulated_driver.h"
#include "physics/failure.h"
#include "physics/problem.h"

namespace stickslip::rig_access {

namespace {

// Catmull and Rom's spline through the samples: continuous velocities between them.
double value_at(const design::Drive& drive, double time_s) {
  const std::vector<double>& u = drive.samples;
  const double position = time_s / drive.period_s;
  const auto k = static_cast<std::ptrdiff_t>(std::floor(position));
  const auto size = static_cast<std::ptrdiff_t>(u.size());
  const auto at = [&](std::ptrdiff_t i) {
    return i < 0 || i >= size ? 0.0 : u[static_cast<std::size_t>(i)];
  };
  const double t = position - static_cast<double>(k);
  const double a = at(k - 1), b = at(k), c = at(k + 1), d = at(k + 2);
  return b +
         0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)));
}

// Of the noise of a run: the same drive gives the same recording, also in a study that is taken up
// again, and another drive another noise (FNV-1a).
std::uint64_t seed_of(const design::Drive& drive, std::uint64_t seed) {
  std::uint64_t out = 0xcbf29ce484222325U ^ seed;
  for (const double each : drive.samples) {
    out = (out ^ std::bit_cast<std::uint64_t>(each)) * 0x100000001b3U;
  }
  return out >> 12U;
}

void check(const drivers::Result& result) {
  if (!result) throw Failure(std::string("simulated rig: ") + result.message);
}

}  // namespace

investigation::RigFacts facts_of(const config::Rig& rig) {
  investigation::RigFacts out;
  out.name = rig.name;
  out.rate_hz = rig.loop.rate_hz;
  out.force = rig.model.oscillator.excitation == physics::Excitation::force;
  const config::Limits& limits = rig.limits;
  out.limits = out.force ? design::DriveLimits{limits.force_n, limits.force_slew_n_s,
                                               std::numeric_limits<double>::infinity()}
                         : design::DriveLimits{limits.displacement_m, limits.velocity_m_s,
                                               limits.acceleration_m_s2};
  for (std::size_t c = 0; c < channel_count; ++c) {
    out.ranges.low[c] = rig.safety.range[c].low;
    out.ranges.high[c] = rig.safety.range[c].high;
  }
  return investigation::with_displacement_range(out);
}

SimulatedRig::SimulatedRig(const config::Rig& rig) : rig_(rig), facts_(facts_of(rig)) {
  if (rig.driver == config::DriverKind::simulated) return;
  throw InputError(Problem{rig.file.string(), 0, 0,
                           "is no simulated rig: start stickslipd with it, and give its control "
                           "socket by --socket"});
}

protocol::Recording SimulatedRig::run(const design::Drive& drive, std::stop_token stop,
                                      const std::function<void(const std::string&)>&) {
  config::SimulatedDriver settings = rig_.simulated;
  settings.seed = seed_of(drive, settings.seed);
  const double period_s = 1.0 / rig_.loop.rate_hz;
  drivers::SimulatedDriver driver(settings, period_s);
  check(driver.open());
  check(driver.start());
  protocol::Recording out;
  out.source = rig_.name;
  const auto frames = static_cast<std::size_t>(std::ceil(drive.duration_s() / period_s));
  for (std::size_t k = 0; k < frames; ++k) {
    if (stop.stop_requested()) throw diagnosis::Interrupted();
    Frame frame;
    check(driver.read(frame));
    out.channels = static_cast<std::uint8_t>(out.channels | frame.valid);
    out.frames.push_back(frame);
    check(driver.write({value_at(drive, period_s * static_cast<double>(k)), true}));
  }
  driver.stop();
  driver.close();
  return out;
}

}  // namespace stickslip::rig_access
