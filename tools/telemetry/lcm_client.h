// How a tool joins LCM: where, with what queue, and what a person is told when that fails.
#pragma once

#include <chrono>
#include <csignal>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <string>

#include "tools/command_line/action.h"

namespace stickslip::telemetry {

/// Adds `--url` to a subcommand: the option itself, else LCM_DEFAULT_URL, else the project's group
/// on this host only (protocol/channels.h).
void add_url_option(CLI::App& command, std::string& url);

/// SIGINT and SIGTERM as something to wait for instead of something that interrupts. To be made
/// before any thread is started, LCM's own included: threads inherit what is blocked.
class StopSignals {
 public:
  /// Throws std::runtime_error where the system refuses.
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  int file() const { return file_; }

 private:
  sigset_t before_{};
  int file_ = -1;
};

/// Joins LCM at `url`. Throws InputError, in one line, where the URL is none or the network does
/// not carry it, with what to do.
std::unique_ptr<lcm::LCM> join_lcm(const std::string& url);

/// Throws InputError where LCM could be joined but does not hear itself: its port is taken, or a
/// firewall stands between. To be asked before anything is subscribed to; LCM's own C++ interface
/// ends the program there.
void expect_to_hear(lcm::LCM& lcm);

/// Hands every message on the channels that match the regular expression `channels` to `method` of
/// `listener`. The queue has no limit: LCM's default of 30 loses bursts. Throws InputError where
/// LCM refuses.
template <class Listener>
void listen(lcm::LCM& lcm, const std::string& channels,
            void (Listener::*method)(const lcm::ReceiveBuffer*, const std::string&),
            Listener* listener);

enum class Woken { message, stop, time_out };

/// Waits for a message (then lcm.handle() does not block), a stop signal, or `until`. A stop goes
/// before a message.
Woken wait_for(lcm::LCM& lcm, const StopSignals& stop, std::chrono::steady_clock::time_point until);

/// Waits for a stop signal or `until`; true for the signal.
bool stopped_before(const StopSignals& stop, std::chrono::steady_clock::time_point until);

/// `from` + `seconds`; the end of time where seconds is not positive or beyond what a clock holds.
std::chrono::steady_clock::time_point after(std::chrono::steady_clock::time_point from,
                                            double seconds);

/// What LCM answers when it will not do something, as the exception to throw.
[[noreturn]] void refuse_lcm(const std::string& what);

template <class Listener>
void listen(lcm::LCM& lcm, const std::string& channels,
            void (Listener::*method)(const lcm::ReceiveBuffer*, const std::string&),
            Listener* listener) {
  expect_to_hear(lcm);
  lcm::Subscription* subscription = lcm.subscribe(channels, method, listener);
  if (subscription == nullptr || subscription->setQueueCapacity(0) != 0) {
    refuse_lcm("does not subscribe to " + channels);
  }
}

}  // namespace stickslip::telemetry
