// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/ground_truth.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "physics/problem.h"

namespace stickslip::concealment {
namespace {

std::filesystem::path written(const std::string& text) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("stickslip-truth-" + std::to_string(getpid()) + ".json");
  std::ofstream(file) << text;
  return file;
}

TEST(GroundTruth, RoundTrip) {
  GroundTruth truth;
  truth.name = "case-007";
  truth.kind = "single";
  truth.world = "regular";
  truth.verdict = "missing_physics";
  truth.seed = 4321;
  truth.duration_s = 31.0;
  TrueEffect effect;
  effect.id = "gain_error";
  effect.accept = {"gain_error"};
  effect.relations = {"sensor"};
  effect.channel = Channel::velocity;
  effect.when_s = {{3.0, 4.5}};
  effect.parameters["gain"] = {1.05, 0.3, 1.0, true, false};
  effect.snr = 7.5;
  truth.effects.push_back(effect);
  EXPECT_EQ(truth_text(truth).find("nuisances"), std::string::npos);
  truth.nuisances = {{"gain", {{"velocity", 1.004}}}};
  const auto file = written(truth_text(truth));
  const GroundTruth again = read_truth(file);
  std::filesystem::remove(file);
  EXPECT_EQ(truth_text(again), truth_text(truth));
  EXPECT_EQ(again.nuisances["gain"]["velocity"], 1.004);
  ASSERT_EQ(again.effects.size(), 1U);
  EXPECT_EQ(again.effects[0].channel, Channel::velocity);
  EXPECT_EQ(again.effects[0].parameters.at("gain").value, 1.05);
}

TEST(GroundTruth, RefusesAnInvalidFileWithItsNameAndReason) {
  const auto file = written("{\"schema\": 1, \"name\": \"case-001\"}");
  try {
    read_truth(file);
    FAIL() << "was not refused";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(file.string()), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("kind"), std::string::npos) << error.what();
  }
  std::filesystem::remove(file);
  EXPECT_THROW(read_truth("/no/such/truth.json"), InputError);
}

}  // namespace
}  // namespace stickslip::concealment
