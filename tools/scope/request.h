// Who may ask for what: the checks of a request, without a server.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::scope {

/// An address and a port to listen at.
struct ListenAddress {
  std::string address = "127.0.0.1";  ///< IPv4 or IPv6, numeric, without brackets
  std::uint16_t port = 8088;          ///< 0: any that is free
  friend bool operator==(const ListenAddress&, const ListenAddress&) = default;
};

/// "127.0.0.1:8088", "[::1]:8088", "0.0.0.0:0". Throws InputError where `text` is none: names are
/// not looked up, since what they lead to may change.
ListenAddress parse_listen_address(const std::string& text);

/// "127.0.0.1:8088" or "[::1]:8088", as a URL has it.
std::string text_of(const ListenAddress& address);

/// 127.0.0.0/8 or ::1.
bool is_loopback(const std::string& address);

/// 0.0.0.0 or ::, which mean every address of this machine.
bool is_every_address(const std::string& address);

/// A host and a port as a Host header has them; the host is in small letters and without brackets.
struct HostAndPort {
  std::string host;
  std::string port;  ///< empty: none was given
};
/// Nothing where `header` is not exactly that: a host of letters, digits, dots, hyphens and
/// underscores, or an IPv6 address in brackets, and perhaps a port.
std::optional<HostAndPort> parse_host(std::string_view header);

/// What a request must be to be answered.
struct Admission {
  std::string listen_address = "127.0.0.1";
  std::vector<std::string> host_names;       ///< beside loopback and the listen address
  std::vector<std::string> allowed_origins;  ///< beside the page's own, as "https://rig.lab"
  std::string token;                         ///< empty: none is asked for
};

/// What of a request the checks look at; a header that was not sent is empty.
struct Request {
  std::string_view method;
  std::string_view path;  ///< without the query
  std::string_view host;
  std::string_view origin;
  std::string_view token;  ///< of the query
};

/// Why a request is turned away: an HTTP status and a sentence.
struct Refusal {
  int status = 403;
  std::string reason;
};

/// Whether a page may be asked for under this Host header. A page elsewhere whose name is made to
/// lead here (DNS rebinding) still asks for its own name. Ports are not compared: a tunnel has its
/// own. Where every address is listened at, an address is as good as a name that was declared.
bool is_host_allowed(std::string_view host, const Admission& admission);

/// Whether a page of this origin may open the stream: the page of this very server, as the Host
/// header calls it, or one that was allowed. A program that is no browser sends no origin.
bool is_origin_allowed(std::string_view origin, std::string_view host, const Admission& admission);

/// Compares in a time that depends on the lengths only.
bool is_same_secret(std::string_view given, std::string_view expected);

/// Whether `word` can be a token: letters, digits and -._~ only, which a URL carries as they are.
bool is_token(std::string_view word);

/// For the page and its files: GET or HEAD, from an allowed host; the page itself with the token.
std::optional<Refusal> refuse_page(const Request& request, const Admission& admission);

/// For the stream: GET /stream, allowed host and origin, with the token.
std::optional<Refusal> refuse_stream(const Request& request, const Admission& admission);

}  // namespace stickslip::scope
