#include "drivers/make_driver.h"

#include <utility>

#include "drivers/replay/replay_driver.h"
#include "drivers/simulated/simulated_driver.h"

namespace stickslip::drivers {

std::unique_ptr<Driver> make_driver(const config::Rig& rig, std::vector<Frame> frames_to_replay) {
  if (rig.driver == config::DriverKind::replay) {
    return std::make_unique<ReplayDriver>(std::move(frames_to_replay), rig.replay.speed);
  }
  return std::make_unique<SimulatedDriver>(rig.simulated, 1.0 / rig.loop.rate_hz);
}

}  // namespace stickslip::drivers
