// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/resolution.h"

#include <gtest/gtest.h>

namespace stickslip::commissioning {
namespace {

config::Rig rig_with(const config::BenchInput& input) {
  config::Rig rig;
  rig.bench.inputs[index_of(Channel::displacement)] = input;
  return rig;
}

TEST(Resolution, OfTheConverterOfAUsb1208fsPlus) {
  const auto step = [](double range_v, bool differential) {
    return step_of(rig_with({"usb_1208fs_plus", "CH0", range_v, differential, 1}),
                   Channel::displacement);
  };
  EXPECT_EQ(step(10.0, false), 20.0 / 2048.0);
  EXPECT_EQ(step(10.0, true), 20.0 / 4096.0);
  EXPECT_EQ(step(1.0, true), 2.0 / 4096.0);
}

TEST(Resolution, OfAnIntegerRegisterIsItsScale) {
  config::Rig rig = rig_with({"conditioner", "force", 10.0, false, 1});
  rig.bench.modbus.emplace_back().name = "conditioner";
  auto& reading = rig.bench.modbus[0].map.registers.emplace_back();
  reading.name = "force";
  reading.scale = -0.01;
  reading.type = config::RegisterType::int32;
  EXPECT_EQ(step_of(rig, Channel::displacement), 0.01);
  reading.type = config::RegisterType::float32;
  EXPECT_EQ(step_of(rig, Channel::displacement), 0.0);
  reading.name = "another";
  EXPECT_EQ(step_of(rig, Channel::displacement), 0.0);
}

TEST(Resolution, OfOtherInputsIsFinerThanTheirNoise) {
  EXPECT_EQ(step_of(rig_with({"labjack_u6", "AIN0", 10.0, false, 1}), Channel::displacement), 0.0);
  EXPECT_EQ(step_of(rig_with({"phidget_bridge", "0", 10.0, false, 128}), Channel::displacement),
            0.0);
  EXPECT_EQ(step_of(config::Rig(), Channel::velocity), 0.0);
}

}  // namespace
}  // namespace stickslip::commissioning
