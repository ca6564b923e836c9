// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/plant/simulated_plant.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "config/rig.h"

namespace stickslip::emulated {
namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr std::int64_t begin = 7'000 * ms;

class Plant : public testing::Test {
 protected:
  Plant()
      : rig(config::load_rig(std::filesystem::path(STICKSLIP_SOURCE_DIR) / "config" /
                             "simulated.toml")),
        plant(rig.simulated, {.volts_per_unit = 150.0}, begin) {}

  /// Largest base motion in the second of two seconds of 2.5 Hz, 5 mm, with the contact on or off.
  double swing(bool enabled) {
    plant.enable(enabled, begin);
    double most = 0.0;
    for (std::int64_t t = begin; t < begin + 2000 * ms; t += ms) {
      const double s = static_cast<double>(t - begin) * 1e-9;
      plant.drive(2.5 + 150.0 * 5e-3 * std::sin(2.0 * std::numbers::pi * 2.5 * s), t);
      if (s > 1.0) most = std::max(most, std::abs(plant.truth(Channel::base_displacement, t)));
    }
    return most;
  }

  config::Rig rig;
  SimulatedPlant plant;
};

TEST_F(Plant, FollowsTheOutputWhileTheContactIsOn) { EXPECT_NEAR(swing(true), 5e-3, 5e-5); }

TEST_F(Plant, IsAtRestWithoutTheContact) { EXPECT_LT(swing(false), 1e-9); }

TEST_F(Plant, KeepsHistoryForSlowerDevices) {
  swing(true);
  const double now = plant.truth(Channel::displacement, begin + 3000 * ms);
  const double then = plant.truth(Channel::displacement, begin + 2990 * ms);
  EXPECT_NE(now, then);
  EXPECT_EQ(plant.truth(Channel::displacement, begin + 3000 * ms), now);
  EXPECT_EQ(plant.truth(Channel::displacement, begin + 2990 * ms), then);
}

TEST_F(Plant, ReportsTheTimeOfTheLastContactChange) {
  plant.enable(true, begin + 20 * ms);
  plant.enable(true, begin + 30 * ms);
  EXPECT_TRUE(plant.enabled());
  EXPECT_EQ(plant.enabled_since_ns(), begin + 20 * ms);
  plant.enable(false, begin + 40 * ms);
  EXPECT_EQ(plant.enabled_since_ns(), begin + 40 * ms);
}

}  // namespace
}  // namespace stickslip::emulated
