// SPDX-License-Identifier: Apache-2.0
#include "tools/doctor/report.h"

#include <nlohmann/json.hpp>
#include <set>

#include "fake_host.h"

namespace stickslip::doctor {
namespace {

TEST(Examination, PassesOnASuitableMachine) {
  const auto findings = run_checks(FakeHost(), some_requirements());
  std::set<std::string> names;
  for (const Finding& each : findings) {
    EXPECT_LE(each.verdict, Verdict::note) << each.check << ": " << each.found;
    EXPECT_FALSE(each.found.empty()) << each.check;
    EXPECT_TRUE(names.insert(each.check).second) << each.check << " occurs twice";
  }
  EXPECT_LE(worst(findings), Verdict::note);
}

TEST(Examination, GivesARemedyForEveryProblem) {
  FakeHost host;  // a bare machine, without devices and permissions
  host.files = {{"/proc/sys/kernel/sched_rt_runtime_us", "0"},
                {"/proc/sys/kernel/sched_rt_period_us", "1000000"}};
  host.folders.clear();
  host.entries.clear();
  host.opened = host.connected = host.prioritised = host.locked = {false, 13, "refused"};
  host.group = false;
  host.who = {"ada", false, {}};
  host.running = {"1", "#1", "x86_64"};
  host.loopback.reset();
  host.route = {false, "", "unreachable"};
  host.held = 0;
  host.trip = {false, "no route", 0, 0, 0, 0};
  host.woken = {false, 10, 2'000'000, 3'000'000, 4'000'000, 9'000'000};
  host.free.reset();
  host.wall->synchronised = false;
  std::size_t problems = 0;
  for (const Finding& each : run_checks(host, hardware_requirements())) {
    if (each.verdict < Verdict::warn) continue;
    ++problems;
    EXPECT_FALSE(each.command.empty()) << each.check;
    EXPECT_EQ(each.command.find('\n'), std::string::npos) << each.check;
  }
  EXPECT_GE(problems, 15U);
  EXPECT_EQ(worst(run_checks(host, hardware_requirements())), Verdict::fail);
}

const std::vector<Finding> some = {{"loopback", Verdict::ok, "lo is up", ""},
                                   {"LCM route", Verdict::fail, "none", "sudo ip route"},
                                   {"GPIO", Verdict::note, "none", ""}};

TEST(Report, HasOneLinePerFindingAndItsCommandBelow) {
  EXPECT_EQ(text(some),
            "ok    loopback   lo is up\n"
            "fail  LCM route  none\n"
            "                 $ sudo ip route\n"
            "note  GPIO       none\n"
            "1 ok, 1 note, 0 warnings, 1 failure\n");
}

TEST(Report, IsValidJsonForAnyBytes) {
  auto findings = some;
  findings.push_back({"disk", Verdict::warn, "\xff\"\n", "c"});
  const auto report = nlohmann::json::parse(json(findings));
  EXPECT_EQ(report["schema"], 1);
  EXPECT_EQ(report["verdict"], "fail");
  ASSERT_EQ(report["checks"].size(), 4U);
  EXPECT_TRUE(report["checks"][0]["command"].is_null());
  EXPECT_EQ(report["checks"][1]["command"], "sudo ip route");
  EXPECT_EQ(report["checks"][1]["check"], "LCM route");
  EXPECT_EQ(report["checks"][3]["verdict"], "warn");
}

TEST(ShellWord, IsQuotedIfNecessary) {
  EXPECT_EQ(shell_word("/var/lib/x-1.log"), "/var/lib/x-1.log");
  EXPECT_EQ(shell_word("my rig"), "'my rig'");
  EXPECT_EQ(shell_word("it's"), "'it'\\''s'");
  EXPECT_EQ(shell_word(""), "''");
}

TEST(Requirements, AreReadFromTheRigFile) {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  const Requirements required = requirements_of(rig);
  EXPECT_EQ(required.rate_hz, 1000.0);
  EXPECT_EQ(required.frames_per_block, 10);
  EXPECT_FALSE(required.hardware);
  EXPECT_FALSE(required.records);
  EXPECT_TRUE(required.real_time);
  EXPECT_EQ(required.lcm_url, rig.lcm.url);
  EXPECT_EQ(required.control_socket, "/run/stickslip/control.sock");
  // Ten frames of 65 bytes, and the header.
  EXPECT_GT(required.block_bytes(), 650U);
  EXPECT_LT(required.block_bytes(), 750U);
  EXPECT_EQ(required.messages_per_s(), 300.0);
}

}  // namespace
}  // namespace stickslip::doctor
