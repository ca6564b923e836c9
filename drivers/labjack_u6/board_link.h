// SPDX-License-Identifier: Apache-2.0
// Connection to one LabJack U6: discovery on the bus and synchronous commands. Not for use while it
// streams, when commands and replies are asynchronous (see stream_session.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/attached_device.h"
#include "drivers/driver.h"
#include "drivers/labjack_u6/protocol.h"
#include "drivers/usb/usb_boards.h"

namespace stickslip::drivers::labjack_u6 {

inline constexpr std::uint8_t command_endpoint = 0x01;
inline constexpr std::uint8_t reply_endpoint = 0x82;
inline constexpr std::uint8_t stream_endpoint = 0x83;

/// None: success.
using Failure = std::optional<UsbProblem>;

class BoardLink {
 public:
  /// Opens the wanted board and leaves the others alone. The bus is enumerated each time, so that a
  /// board plugged in later is found without udev. If only one is attached, `first` is sent to it
  /// before anything else, even before it is identified; its result is ignored.
  Failure open(const WantedUsbBoard& wanted, const Command* first = nullptr);
  void close() noexcept;
  bool is_open() const { return handle_ != nullptr; }

  const Identity& identity() const { return identity_; }
  libusb_context* context() const { return context_.get(); }
  libusb_device_handle* handle() const { return handle_.get(); }

  /// Sends a command and checks the reply with `check` (which returns a Verdict). `purpose`
  /// completes "LabJack U6 #1: cannot ...". Late replies to other commands are skipped. Waits about
  /// a second at most.
  template <class Check>
  Failure request(const char* purpose, const Command& command, Check check) {
    if (Failure failure = send(purpose, command)) return failure;
    Verdict verdict;
    for (int late = 0; late < 4; ++late) {
      std::span<const std::uint8_t> reply;
      if (Failure failure = receive(purpose, reply)) return failure;
      verdict = check(reply);
      if (verdict.kind != Verdict::Kind::command) break;
    }
    verdict_ = verdict;
    if (verdict) return std::nullopt;
    return failure_of(purpose, verdict);
  }
  /// Of the latest request that received a reply.
  const Verdict& verdict() const { return verdict_; }

  /// Discards pending replies and samples.
  void drain() noexcept;

  /// Releases context and handle without closing them, while the kernel still holds transfers.
  void abandon() noexcept;

 private:
  Failure send(const char* purpose, const Command& command);
  Failure receive(const char* purpose, std::span<const std::uint8_t>& reply);
  Failure usb_failure(const char* purpose, int error);
  Failure failure_of(const char* purpose, const Verdict& verdict) const;

  UsbContext context_;
  UsbHandle handle_;
  Identity identity_;
  Verdict verdict_;
  std::array<std::uint8_t, largest_packet> reply_{};
};

/// Every attached board, usable or not.
std::vector<AttachedDevice> find_boards();

}  // namespace stickslip::drivers::labjack_u6
