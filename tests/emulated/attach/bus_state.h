// SPDX-License-Identifier: Apache-2.0
// State shared by the library replacements: attached devices and pending requests. Not for tests.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

/// A device from plug to unplug.
struct Plugged {
  UsbDevice* device = nullptr;  // null once it is unplugged
  std::uint8_t port = 0;
  std::uint8_t address = 0;
  bool refused = false;
  bool kernel_driver = false;
  std::uint8_t configuration = 1;
  Bytes device_descriptor;
  Bytes configuration_descriptor;
  std::set<const void*> claims;  // handles that claimed its interface

  std::uint16_t vendor_id() const;
  std::uint16_t product_id() const;
  /// wMaxPacketSize of an endpoint address, that of endpoint 0 included; 0: no such endpoint.
  std::size_t packet_size(std::uint8_t endpoint_address) const;
};
using PluggedPtr = std::shared_ptr<Plugged>;

enum class Ending { completed, timed_out, cancelled, stall, no_device, overflow };

/// One request to an endpoint. The buffer belongs to the caller and must live until the end.
struct Request {
  PluggedPtr plugged;
  std::uint8_t endpoint = 0;     // address with the direction bit; 0: a control request
  UsbSetup setup;                // control only
  std::span<std::uint8_t> data;  // of the data stage
  std::optional<std::chrono::steady_clock::time_point> deadline;
  const void* handle = nullptr;
  void* owner = nullptr;  // identifies the request in `ended`
  /// Called with the state's lock held; must not call the state.
  std::function<void(Request&)> ended;

  /// Resubmitted after each success, until it is removed.
  bool repeats = false;

  std::size_t done = 0;
  bool cancelled = false;
  Ending ending = Ending::completed;
};

class BusState {
 public:
  BusState();
  ~BusState();

  /// The registered state, or null.
  static std::shared_ptr<BusState> current();
  static bool enlist(const std::shared_ptr<BusState>& state);
  static void dismiss(const std::shared_ptr<BusState>& state);

  void run();
  void halt();

  /// Must be held for all calls below.
  std::mutex& mutex() { return mutex_; }
  /// Wakes those who wait; also called whenever a request ends.
  void wake() { changed_.notify_all(); }
  template <class Done>
  bool wait_until(std::unique_lock<std::mutex>& lock, std::chrono::steady_clock::time_point until,
                  Done done) {
    return changed_.wait_until(lock, until, done);
  }

  std::list<Request>& requests() { return requests_; }
  std::list<PluggedPtr>& plugged() { return plugged_; }
  std::vector<std::string>& misuses() { return misuses_; }
  int& handles() { return handles_; }
  /// Asynchronous transfers, until their callback.
  std::size_t& outstanding() { return outstanding_; }
  std::uint8_t next_address() { return ++last_address_; }

  void submit(Request request);
  /// Advances all requests, and ends completed ones.
  void pump();
  /// Waits for a request, for synchronous calls. Returns its ending and the bytes transferred.
  std::pair<Ending, std::size_t> perform(std::unique_lock<std::mutex>& lock, Request request);
  void clear_halt(Plugged& plugged, std::uint8_t endpoint_address);

 private:
  bool move(Request& request);  // true: ended
  bool move_control(Request& request);
  UsbAnswer standard_request(Plugged& plugged, const UsbSetup& setup);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::condition_variable work_;
  std::list<Request> requests_;  // in order of submission
  std::list<PluggedPtr> plugged_;
  std::vector<std::string> misuses_;
  int handles_ = 0;
  std::size_t outstanding_ = 0;
  std::uint8_t last_address_ = 1;
  bool running_ = false;
  std::thread controller_;
};

}  // namespace stickslip::emulated
