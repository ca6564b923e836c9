// SPDX-License-Identifier: Apache-2.0
// Access checks of HTTP requests, without a server.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::scope {

/// Address and port of a listening socket.
struct ListenAddress {
  std::string address = "127.0.0.1";  ///< IPv4 or IPv6, numeric, without brackets
  std::uint16_t port = 8088;          ///< 0: any free port
  friend bool operator==(const ListenAddress&, const ListenAddress&) = default;
};

/// "127.0.0.1:8088", "[::1]:8088", "0.0.0.0:0". Throws InputError for other text: names are
/// not resolved, since their address may change.
ListenAddress parse_listen_address(const std::string& text);

/// "127.0.0.1:8088" or "[::1]:8088", as in a URL.
std::string text_of(const ListenAddress& address);

/// 127.0.0.0/8 or ::1.
bool is_loopback(const std::string& address);

/// 0.0.0.0 or ::, every address of this machine.
bool is_every_address(const std::string& address);

/// Host and port of a Host header; the host in lower case, without brackets.
struct HostAndPort {
  std::string host;
  std::string port;  ///< empty: none
};
/// None unless `header` is a host of letters, digits, dots, hyphens and underscores, or an IPv6
/// address in brackets, and an optional port.
std::optional<HostAndPort> parse_host(std::string_view header);

/// Conditions for access.
struct Admission {
  std::string listen_address = "127.0.0.1";
  std::vector<std::string> host_names;       ///< besides loopback and the listen address
  std::vector<std::string> allowed_origins;  ///< besides the page's own, e.g. "https://rig.lab"
  std::string token;                         ///< empty: none required
};

/// The checked parts of a request; a missing header is empty.
struct Request {
  std::string_view method;
  std::string_view path;  ///< without the query
  std::string_view host;
  std::string_view origin;
  std::string_view token;  ///< of the query
};

/// Reason for rejecting a request: HTTP status and sentence.
struct Refusal {
  int status = 403;
  std::string reason;
};

/// True if the page may be requested under this Host header; a foreign page under DNS rebinding
/// sends its own name. Ports are not compared, since a tunnel has its own. A server that listens at
/// every address accepts numeric addresses like declared names.
bool is_host_allowed(std::string_view host, const Admission& admission);

/// True if a page of this origin may open the stream: the page of this server, as named by the Host
/// header, or an allowed one. Programs other than browsers send no origin.
bool is_origin_allowed(std::string_view origin, std::string_view host, const Admission& admission);

/// Comparison in constant time for equal lengths.
bool is_same_secret(std::string_view given, std::string_view expected);

/// True for a valid token: letters, digits and -._~, which need no escaping in a URL.
bool is_token(std::string_view word);

/// Path of a recording's summary; its pieces are below it.
inline constexpr std::string_view recording_path = "/recording";

/// For the page and its files: GET or HEAD, from an allowed host; the page itself and recordings
/// with the token.
std::optional<Refusal> refuse_page(const Request& request, const Admission& admission);

/// For the stream: GET /stream, allowed host and origin, with the token.
std::optional<Refusal> refuse_stream(const Request& request, const Admission& admission);

}  // namespace stickslip::scope
