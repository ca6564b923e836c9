// SPDX-License-Identifier: Apache-2.0
// LCM for the tools: URL option, joining, subscription without queue limit, waiting, stop signals.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <csignal>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <string>

namespace stickslip::telemetry {

/// Adds `--url` to a subcommand. The default is LCM_DEFAULT_URL, or protocol::default_url, which
/// stays on this host. A URL that a configuration could not have is refused likewise.
void add_url_option(CLI::App& command, std::string& url);

/// Blocks SIGINT and SIGTERM and makes them available as a file to poll. Must be constructed before
/// any thread is started, including that of LCM, since threads inherit the signal mask.
class StopSignals {
 public:
  /// Throws Failure if the system refuses.
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  int file() const { return file_; }

 private:
  sigset_t before_{};
  int file_ = -1;
};

/// Joins LCM at `url`. Throws InputError with the remedy if the URL is invalid or there is no
/// route.
std::unique_ptr<lcm::LCM> join_lcm(const std::string& url);

/// Throws InputError if LCM cannot receive: its port is taken, or a firewall drops multicast. Must
/// be called before the first subscription, in which LCM's C++ interface would terminate the
/// program.
void check_reception(lcm::LCM& lcm);

/// Passes every message on the channels that match the regular expression `channels` to the member
/// function `method(const lcm::ReceiveBuffer*, const std::string& channel)` of `listener`. The
/// queue is unlimited: LCM's default of 30 messages loses bursts. Throws InputError if LCM refuses.
template <auto method, class Listener>
void listen(lcm::LCM& lcm, const std::string& channels, Listener* listener);

enum class Wake { message, stop, time_out };

/// Waits for a message (lcm.handle() will not block), a stop signal, or `until`. A stop signal
/// takes precedence over a message.
Wake wait_for(lcm::LCM& lcm, const StopSignals& stop, std::chrono::steady_clock::time_point until);

/// Waits for a stop signal or `until`; true if a signal arrived.
bool stopped_before(const StopSignals& stop, std::chrono::steady_clock::time_point until);

/// `from` + `seconds`; a century later if seconds is not positive or exceeds the range of the
/// clock.
std::chrono::steady_clock::time_point after(std::chrono::steady_clock::time_point from,
                                            double seconds);

/// Throws InputError("LCM " + problem).
[[noreturn]] void throw_lcm_error(const std::string& problem);

template <auto method, class Listener>
void listen(lcm::LCM& lcm, const std::string& channels, Listener* listener) {
  check_reception(lcm);
  // Not subscribe(): GCC 12's undefined-behaviour sanitizer miscompiles its call through a pointer
  // to a member.
  const auto pass = [](const lcm::ReceiveBuffer* buffer, const std::string& channel,
                       Listener* receiver) { (receiver->*method)(buffer, channel); };
  lcm::Subscription* subscription = lcm.subscribeFunction<Listener*>(channels, pass, listener);
  if (subscription == nullptr || subscription->setQueueCapacity(0) != 0) {
    throw_lcm_error("does not subscribe to " + channels);
  }
}

}  // namespace stickslip::telemetry
