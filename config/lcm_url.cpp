// SPDX-License-Identifier: Apache-2.0
#include "config/lcm_url.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

#include "physics/spelling.h"

namespace stickslip::config {

namespace {

constexpr std::array known_providers = {"udpm:", "memq:", "file:", "tcpq:", "mpudpm:"};
constexpr const char* expected_url =
    "expected udpm://ADDRESS:PORT?ttl=N, memq://, tcpq://HOST:PORT or file://PATH";

/// All of `text` as a whole number from 0 to `most`.
std::optional<int> whole(std::string_view text, int most) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool sound = error == std::errc() && end == text.data() + text.size();
  return sound && value >= 0 && value <= most ? std::optional(value) : std::nullopt;
}

std::vector<std::string> parts_of(const std::string& text, char separator) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    if (c == separator) {
      out.emplace_back();
    } else {
      out.back() += c;
    }
  }
  return out;
}

bool is_ipv4(const std::string& address) {
  const std::vector<std::string> octets = parts_of(address, '.');
  return octets.size() == 4 && std::all_of(octets.begin(), octets.end(), [](const auto& octet) {
           return octet.size() <= 3 && whole(octet, 255).has_value();
         });
}

/// The settings behind the question mark.
std::string query_of(const std::string& url) {
  const auto question = url.find('?');
  return question == std::string::npos ? "" : url.substr(question + 1);
}

std::string wrong_with_setting(const std::string& setting) {
  const auto equals = setting.find('=');
  const std::string name = setting.substr(0, equals);
  const std::string value = equals == std::string::npos ? "" : setting.substr(equals + 1);
  if (name == "ttl") {
    return whole(value, 255)
               ? ""
               : "ttl: expected a whole number from 0 to 255, found \"" + value + "\"";
  }
  if (name == "recv_buf_size") {
    return whole(value, 1 << 30)
               ? ""
               : "recv_buf_size: expected a number of bytes, found \"" + value + "\"";
  }
  const std::string meant = physics::nearest(name, {"ttl", "recv_buf_size"});
  return "LCM ignores the setting \"" + name + "\"" +
         (meant.empty() ? "; expected ttl or recv_buf_size" : ": did you mean " + meant + "?");
}

std::string wrong_with_multicast(const std::string& url) {
  const LcmUrl parsed = parse_lcm_url(url);
  const std::string example = ": expected one such as udpm://239.255.76.67:7667?ttl=0";
  if (!is_ipv4(parsed.address)) {
    return "\"" + parsed.address + "\" is not an IPv4 address, which LCM's multicast needs" +
           example;
  }
  if (!is_multicast(parsed.address)) {
    return parsed.address + " is not a multicast address (224.0.0.0 to 239.255.255.255)" + example;
  }
  if (whole(parsed.port, 65535).value_or(0) == 0) {
    return "\"" + parsed.port + "\" is not a port: expected a whole number from 1 to 65535";
  }
  if (query_of(url).empty()) return {};
  for (const std::string& setting : parts_of(query_of(url), '&')) {
    if (std::string wrong = wrong_with_setting(setting); !wrong.empty()) return wrong;
  }
  return {};
}

int number_after(std::string_view text, std::string_view name) {
  const auto at = text.find(name);
  int value = 0;
  if (at != std::string_view::npos) {
    std::from_chars(text.data() + at + name.size(), text.data() + text.size(), value);
  }
  return value;
}

}  // namespace

LcmUrl parse_lcm_url(const std::string& url) {
  LcmUrl out;
  const auto colon = url.find("://");
  out.provider = url.substr(0, colon);
  if (colon == std::string::npos) return out;
  const std::string rest = url.substr(colon + 3);
  const std::string place = rest.substr(0, rest.find('?'));
  out.address = place.substr(0, place.find(':'));
  if (place.find(':') != std::string::npos) out.port = place.substr(place.find(':') + 1);
  if (out.provider == "udpm") {
    // LCM's defaults.
    if (out.address.empty()) out.address = "239.255.76.67";
    if (out.port.empty()) out.port = "7667";
  }
  out.ttl = number_after(query_of(url), "ttl=");
  out.receive_buffer_bytes = number_after(query_of(url), "recv_buf_size=");
  return out;
}

bool is_multicast(const std::string& address) {
  const int first = whole(address.substr(0, address.find('.')), 255).value_or(0);
  return first >= 224 && first <= 239;
}

std::string wrong_with_lcm_url(const std::string& url) {
  const bool known = std::any_of(known_providers.begin(), known_providers.end(),
                                 [&url](const char* each) { return url.starts_with(each); });
  if (!known || url.find("://") == std::string::npos) {
    return std::string(expected_url).append(", found \"").append(url).append("\"");
  }
  return parse_lcm_url(url).provider == "udpm" ? wrong_with_multicast(url) : std::string();
}

std::string reach_of_lcm_url(const std::string& url) {
  const LcmUrl parsed = parse_lcm_url(url);
  if (parsed.provider == "memq") return "stays in this process";
  if (parsed.provider != "udpm") return {};
  if (parsed.ttl == 0) return "stays on this host";
  return "leaves this host, where LCM neither encrypts nor authenticates it; ttl=0 keeps it here";
}

}  // namespace stickslip::config
