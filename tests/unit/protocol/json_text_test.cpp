// SPDX-License-Identifier: Apache-2.0
#include "protocol/json_text.h"

#include <gtest/gtest.h>

namespace stickslip::protocol {
namespace {

using Json = nlohmann::ordered_json;

TEST(JsonText, GivesNoZeroASign) {
  const Json value = {{"b", -0.0}, {"a", {1, -0.0, {{"c", {-0.0, -1e-300}}}}}, {"text", "-0.0"}};
  EXPECT_EQ(json_text(value, -1), R"({"b":0.0,"a":[1,0.0,{"c":[0.0,-1e-300]}],"text":"-0.0"})");
}

TEST(JsonText, ReplacesBytesThatAreNotUtf8) {
  EXPECT_EQ(json_text(Json{{"name", "a\xff"}}), "{\n  \"name\": \"a\uFFFD\"\n}");
}

}  // namespace
}  // namespace stickslip::protocol
