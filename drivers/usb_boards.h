// The USB boards of one kind on this host, and which of them a configuration means.
#pragma once

#include <libusb-1.0/libusb.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/driver.h"

namespace stickslip::drivers {

struct UsbContextEnd {
  void operator()(libusb_context* context) const noexcept { libusb_exit(context); }
};
using UsbContext = std::unique_ptr<libusb_context, UsbContextEnd>;

/// Gives the interface back, if it was claimed, and closes.
struct UsbHandleEnd {
  bool claimed = false;
  void operator()(libusb_device_handle* handle) const noexcept;
};
using UsbHandle = std::unique_ptr<libusb_device_handle, UsbHandleEnd>;

/// What all boards of a kind have in common.
struct UsbKind {
  const char* name;     ///< for a person: "LabJack U6"
  const char* section;  ///< of the configuration, which may have a key `serial`: "labjack_u6"
  std::uint16_t vendor_id;
  std::uint16_t product_id;
};

/// What went wrong, for a person.
struct UsbProblem {
  Outcome outcome = Outcome::fatal;
  std::string text;
};

struct UsbBoard {
  UsbHandle handle;    ///< null: see `trouble`
  std::string serial;  ///< empty: not known
  std::string where;   ///< "USB 1-2.3"
  UsbProblem trouble;
};

/// Null: USB cannot be used on this machine.
UsbContext new_usb_context();

/// Asks an open board for its serial number. What it cannot do goes into `trouble`, and the handle
/// is closed. `only` is true where there is no other of its kind.
using AskUsbBoard = std::function<void(UsbBoard& board, bool only)>;

/// Every board of that kind, each opened, if it lets itself be, and asked. The list is read anew
/// each time, so that a board that came after the program is found without udev as well. What is
/// pulled out meanwhile is left out.
std::vector<UsbBoard> find_usb_boards(libusb_context* context, const UsbKind& kind,
                                      const AskUsbBoard& ask);

/// The one with that serial number; with an empty one, the only one. Nothing: `problem` says why,
/// and what to do.
std::optional<std::size_t> choose_usb_board(const std::vector<UsbBoard>& boards,
                                            const UsbKind& kind, const std::string& serial,
                                            UsbProblem& problem);

/// Claims the first interface, also from a driver of the kernel. libusb's answer.
int claim_usb_board(UsbHandle& handle);

/// libusb's answer to an attempt to open or claim it, in words.
UsbProblem usb_refusal(const UsbKind& kind, const std::string& where, int error);

}  // namespace stickslip::drivers
