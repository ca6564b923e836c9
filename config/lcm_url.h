// SPDX-License-Identifier: Apache-2.0
// LCM's URLs: their components, what is wrong with them, and how far they reach.
#pragma once

#include <string>

namespace stickslip::config {

/// Components of an LCM URL.
struct LcmUrl {
  std::string provider;  ///< "udpm"
  std::string address;   ///< "239.255.76.67"
  std::string port;
  int ttl = 0;                   ///< of udpm; LCM's default is 0
  int receive_buffer_bytes = 0;  ///< 0: the host's default
};

LcmUrl parse_lcm_url(const std::string& url);

/// True for 224.0.0.0 to 239.255.255.255.
bool is_multicast(const std::string& address);

/// Why LCM could not use the URL, and what is expected; empty if it can. LCM itself fails without a
/// word, or sends where no program listens.
std::string wrong_with_lcm_url(const std::string& url);

/// "stays on this host", or who else receives the messages; empty if the provider does not say.
std::string reach_of_lcm_url(const std::string& url);

}  // namespace stickslip::config
