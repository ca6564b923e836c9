#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;

constexpr const char* own_route =
    "sudo ip link set lo up && sudo ip route replace 239.255.76.67/32 dev lo";

TEST(LcmUrls, AreReadAsLcmReadsThem) {
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

TEST(LcmUrlCheck, TellsWhetherTelemetryStaysHere) {
  Needs needs = some_needs();
  EXPECT_THAT(check_lcm_url(needs), is_green());
  needs.lcm_url = "udpm://239.255.76.67:7667?ttl=1";
  EXPECT_THAT(check_lcm_url(needs),
              AllOf(is(Verdict::warn, "leaves this host"),
                    mended_by("export LCM_DEFAULT_URL='udpm://239.255.76.67:7667?ttl=0'")));
  needs.config_file = "my rig.toml";
  EXPECT_THAT(check_lcm_url(needs), mended_by("sed -i 's|udpm://239.255.76.67:7667?ttl=1|"
                                              "udpm://239.255.76.67:7667?ttl=0|' 'my rig.toml'"));
  needs.lcm_url = "udpm://192.168.1.5:7667?ttl=0";
  EXPECT_THAT(check_lcm_url(needs),
              AllOf(is(Verdict::fail, "no multicast address"),
                    mended_by("sed -i 's|udpm://192.168.1.5:7667?ttl=0|"
                              "udpm://239.255.76.67:7667?ttl=0|' 'my rig.toml'")));
}

TEST(LcmChecks, AskNothingOfANetworkThatTheRigDoesNotUse) {
  const FakeHost host;
  Needs silent = some_needs();
  silent.publishes = false;
  Needs memory = some_needs();
  memory.lcm_url = "memq://";
  for (const Needs& needs : {silent, memory}) {
    for (const Finding& finding :
         {check_lcm_url(needs), check_lcm_route(host, needs), check_receive_buffer(host, needs),
          check_lcm_round_trip(host, needs), check_lcm_queue(needs)}) {
      EXPECT_EQ(finding.verdict, Verdict::note) << finding.check;
    }
  }
  EXPECT_EQ(host.probed_url, "");
}

TEST(LoopbackCheck, WantsItUp) {
  FakeHost host;
  EXPECT_THAT(check_loopback(host), is_green());
  host.loopback = false;
  EXPECT_THAT(check_loopback(host),
              AllOf(is(Verdict::fail, "lo is down"), mended_by("sudo ip link set lo up")));
  host.loopback.reset();
  EXPECT_THAT(check_loopback(host), is(Verdict::fail, "no interface lo"));
}

TEST(LcmRouteCheck, WantsOneThatDoesNotGoAway) {
  FakeHost host;
  const Needs needs = some_needs();
  EXPECT_THAT(check_lcm_route(host, needs), is_green());
  host.route.interface = "eth0";
  EXPECT_THAT(check_lcm_route(host, needs),
              AllOf(is(Verdict::warn, "goes through eth0"), mended_by(own_route)));
  Needs shared = some_needs();
  shared.lcm_url = "udpm://239.255.76.67:7667?ttl=1";
  EXPECT_THAT(check_lcm_route(host, shared), is_green());  // it is meant to leave
  host.route = {false, "", "Network is unreachable"};
  EXPECT_THAT(check_lcm_route(host, needs),
              AllOf(is(Verdict::fail, "Network is unreachable"), mended_by(own_route)));
}

TEST(ReceiveBufferCheck, WantsASecondOfTheRig) {
  FakeHost host;
  Needs needs = some_needs();  // 300 messages a second
  EXPECT_THAT(check_receive_buffer(host, needs), is_green());
  EXPECT_EQ(host.asked_receive_buffer, 0);
  host.held = 299;
  const std::string two_mib =
      "printf 'net.core.rmem_max = 2097152\\nnet.core.rmem_default = 2097152\\n' | sudo tee "
      "/etc/sysctl.d/70-stickslip.conf && sudo sysctl --system";
  EXPECT_THAT(check_receive_buffer(host, needs),
              AllOf(is(Verdict::warn, "holds 299 messages"), mended_by(two_mib)));
  host.files["/proc/sys/net/core/rmem_max"] = "4194304";
  EXPECT_THAT(check_receive_buffer(host, needs).command,
              testing::HasSubstr("rmem_max = 4194304\\nnet.core.rmem_default = 2097152"))
      << "what is larger already stays";
  host.held = 29;
  EXPECT_THAT(check_receive_buffer(host, needs), is(Verdict::fail, "0.0967 s of this rig"));
  // A faster rig needs more, and is told how much.
  needs.rate_hz = 20000.0;
  EXPECT_THAT(check_receive_buffer(host, needs).command, testing::HasSubstr("rmem_max = 33554432"));
  needs.lcm_url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4000000";
  check_receive_buffer(host, needs);
  EXPECT_EQ(host.asked_receive_buffer, 4000000);
}

TEST(RoundTripCheck, WantsEveryMessageBack) {
  FakeHost host;
  Needs needs = some_needs();
  EXPECT_THAT(check_lcm_round_trip(host, needs), is_green());
  EXPECT_THAT(check_lcm_round_trip(host, needs),
              is(Verdict::ok, "80 us (median), 300 us (longest)"));
  host.trip = {false, "has no route", 0, 0, 0, 0};
  EXPECT_THAT(check_lcm_round_trip(host, needs),
              AllOf(is(Verdict::fail, "has no route"), mended_by(own_route)));
  host.trip = {true, "", 20, 0, 0, 0};
  EXPECT_THAT(check_lcm_round_trip(host, needs),
              AllOf(is(Verdict::fail, "0 of 20 messages came back"),
                    mended_by("sudo iptables -I INPUT -i lo -d 239.255.76.67 -j ACCEPT")));
  host.trip = {true, "", 20, 18, 80'000, 300'000};
  EXPECT_THAT(check_lcm_round_trip(host, needs),
              AllOf(is(Verdict::warn, "18 of 20"),
                    mended_by("ps -eo pid,cls,rtprio,pcpu,comm --sort=-pcpu | head")));
  host.trip = {true, "", 20, 20, 80'000, 200'000'000};
  EXPECT_THAT(check_lcm_round_trip(host, needs), is(Verdict::warn, "200000 us (longest)"));
}

TEST(RoundTripCheck, NeverLeavesTheHost) {
  const FakeHost host;
  Needs needs = some_needs();
  needs.lcm_url = "udpm://239.255.1.2:7000?ttl=3";
  check_lcm_round_trip(host, needs);
  EXPECT_EQ(host.probed_url, "udpm://239.255.1.2:7000?ttl=0");
}

TEST(LcmQueueCheck, SaysHowFewMessagesLcmKeeps) {
  EXPECT_THAT(check_lcm_queue(some_needs()), is(Verdict::note, "30 messages"));
  EXPECT_THAT(check_lcm_queue(some_needs()), is(Verdict::note, "0.3 s of frames"));
}

}  // namespace
}  // namespace stickslip::doctor
