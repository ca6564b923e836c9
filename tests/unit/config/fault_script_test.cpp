// SPDX-License-Identifier: Apache-2.0
#include "config/fault_script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "config/document.h"
#include "config/key.h"
#include "config/key_tables.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

const std::filesystem::path library = STICKSLIP_SOURCE_DIR "/config/faults";

std::vector<std::string> problems_of(const std::string& text) {
  std::vector<std::string> lines;
  try {
    parse_fault_script(text, "f");
  } catch (const InputError& error) {
    for (const Problem& problem : error.problems()) lines.push_back(problem.text());
  }
  return lines;
}

/// A script of one fault with these keys, one per line from the third line on.
std::string one(const std::string& keys) { return "schema = 1\n[[fault]]\n" + keys; }

TEST(FaultScript, EveryKeyIsRead) {
  const FaultScript script = parse_fault_script(R"(schema = 1
seed = 42
[[fault]]
kind = "noise"
channel = "velocity"
between_s = [1, 2.5]
duration_s = 0.5
every_s = 10
probability = 0.25
amount = 0.125
[[fault]]
kind = "delay"
at_s = 3
amount = 0.5
reported = true
[[fault]]
kind = "stall"
at_s = 4
amount = 0.25
stall_blocking = true
)",
                                                "f");
  EXPECT_EQ(script.seed, 42U);
  EXPECT_EQ(script.file, "f");
  ASSERT_EQ(script.faults.size(), 3U);
  Fault noise;
  noise.kind = FaultKind::noise;
  noise.channel = Channel::velocity;
  noise.from_s = 1.0;
  noise.to_s = 2.5;
  noise.duration_s = 0.5;
  noise.every_s = 10.0;
  noise.probability = 0.25;
  noise.amount = 0.125;
  EXPECT_EQ(script.faults[0], noise);
  Fault delay;
  delay.kind = FaultKind::delay;
  delay.from_s = delay.to_s = 3.0;
  delay.amount = 0.5;
  delay.reported = true;
  EXPECT_EQ(script.faults[1], delay);
  Fault stall;
  stall.kind = FaultKind::stall;
  stall.from_s = stall.to_s = 4.0;
  stall.amount = 0.25;
  stall.duration_s = 0.25;
  stall.stall_blocking = true;
  EXPECT_EQ(script.faults[2], stall);
}

TEST(FaultScript, IsValidWithoutFaults) {
  const FaultScript script = parse_fault_script("schema = 1\n", "f");
  EXPECT_EQ(script.seed, 1U);
  EXPECT_TRUE(script.faults.empty());
}

TEST(FaultScript, InconsistentKeysAreRefused) {
  const auto only = [](const std::string& keys, const char* line) {
    EXPECT_THAT(problems_of(one(keys)), testing::ElementsAre(testing::StartsWith(line))) << keys;
  };
  only("kind = \"unplug\"\n", "f:2:1: fault.unplug.at_s: is missing");
  only("kind = \"unplug\"\nat_s = 1\nbetween_s = [1, 2]\n",
       "f:5:13: fault.unplug.between_s: is given together with at_s");
  only("kind = \"drop\"\nat_s = 1\nevery_s = 2\n", "f:2:1: fault.drop.duration_s: is missing");
  only("kind = \"drop\"\nat_s = 1\nevery_s = 2\nduration_s = 3\n",
       "f:5:11: fault.drop.every_s: is 2 s, but");
  only("kind = \"drop\"\nbetween_s = [1, 3]\nevery_s = 2.5\nduration_s = 1\n",
       "f:5:11: fault.drop.every_s: is 2.5 s, but");
  only("kind = \"stall\"\nat_s = 1\nevery_s = 0.5\namount = 0.6\n",
       "f:5:11: fault.stall.every_s: is 0.5 s, but");
  only("kind = \"drift\"\nat_s = 1\namount = 0\n", "f:5:10: fault.drift.amount: is 0");
  EXPECT_THAT(problems_of(one("kind = \"drop\"\nat_s = 1\nevery_s = 0.3\nduration_s = 0.3\n")),
              testing::IsEmpty());
}

TEST(FaultScript, MessagesDescribeTheAmountOfEachKind) {
  for (const Key& amount : fault_amount_keys()) {
    const std::string kind(amount.path);
    const std::string head = "kind = \"" + kind + "\"\nat_s = 1\n";
    const auto missing = problems_of(one(head));
    ASSERT_EQ(missing.size(), 1U) << kind;
    EXPECT_THAT(missing[0], testing::HasSubstr("fault." + kind + ".amount is missing with kind"));
    EXPECT_THAT(missing[0], testing::HasSubstr(std::string(amount.sentence)));
    const auto wrong = problems_of(one(head + "amount = \"much\"\n"));
    ASSERT_EQ(wrong.size(), 1U) << kind;
    EXPECT_THAT(wrong[0], testing::HasSubstr("expected a number"));
    EXPECT_THAT(wrong[0], testing::HasSubstr("found \"much\""));
  }
}

TEST(FaultScript, TooManyFaultsAreRefused) {
  std::string text = "schema = 1\n";
  for (int i = 0; i < 256; ++i) text += "[[fault]]\nkind = \"drop\"\nat_s = 1\n";
  EXPECT_THAT(problems_of(text), testing::IsEmpty());
  text += "[[fault]]\nkind = \"drop\"\nat_s = 1\n";
  EXPECT_THAT(problems_of(text),
              testing::ElementsAre(testing::StartsWith("f:770:1: fault: more than 256")));
}

TEST(FaultScript, IsDescribedInWords) {
  const auto words = [](const std::string& keys) {
    return in_words(parse_fault_script(one(keys), "f").faults.at(0));
  };
  EXPECT_EQ(words("kind = \"noise\"\nchannel = \"velocity\"\nat_s = 2\nduration_s = 3\n"
                  "every_s = 10\nprobability = 0.5\namount = 0.01\n"),
            "noise on velocity, standard deviation 0.01: at 2 s for 3 s, every 10 s, 50 % of the "
            "frames");
  EXPECT_EQ(words("kind = \"unplug\"\nbetween_s = [2, 4.5]\n"),
            "the device is unplugged: at a random time from 2 s to 4.5 s to the end");
  EXPECT_EQ(words("kind = \"delay\"\nat_s = 0\namount = 0.02\n"),
            "delay of 0.02 s on all channels, not reported: at 0 s to the end");
  EXPECT_EQ(words("kind = \"clock_jump\"\nat_s = 1\namount = -2\n"),
            "the device's clock is 2 s behind: at 1 s to the end");
  EXPECT_EQ(words("kind = \"write_error\"\nat_s = 1\nduration_s = 1\nprobability = 0.1\n"),
            "writes fail: at 1 s for 1 s, 10 % of the writes");
}

TEST(FaultLibrary, HasAValidScriptForEachKindAndOneForAll) {
  const auto kinds = find_key(keys_of<Fault>(), "kind")->choices;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const auto file = library / (std::string(kinds[i]) + ".toml");
    EXPECT_EQ(kind_of(read_text(file)), FileKind::fault_script);
    const FaultScript script = load_fault_script(file);
    ASSERT_FALSE(script.faults.empty()) << kinds[i];
    for (const Fault& fault : script.faults) EXPECT_EQ(fault.kind, static_cast<FaultKind>(i));
  }
  std::set<FaultKind> all;
  for (const Fault& fault : load_fault_script(library / "everything.toml").faults) {
    all.insert(fault.kind);
    EXPECT_FALSE(in_words(fault).empty());
  }
  EXPECT_EQ(all.size(), fault_kind_count);
}

TEST(FaultLibrary, HasNoOtherFiles) {
  const auto kinds = find_key(keys_of<Fault>(), "kind")->choices;
  for (const auto& entry : std::filesystem::directory_iterator(library)) {
    const std::string name = entry.path().stem().string();
    EXPECT_TRUE(name == "everything" || std::find(kinds.begin(), kinds.end(), name) != kinds.end())
        << entry.path();
    EXPECT_NO_THROW(load_fault_script(entry.path())) << entry.path();
  }
}

}  // namespace
}  // namespace stickslip::config
