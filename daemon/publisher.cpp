// SPDX-License-Identifier: Apache-2.0
// The publisher: messages on LCM.
#include <spdlog/spdlog.h>

#include <cerrno>
#include <cstring>
#include <lcm/lcm-cpp.hpp>

#include "daemon/message_writer.h"
#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

[[noreturn]] void refuse(const std::string& url) {
  throw InputError(
      {"", 0, 0,
       "LCM does not accept the URL '" + url +
           "': expected for example udpm://239.255.76.67:7667?ttl=0, and a route "
           "to its multicast group (on a single host: ip route add 239.255.76.67/32 dev lo); "
           "--no-lcm runs without LCM"});
}

/// True for the providers that can publish. Checked before LCM does, which would print lines of its
/// own.
bool is_supported(const std::string& url) {
  return url.starts_with("udpm://") || url.starts_with("tcpq://") || url.starts_with("memq://");
}

class LcmWriter final : public MessageWriter {
 public:
  explicit LcmWriter(const std::string& url) : url_(url), lcm_(url) {
    if (!lcm_.good()) refuse(url);
  }

  bool write(const std::string& channel, std::span<const std::uint8_t> bytes,
             std::int64_t /*time_us*/) override {
    errno = 0;
    const bool sent =
        lcm_.publish(channel, bytes.data(), static_cast<unsigned int>(bytes.size())) == 0;
    if (sent != sending_) {
      if (sent) {
        spdlog::info("publishing on {} works again", url_);
      } else {
        spdlog::warn(
            "publishing on {} fails ({}); is there a route to its multicast group? On a single "
            "host: "
            "ip route add 239.255.76.67/32 dev lo",
            url_, errno == 0 ? "no reason given" : std::strerror(errno));
      }
      sending_ = sent;
    }
    return sent;
  }

 private:
  std::string url_;
  lcm::LCM lcm_;
  bool sending_ = true;
};

}  // namespace

std::unique_ptr<MessageWriter> open_lcm(const std::string& url) {
  if (!is_supported(url)) refuse(url);
  return std::make_unique<LcmWriter>(url);
}

}  // namespace stickslip::daemon
