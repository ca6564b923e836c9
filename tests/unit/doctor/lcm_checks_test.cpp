// SPDX-License-Identifier: Apache-2.0
#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;

constexpr const char* own_route =
    "sudo ip link set lo up && sudo ip route replace 239.255.76.67/32 dev lo";

TEST(LcmUrls, AreParsedAsByLcm) {
  const LcmUrl url = parse_lcm_url("udpm://239.255.1.2:7000?recv_buf_size=100000&ttl=2");
  EXPECT_EQ(url.provider, "udpm");
  EXPECT_EQ(url.address, "239.255.1.2");
  EXPECT_EQ(url.port, "7000");
  EXPECT_EQ(url.ttl, 2);
  EXPECT_EQ(url.receive_buffer_bytes, 100000);
  EXPECT_EQ(parse_lcm_url("udpm://").address, "239.255.76.67");
  EXPECT_EQ(parse_lcm_url("udpm://").port, "7667");
  EXPECT_EQ(parse_lcm_url("udpm://239.255.76.67:7667").ttl, 0);
  EXPECT_EQ(parse_lcm_url("memq://").provider, "memq");
}

TEST(LcmUrlCheck, WarnsIfTelemetryLeavesTheHost) {
  Requirements required = some_requirements();
  EXPECT_THAT(check_lcm_url(required), passes());
  required.lcm_url = "udpm://239.255.76.67:7667?ttl=1";
  EXPECT_THAT(check_lcm_url(required),
              AllOf(is(Verdict::warn, "leaves this host"),
                    remedied_by("export LCM_DEFAULT_URL='udpm://239.255.76.67:7667?ttl=0'")));
  required.config_file = "my rig.toml";
  EXPECT_THAT(check_lcm_url(required),
              remedied_by("sed -i 's|udpm://239.255.76.67:7667?ttl=1|"
                          "udpm://239.255.76.67:7667?ttl=0|' 'my rig.toml'"));
  required.lcm_url = "udpm://192.168.1.5:7667?ttl=0";
  EXPECT_THAT(check_lcm_url(required),
              AllOf(is(Verdict::fail, "not a multicast address"),
                    remedied_by("sed -i 's|udpm://192.168.1.5:7667?ttl=0|"
                                "udpm://239.255.76.67:7667?ttl=0|' 'my rig.toml'")));
}

TEST(LcmUrlCheck, FailsOnWhatAConfigurationCouldNotHave) {
  Requirements required = some_requirements();
  required.lcm_url = "udpm//239.255.76.67:7667";
  EXPECT_THAT(check_lcm_url(required), is(Verdict::fail, "expected udpm://ADDRESS:PORT"));
  required.lcm_url = "udpm://239.255.76.67:7667?tll=0";
  EXPECT_THAT(check_lcm_url(required), is(Verdict::fail, "did you mean ttl?"));
}

TEST(LcmChecks, SkipANetworkThatTheRigDoesNotUse) {
  const FakeHost host;
  Requirements silent = some_requirements();
  silent.publishes = false;
  Requirements memory = some_requirements();
  memory.lcm_url = "memq://";
  for (const Requirements& required : {silent, memory}) {
    for (const Finding& finding :
         {check_lcm_url(required), check_lcm_route(host, required),
          check_receive_buffer(host, required), check_lcm_round_trip(host, required),
          check_lcm_queue(required)}) {
      EXPECT_EQ(finding.verdict, Verdict::note) << finding.check;
    }
  }
  EXPECT_EQ(host.probed_url, "");
}

TEST(LoopbackCheck, RequiresTheInterfaceToBeUp) {
  FakeHost host;
  EXPECT_THAT(check_loopback(host), passes());
  host.loopback = false;
  EXPECT_THAT(check_loopback(host),
              AllOf(is(Verdict::fail, "lo is down"), remedied_by("sudo ip link set lo up")));
  host.loopback.reset();
  EXPECT_THAT(check_loopback(host), is(Verdict::fail, "no interface lo"));
}

TEST(LcmRouteCheck, RequiresARouteThroughLoopback) {
  FakeHost host;
  const Requirements required = some_requirements();
  EXPECT_THAT(check_lcm_route(host, required), passes());
  host.route.interface = "eth0";
  EXPECT_THAT(check_lcm_route(host, required),
              AllOf(is(Verdict::warn, "goes through eth0"), remedied_by(own_route)));
  Requirements shared = some_requirements();
  shared.lcm_url = "udpm://239.255.76.67:7667?ttl=1";
  EXPECT_THAT(check_lcm_route(host, shared), passes());  // leaving the host is intended
  host.route = {false, "", "Network is unreachable"};
  EXPECT_THAT(check_lcm_route(host, required),
              AllOf(is(Verdict::fail, "Network is unreachable"), remedied_by(own_route)));
}

TEST(ReceiveBufferCheck, RequiresOneSecondOfMessages) {
  FakeHost host;
  Requirements required = some_requirements();  // 300 messages a second
  EXPECT_THAT(check_receive_buffer(host, required), passes());
  EXPECT_EQ(host.asked_receive_buffer, 0);
  host.held = 299;
  const std::string two_mib =
      "printf 'net.core.rmem_max = 2097152\\nnet.core.rmem_default = 2097152\\n' | sudo tee "
      "/etc/sysctl.d/70-stickslip.conf && sudo sysctl --system";
  EXPECT_THAT(check_receive_buffer(host, required),
              AllOf(is(Verdict::warn, "holds 299 messages"), remedied_by(two_mib)));
  host.files["/proc/sys/net/core/rmem_max"] = "4194304";
  EXPECT_THAT(check_receive_buffer(host, required).command,
              testing::HasSubstr("rmem_max = 4194304\\nnet.core.rmem_default = 2097152"))
      << "a larger limit is kept";
  host.held = 29;
  EXPECT_THAT(check_receive_buffer(host, required), is(Verdict::fail, "0.0967 s of this rig"));
  // A faster rig needs a larger buffer.
  required.rate_hz = 20000.0;
  EXPECT_THAT(check_receive_buffer(host, required).command,
              testing::HasSubstr("rmem_max = 33554432"));
  required.lcm_url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4000000";
  check_receive_buffer(host, required);
  EXPECT_EQ(host.asked_receive_buffer, 4000000);
}

TEST(RoundTripCheck, RequiresEveryMessage) {
  FakeHost host;
  Requirements required = some_requirements();
  EXPECT_THAT(check_lcm_round_trip(host, required), passes());
  EXPECT_THAT(check_lcm_round_trip(host, required),
              is(Verdict::ok, "80 us (median), 300 us (longest)"));
  host.trip = {false, "has no route", 0, 0, 0, 0};
  EXPECT_THAT(check_lcm_round_trip(host, required),
              AllOf(is(Verdict::fail, "has no route"), remedied_by(own_route)));
  host.trip = {true, "", 20, 0, 0, 0};
  EXPECT_THAT(check_lcm_round_trip(host, required),
              AllOf(is(Verdict::fail, "0 of 20 messages received"),
                    remedied_by("sudo iptables -I INPUT -i lo -d 239.255.76.67 -j ACCEPT")));
  host.trip = {true, "", 20, 18, 80'000, 300'000};
  EXPECT_THAT(check_lcm_round_trip(host, required),
              AllOf(is(Verdict::warn, "18 of 20"),
                    remedied_by("ps -eo pid,cls,rtprio,pcpu,comm --sort=-pcpu | head")));
  host.trip = {true, "", 20, 20, 80'000, 200'000'000};
  EXPECT_THAT(check_lcm_round_trip(host, required), is(Verdict::warn, "200000 us (longest)"));
}

TEST(RoundTripCheck, KeepsTheProbeOnTheHost) {
  const FakeHost host;
  Requirements required = some_requirements();
  required.lcm_url = "udpm://239.255.1.2:7000?ttl=3";
  check_lcm_round_trip(host, required);
  EXPECT_EQ(host.probed_url, "udpm://239.255.1.2:7000?ttl=0");
}

TEST(LcmQueueCheck, ReportsTheCapacity) {
  EXPECT_THAT(check_lcm_queue(some_requirements()), is(Verdict::note, "30 messages"));
  EXPECT_THAT(check_lcm_queue(some_requirements()), is(Verdict::note, "0.3 s of frames"));
}

}  // namespace
}  // namespace stickslip::doctor
