// SPDX-License-Identifier: Apache-2.0
// Telemetry: delivery by LCM, confinement to this host.
#include <algorithm>
#include <cstdlib>

#include "physics/number_text.h"
#include "protocol/channels.h"
#include "tools/doctor/examination.h"

namespace stickslip::doctor {

namespace {

constexpr int lcm_queue = 30;  // default capacity of a subscriber's queue [messages]

std::string microseconds(std::int64_t ns) { return std::to_string((ns + 500) / 1000) + " us"; }

/// Why network checks do not apply; empty if they do.
std::string not_applicable(const Requirements& required) {
  if (!required.publishes) return "the rig does not publish";
  const LcmUrl url = parse_lcm_url(required.lcm_url);
  if (url.provider != "udpm") return url.provider + " is not LCM's multicast: not checked";
  return {};
}

std::string route_command(const std::string& address) {
  return "sudo ip link set lo up && sudo ip route replace " + address + "/32 dev lo";
}

/// Changes the URL in the rig file, or in the environment if there is no rig file.
std::string url_command(const Requirements& required, const std::string& url) {
  if (required.config_file.empty()) return "export LCM_DEFAULT_URL=" + shell_word(url);
  return "sed -i 's|" + required.lcm_url + "|" + url + "|' " + shell_word(required.config_file);
}

}  // namespace

Finding check_lcm_url(const Requirements& required) {
  const std::string check = "LCM URL";
  const std::string wrong = config::wrong_with_lcm_url(required.lcm_url);
  if (required.publishes && !wrong.empty()) {
    return {check, Verdict::fail, wrong, url_command(required, protocol::default_url)};
  }
  const std::string skipped = not_applicable(required);
  if (!skipped.empty()) return {check, Verdict::note, skipped, ""};
  const LcmUrl url = parse_lcm_url(required.lcm_url);
  const std::string place = url.address + ":" + url.port;
  const std::string own = "udpm://" + place + "?ttl=0";
  if (url.ttl > 0) {
    return {check, Verdict::warn,
            place + ", ttl " + std::to_string(url.ttl) +
                ": telemetry leaves this host, where LCM neither encrypts nor authenticates it",
            url_command(required, own)};
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

Finding check_lcm_route(const Host& host, const Requirements& required) {
  const std::string check = "LCM route";
  const std::string skipped = not_applicable(required);
  if (!skipped.empty()) return {check, Verdict::note, skipped, ""};
  const LcmUrl url = parse_lcm_url(required.lcm_url);
  const Route route = host.route_to(url.address);
  if (!route.found) {
    return {check, Verdict::fail, "no route to " + url.address + ": " + route.reason,
            route_command(url.address)};
  }
  if (route.interface != "lo" && url.ttl == 0) {
    return {check, Verdict::warn,
            url.address + " goes through " + route.interface + ", and is lost when that goes down",
            route_command(url.address)};
  }
  return {check, Verdict::ok, url.address + " goes through " + route.interface, ""};
}

Finding check_receive_buffer(const Host& host, const Requirements& required) {
  const std::string check = "receive buffer";
  const std::string skipped = not_applicable(required);
  if (!skipped.empty()) return {check, Verdict::note, skipped, ""};
  const LcmUrl url = parse_lcm_url(required.lcm_url);
  const std::size_t bytes = required.block_bytes();
  const std::size_t held = host.receive_buffer_messages(bytes, url.receive_buffer_bytes);
  // All messages counted with the size of a block of frames.
  const double seconds = static_cast<double>(held) / required.messages_per_s();
  const std::optional<std::string> limit = host.read("/proc/sys/net/core/rmem_max");
  const std::string found = "holds " + physics::counted(held, "message") + " of " +
                            std::to_string(bytes) + " B, " + short_number(seconds) +
                            " s of this rig" + (limit ? " (net.core.rmem_max " + *limit + ")" : "");
  if (seconds >= 1.0) return {check, Verdict::ok, found, ""};
  // Two seconds, and at least the 2 MiB that LCM's documentation recommends.
  std::size_t wanted = std::size_t{2} << 20U;
  const double per_message = 2.0 * static_cast<double>(bytes) + 1280.0;
  while (static_cast<double>(wanted) < 2.0 * required.messages_per_s() * per_message) wanted *= 2;
  const std::string size = std::to_string(wanted);
  // A larger limit is kept.
  const std::size_t most =
      std::max<std::size_t>(wanted, limit ? std::strtoull(limit->c_str(), nullptr, 10) : 0);
  return {check, seconds >= 0.1 ? Verdict::warn : Verdict::fail,
          found + ": a subscriber that is delayed longer loses messages",
          "printf 'net.core.rmem_max = " + std::to_string(most) + "\\nnet.core.rmem_default = " +
              size + "\\n' | sudo tee /etc/sysctl.d/70-stickslip.conf && sudo sysctl --system"};
}

Finding check_lcm_round_trip(const Host& host, const Requirements& required) {
  const std::string check = "LCM round trip";
  const std::string skipped = not_applicable(required);
  if (!skipped.empty()) return {check, Verdict::note, skipped, ""};
  const LcmUrl url = parse_lcm_url(required.lcm_url);
  // The probe stays on this host even if the URL of the rig has a larger ttl.
  const std::string probe = "udpm://" + url.address + ":" + url.port + "?ttl=0";
  const RoundTrip trip = host.lcm_round_trip(probe, required.block_bytes());
  if (!trip.done) {
    return {check, Verdict::fail, trip.reason, route_command(url.address)};
  }
  const std::string found =
      std::to_string(trip.received) + " of " + physics::counted(trip.sent, "message") + " received";
  if (trip.received == 0) {
    return {check, Verdict::fail, found + ": a filter drops them",
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

Finding check_lcm_queue(const Requirements& required) {
  const std::string check = "LCM queue";
  const std::string skipped = not_applicable(required);
  if (!skipped.empty()) return {check, Verdict::note, skipped, ""};
  return {check, Verdict::note,
          "LCM queues " + std::to_string(lcm_queue) +
              " messages per channel for a slow subscriber, " +
              short_number(lcm_queue * required.frames_per_block / required.rate_hz) +
              " s of frames: call setQueueCapacity(0) in your own programs, as these tools do",
          ""};
}

}  // namespace stickslip::doctor
