// Telemetry: does LCM carry what the rig publishes, and does it stay on this host?
#include <algorithm>
#include <cstdlib>

#include "tools/doctor/examination.h"

namespace stickslip::doctor {

namespace {

constexpr int lcm_queue = 30;  // messages that LCM keeps for a subscriber unless told otherwise

std::string microseconds(std::int64_t ns) { return std::to_string((ns + 500) / 1000) + " us"; }

/// Why the network is not asked; empty where it is.
std::string no_network(const Needs& needs) {
  if (!needs.publishes) return "the rig does not publish";
  const LcmUrl url = parse_lcm_url(needs.lcm_url);
  if (url.provider != "udpm") return url.provider + " is not LCM's multicast: not looked at";
  return {};
}

std::string route_command(const std::string& address) {
  return "sudo ip link set lo up && sudo ip route replace " + address + "/32 dev lo";
}

bool is_multicast(const std::string& address) {
  const int first = std::atoi(address.c_str());
  return first >= 224 && first <= 239;
}

/// In the rig's file, or in the environment that names the URL.
std::string url_command(const Needs& needs, const std::string& url) {
  if (needs.config_file.empty()) return "export LCM_DEFAULT_URL=" + shell_word(url);
  return "sed -i 's|" + needs.lcm_url + "|" + url + "|' " + shell_word(needs.config_file);
}

}  // namespace

Finding check_lcm_url(const Needs& needs) {
  const std::string check = "LCM URL";
  const std::string not_asked = no_network(needs);
  if (!not_asked.empty()) return {check, Verdict::note, not_asked, ""};
  const LcmUrl url = parse_lcm_url(needs.lcm_url);
  const std::string place = url.address + ":" + url.port;
  const std::string own = "udpm://" + place + "?ttl=0";
  if (!is_multicast(url.address)) {
    return {check, Verdict::fail,
            url.address + " is no multicast address (224.0.0.0 to 239.255.255.255)",
            url_command(needs, "udpm://239.255.76.67:" + url.port + "?ttl=0")};
  }
  if (url.ttl > 0) {
    return {check, Verdict::warn,
            place + ", ttl " + std::to_string(url.ttl) +
                ": telemetry leaves this host, where LCM keeps nobody from reading or forging it",
            url_command(needs, own)};
  }
  return {check, Verdict::ok, place + ", ttl 0: stays on this host", ""};
}

Finding check_loopback(const Host& host) {
  const std::string check = "loopback";
  const std::optional<bool> up = host.interface_up("lo");
  if (up.value_or(false)) return {check, Verdict::ok, "lo is up", ""};
  return {check, Verdict::fail, up ? "lo is down" : "there is no interface lo",
          "sudo ip link set lo up"};
}

Finding check_lcm_route(const Host& host, const Needs& needs) {
  const std::string check = "LCM route";
  const std::string not_asked = no_network(needs);
  if (!not_asked.empty()) return {check, Verdict::note, not_asked, ""};
  const LcmUrl url = parse_lcm_url(needs.lcm_url);
  const Route route = host.route_to(url.address);
  if (!route.there) {
    return {check, Verdict::fail, "there is none for " + url.address + ": " + route.words,
            route_command(url.address)};
  }
  if (route.interface != "lo" && url.ttl == 0) {
    return {check, Verdict::warn,
            url.address + " goes through " + route.interface + ", and is gone when that goes down",
            route_command(url.address)};
  }
  return {check, Verdict::ok, url.address + " goes through " + route.interface, ""};
}

Finding check_receive_buffer(const Host& host, const Needs& needs) {
  const std::string check = "receive buffer";
  const std::string not_asked = no_network(needs);
  if (!not_asked.empty()) return {check, Verdict::note, not_asked, ""};
  const LcmUrl url = parse_lcm_url(needs.lcm_url);
  const std::size_t bytes = needs.block_bytes();
  const std::size_t held = host.messages_held(bytes, url.receive_buffer_bytes);
  // Every message counted as large as a block of frames.
  const double seconds = static_cast<double>(held) / needs.messages_per_s();
  const std::optional<std::string> limit = host.read("/proc/sys/net/core/rmem_max");
  const std::string found = "holds " + std::to_string(held) + " messages of " +
                            std::to_string(bytes) + " B, " + number(seconds) + " s of this rig" +
                            (limit ? " (net.core.rmem_max " + *limit + ")" : "");
  if (seconds >= 1.0) return {check, Verdict::ok, found, ""};
  // Two seconds, and never less than what LCM's own documentation asks for.
  std::size_t wanted = std::size_t{2} << 20U;
  const double per_message = 2.0 * static_cast<double>(bytes) + 1280.0;
  while (static_cast<double>(wanted) < 2.0 * needs.messages_per_s() * per_message) wanted *= 2;
  const std::string size = std::to_string(wanted);
  // What is larger already stays.
  const std::size_t most =
      std::max<std::size_t>(wanted, limit ? std::strtoull(limit->c_str(), nullptr, 10) : 0);
  return {check, seconds >= 0.1 ? Verdict::warn : Verdict::fail,
          found + ": a subscriber that is kept waiting longer loses some",
          "printf 'net.core.rmem_max = " + std::to_string(most) + "\\nnet.core.rmem_default = " +
              size + "\\n' | sudo tee /etc/sysctl.d/70-stickslip.conf && sudo sysctl --system"};
}

Finding check_lcm_round_trip(const Host& host, const Needs& needs) {
  const std::string check = "LCM round trip";
  const std::string not_asked = no_network(needs);
  if (!not_asked.empty()) return {check, Verdict::note, not_asked, ""};
  const LcmUrl url = parse_lcm_url(needs.lcm_url);
  // Whatever the rig says, the probe stays on this host.
  const std::string probe = "udpm://" + url.address + ":" + url.port + "?ttl=0";
  const RoundTrip trip = host.lcm_round_trip(probe, needs.block_bytes());
  if (!trip.done) {
    return {check, Verdict::fail, trip.words, route_command(url.address)};
  }
  const std::string found =
      std::to_string(trip.received) + " of " + std::to_string(trip.sent) + " messages came back";
  if (trip.received == 0) {
    return {check, Verdict::fail, found + ": something filters them",
            "sudo iptables -I INPUT -i lo -d " + url.address + " -j ACCEPT"};
  }
  const std::string times = ", in " + microseconds(trip.median_ns) + " (median), " +
                            microseconds(trip.longest_ns) + " (longest)";
  if (trip.received < trip.sent || trip.longest_ns > 100'000'000) {
    return {check, Verdict::warn, found + times,
            "ps -eo pid,cls,rtprio,pcpu,comm --sort=-pcpu | head"};
  }
  return {check, Verdict::ok, found + times, ""};
}

Finding check_lcm_queue(const Needs& needs) {
  const std::string check = "LCM queue";
  const std::string not_asked = no_network(needs);
  if (!not_asked.empty()) return {check, Verdict::note, not_asked, ""};
  return {check, Verdict::note,
          "LCM keeps " + std::to_string(lcm_queue) +
              " messages of a channel for a slow subscriber, " +
              number(lcm_queue * needs.frames_per_block / needs.rate_hz) +
              " s of frames: call setQueueCapacity(0) in yours, as these tools do",
          ""};
}

}  // namespace stickslip::doctor
