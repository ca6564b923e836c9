// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/request.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "physics/problem.h"

namespace stickslip::scope {

namespace {

using Address6 = std::array<std::uint8_t, 16>;

/// A numeric address as IPv6; IPv4 is mapped.
std::optional<Address6> numeric(const std::string& address) {
  Address6 out{};
  if (inet_pton(AF_INET6, address.c_str(), out.data()) == 1) return out;
  out = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF};
  if (inet_pton(AF_INET, address.c_str(), out.data() + 12) == 1) return out;
  return std::nullopt;
}

char small(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::string in_small_letters(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(), small);
  return out;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool is_of_names(char c) {
  return (small(c) >= 'a' && small(c) <= 'z') || is_digit(c) || c == '.' || c == '-' || c == '_';
}

bool is_of_addresses(char c) {
  return (small(c) >= 'a' && small(c) <= 'f') || is_digit(c) || c == ':' || c == '.';
}

std::optional<std::uint16_t> parse_port(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return {};
  return port;
}

std::string host_words(std::string_view host) {
  std::string out = "this live view does not have the name \"";
  for (const char c : host.substr(0, 80)) {
    // Characters that could be markup or terminal control are not echoed.
    out += is_of_names(c) || c == ':' || c == '[' || c == ']' ? c : '?';
  }
  return out + "\"; declare each of its names with --host-name";
}

const char* const token_words =
    "this live view needs its token: the address ends in /?token=..., as `stickslip scope` "
    "prints it";

}  // namespace

ListenAddress parse_listen_address(const std::string& text) {
  const auto colon = text.rfind(':');
  const auto refuse = [&text]() -> InputError {
    return InputError(
        Problem{"", 0, 0,
                "--listen " + text +
                    ": expected ADDRESS:PORT with a numeric address and a port from 0 "
                    "(any) to 65535, for example 127.0.0.1:8088 or [::1]:8088"});
  };
  if (colon == std::string::npos) throw refuse();
  std::string address = text.substr(0, colon);
  const bool bracketed = address.size() > 2 && address.front() == '[' && address.back() == ']';
  if (bracketed) address = address.substr(1, address.size() - 2);
  const auto port = parse_port(std::string_view(text).substr(colon + 1));
  const bool is_6 = address.find(':') != std::string::npos;
  if (!port || !numeric(address) || is_6 != bracketed) throw refuse();
  return {address, *port};
}

std::string text_of(const ListenAddress& at) {
  const bool is_6 = at.address.find(':') != std::string::npos;
  return (is_6 ? "[" + at.address + "]" : at.address) + ":" + std::to_string(at.port);
}

bool is_loopback(const std::string& address) {
  const auto value = numeric(address);
  if (!value) return false;
  const bool mapped = std::all_of(value->begin(), value->begin() + 10, [](auto b) { return !b; }) &&
                      (*value)[10] == 0xFF && (*value)[11] == 0xFF;
  if (mapped) return (*value)[12] == 127;
  return std::all_of(value->begin(), value->begin() + 15, [](auto b) { return !b; }) &&
         value->back() == 1;
}

bool is_every_address(const std::string& address) {
  return address == "0.0.0.0" || numeric(address) == Address6{};
}

std::optional<HostAndPort> parse_host(std::string_view header) {
  HostAndPort out;
  std::string_view rest;
  if (header.starts_with('[')) {
    const auto end = header.find(']');
    if (end == std::string_view::npos) return {};
    out.host = in_small_letters(header.substr(1, end - 1));
    if (!std::all_of(out.host.begin(), out.host.end(), is_of_addresses)) return {};
    rest = header.substr(end + 1);
  } else {
    const auto colon = std::min(header.find(':'), header.size());
    out.host = in_small_letters(header.substr(0, colon));
    if (!std::all_of(out.host.begin(), out.host.end(), is_of_names)) return {};
    rest = header.substr(colon);
  }
  if (out.host.empty()) return {};
  if (rest.empty()) return out;
  if (rest.front() != ':' || !parse_port(rest.substr(1))) return {};
  out.port = rest.substr(1);
  return out;
}

bool is_host_allowed(std::string_view header, const Admission& admission) {
  const auto given = parse_host(header);
  if (!given) return false;
  if (given->host == "localhost" || is_loopback(given->host)) return true;
  if (const auto address = numeric(given->host)) {
    return is_every_address(admission.listen_address) ||
           address == numeric(admission.listen_address);
  }
  return std::any_of(
      admission.host_names.begin(), admission.host_names.end(),
      [&given](const std::string& name) { return in_small_letters(name) == given->host; });
}

bool is_origin_allowed(std::string_view origin, std::string_view host, const Admission& admission) {
  if (origin.empty()) return true;
  const std::string given = in_small_letters(origin);
  const std::string own = in_small_letters(host);
  if (!own.empty() && (given == "http://" + own || given == "https://" + own)) return true;
  return std::any_of(
      admission.allowed_origins.begin(), admission.allowed_origins.end(),
      [&given](const std::string& allowed) { return in_small_letters(allowed) == given; });
}

bool is_same_secret(std::string_view given, std::string_view expected) {
  unsigned difference = given.size() == expected.size() ? 0U : 1U;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const char against = expected.empty() ? '\0' : expected[i % expected.size()];
    difference |= static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(against);
  }
  return difference == 0;
}

bool is_token(std::string_view word) {
  return !word.empty() &&
         std::all_of(word.begin(), word.end(), [](char c) { return is_of_names(c) || c == '~'; });
}

std::optional<Refusal> refuse_page(const Request& request, const Admission& admission) {
  if (!is_host_allowed(request.host, admission)) return Refusal{403, host_words(request.host)};
  if (request.method != "GET" && request.method != "HEAD") {
    return Refusal{405, "only GET and HEAD are supported"};
  }
  // Scripts and styles are public; data is not.
  const bool is_secret = request.path == "/" || request.path == "/index.html" ||
                         request.path.starts_with(recording_path);
  if (is_secret && !admission.token.empty() && !is_same_secret(request.token, admission.token)) {
    return Refusal{403, token_words};
  }
  return std::nullopt;
}

std::optional<Refusal> refuse_stream(const Request& request, const Admission& admission) {
  if (!is_host_allowed(request.host, admission)) return Refusal{403, host_words(request.host)};
  if (request.method != "GET") return Refusal{405, "the stream is opened by GET"};
  if (request.path != "/stream") return Refusal{404, "the stream is at /stream"};
  if (!is_origin_allowed(request.origin, request.host, admission)) {
    return Refusal{403, "pages of another origin need --allow-origin"};
  }
  if (!admission.token.empty() && !is_same_secret(request.token, admission.token)) {
    return Refusal{403, token_words};
  }
  return std::nullopt;
}

}  // namespace stickslip::scope
