// SPDX-License-Identifier: Apache-2.0
#include "drivers/factory/make_driver.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "drivers/factory/make_bench.h"
#include "drivers/faults/faulty_driver.h"
#include "drivers/replay/replay_driver.h"
#include "drivers/simulated/simulated_driver.h"

namespace stickslip::drivers {

namespace {

std::unique_ptr<Driver> device_of(const config::Rig& rig, std::vector<Frame> frames_to_replay) {
  if (rig.driver == config::DriverKind::replay) {
    return std::make_unique<ReplayDriver>(std::move(frames_to_replay), rig.replay.speed);
  }
  if (rig.driver == config::DriverKind::bench) return make_bench(rig.bench, rig.loop.rate_hz);
  return std::make_unique<SimulatedDriver>(rig.simulated, 1.0 / rig.loop.rate_hz);
}

/// Median frame period of a recording, robust against gaps. 0 for fewer than two frames.
double period_of(const std::vector<Frame>& frames) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    steps.push_back(frames[i].time_s() - frames[i - 1].time_s());
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

Pace pace_of(const config::Rig& rig, const std::vector<Frame>& frames_to_replay) {
  Pace pace{.period_s = 1.0 / rig.loop.rate_hz, .speed = 1.0};
  if (rig.driver != config::DriverKind::replay) return pace;
  if (const double period_s = period_of(frames_to_replay); period_s > 0.0) pace.period_s = period_s;
  if (rig.replay.speed > 0.0) pace.speed = rig.replay.speed;
  return pace;
}

}  // namespace

std::unique_ptr<Driver> make_driver(const config::Rig& rig, std::vector<Frame> frames_to_replay) {
  if (!rig.faults) return device_of(rig, std::move(frames_to_replay));
  const Pace pace = pace_of(rig, frames_to_replay);
  return std::make_unique<FaultyDriver>(device_of(rig, std::move(frames_to_replay)), *rig.faults,
                                        pace);
}

}  // namespace stickslip::drivers
