// SPDX-License-Identifier: Apache-2.0
#include "daemon/service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "config/lcm_url.h"
#include "daemon/message_writer.h"
#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST(Overrides, OverrideTheConfiguration) {
  config::Rig rig;
  rig.loop.duration_s = 3.0;
  Overrides overrides;
  overrides.duration_s = 10.0;
  overrides.record = "run.log";
  overrides.lcm_url = "memq://";
  const config::Rig out = with_overrides(rig, overrides);
  EXPECT_EQ(out.loop.duration_s, 10.0);
  EXPECT_TRUE(out.recording.enabled);
  EXPECT_EQ(out.recording.file, "run.log");
  EXPECT_EQ(out.lcm.url, "memq://");
  overrides = {};
  overrides.no_lcm = true;
  EXPECT_FALSE(with_overrides(rig, overrides).lcm.enabled);
  EXPECT_EQ(with_overrides(rig, overrides).loop.duration_s, 3.0);
}

TEST(Overrides, AnLcmUrlIsJudgedAsThatOfAConfiguration) {
  for (const char* wrong : {"udpm://239.255.76.67:99999", "udpm://10.0.0.1:7667", "nonsense://"}) {
    Overrides overrides;
    overrides.lcm_url = wrong;
    EXPECT_EQ(refusal([&] { with_overrides({}, overrides); }),
              std::string("--lcm-url ") + wrong + ": " + config::wrong_with_lcm_url(wrong));
  }
}

TEST(Overrides, WhatTheConfigurationNamesIsNotWritten) {
  config::Rig rig;
  rig.file = "/nowhere/rig.toml";
  rig.text =
      "[rig]\nmodel = \"beam.toml\"\n[metrics]\nfile = \"rig.prom\"\n"
      "[recording]\nfile = \"run.log\"\n[[modbus]]\nmap = \"plc.toml\"\n";
  for (const char* name : {"rig.toml", "beam.toml", "rig.prom", "plc.toml"}) {
    for (auto member : {&Overrides::record, &Overrides::control}) {
      Overrides overrides;
      overrides.*member = std::string("/nowhere/") + name;
      EXPECT_THAT(refusal([&] { with_overrides(rig, overrides); }),
                  testing::AllOf(testing::StartsWith("--"), testing::HasSubstr(name),
                                 testing::HasSubstr("expected another file")));
    }
  }
  Overrides overrides;
  overrides.record = "/nowhere/run.log";
  EXPECT_EQ(with_overrides(rig, overrides).recording.file, "/nowhere/run.log");
}

TEST(Overrides, AnInvalidDurationIsRefused) {
  for (const double duration : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    Overrides overrides;
    overrides.duration_s = duration;
    EXPECT_THAT(refusal([&] { with_overrides({}, overrides); }), testing::HasSubstr("--duration"));
  }
}

TEST(Pacing, IsDecidedByTheConfigurationAndTheDevice) {
  config::Rig rig;
  drivers::Description device;
  EXPECT_EQ(pacing_of(rig, device), Pacing::deadlines);
  device.paced = true;
  EXPECT_EQ(pacing_of(rig, device), Pacing::driver);
  rig.simulated.real_time = false;
  EXPECT_EQ(pacing_of(rig, device), Pacing::free_running);
  rig.driver = config::DriverKind::replay;
  EXPECT_EQ(pacing_of(rig, device), Pacing::driver);
  rig.replay.speed = 0.0;
  EXPECT_EQ(pacing_of(rig, device), Pacing::free_running);
}

TEST(MessageWriters, RefuseInvalidDestinationsWithARemedy) {
  EXPECT_THAT(refusal([] { open_log("run.csv"); }),
              testing::AllOf(testing::HasSubstr("run.log"), testing::HasSubstr("convert")));
  EXPECT_THAT(refusal([] { open_log("/nowhere/at/all/run.log"); }),
              testing::HasSubstr("/nowhere/at/all"));
  EXPECT_THAT(refusal([] { open_lcm("nonsense://x"); }), testing::HasSubstr("nonsense://x"));
  EXPECT_TRUE(open_lcm("memq://")->write("X", {}, 0));
}

}  // namespace
}  // namespace stickslip::daemon
