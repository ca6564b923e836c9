// The way to one LabJack U6: finding it on the bus, and asking it one thing after another. Not for
// while it streams, when questions and answers travel beside the samples (see stream_session.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/attached.h"
#include "drivers/driver.h"
#include "drivers/labjack_u6/protocol.h"
#include "drivers/usb_boards.h"

namespace stickslip::drivers::labjack_u6 {

inline constexpr std::uint8_t command_endpoint = 0x01;
inline constexpr std::uint8_t reply_endpoint = 0x82;
inline constexpr std::uint8_t stream_endpoint = 0x83;

using Trouble = std::optional<UsbProblem>;

class BoardLink {
 public:
  /// Looks at every attached board, takes the one of that serial number (absent: the only one), and
  /// leaves the others alone. The list of devices is read anew each time, so that a board that came
  /// after the program is found without udev as well. Where only one can be meant, `first` goes to
  /// it before anything else, even before it is asked who it is; whether it was done is not looked
  /// at.
  Trouble open(std::optional<std::uint32_t> serial, const Command* first = nullptr);
  void close() noexcept;
  bool is_open() const { return handle_ != nullptr; }

  const Identity& identity() const { return identity_; }
  libusb_context* context() const { return context_.get(); }
  libusb_device_handle* handle() const { return handle_.get(); }

  /// Sends a command and holds what comes back against `check` (which returns a Verdict). `purpose`
  /// completes "LabJack U6 #1: cannot ...". A late reply to something else is passed over. Waits at
  /// most a second or so.
  template <class Check>
  Trouble ask(const char* purpose, const Command& command, Check check) {
    if (Trouble trouble = send(purpose, command)) return trouble;
    Verdict verdict;
    for (int late = 0; late < 4; ++late) {
      std::span<const std::uint8_t> reply;
      if (Trouble trouble = receive(purpose, reply)) return trouble;
      verdict = check(reply);
      if (verdict.kind != Verdict::Kind::command) break;
    }
    verdict_ = verdict;
    if (verdict) return std::nullopt;
    return trouble_of(purpose, verdict);
  }
  /// Of the latest ask that got a reply.
  const Verdict& verdict() const { return verdict_; }

  /// Throws away replies and samples that nobody asked for any more.
  void drain() noexcept;

  /// Gives up context and handle without closing them: the kernel still holds transfers.
  void abandon() noexcept;

 private:
  Trouble send(const char* purpose, const Command& command);
  Trouble receive(const char* purpose, std::span<const std::uint8_t>& reply);
  Trouble usb_trouble(const char* purpose, int error);
  Trouble trouble_of(const char* purpose, const Verdict& verdict) const;

  UsbContext context_;
  UsbHandle handle_;
  Identity identity_;
  Verdict verdict_;
  std::array<std::uint8_t, largest_packet> reply_{};
};

/// Every board that is attached, whether or not it can be used.
std::vector<Attached> find_boards();

}  // namespace stickslip::drivers::labjack_u6
