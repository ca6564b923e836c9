// SPDX-License-Identifier: Apache-2.0
// The USB boards of one kind on this host, and the selection of the configured one.
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

struct CloseUsbContext {
  void operator()(libusb_context* context) const noexcept { libusb_exit(context); }
};
using UsbContext = std::unique_ptr<libusb_context, CloseUsbContext>;

/// Releases the interface, if it was claimed, and closes.
struct CloseUsbHandle {
  bool claimed = false;
  void operator()(libusb_device_handle* handle) const noexcept;
};
using UsbHandle = std::unique_ptr<libusb_device_handle, CloseUsbHandle>;

/// Properties of all boards of a kind.
struct UsbKind {
  const char* name;     ///< for display: "LabJack U6"
  const char* section;  ///< of the configuration, which may have a key `serial`: "labjack_u6"
  std::uint16_t vendor_id;
  std::uint16_t product_id;
};

/// A failure, described for the operator.
struct UsbProblem {
  Outcome outcome = Outcome::fatal;
  std::string text;
};

struct UsbBoard {
  UsbHandle handle;      ///< null: see `problem`
  std::string serial;    ///< empty: unknown
  std::string location;  ///< "USB 1-2.3"
  UsbProblem problem;
};

/// Null: USB cannot be used on this host.
UsbContext new_usb_context();

/// Reads the serial number of an open board; on failure sets `problem` and closes the handle.
/// `only` is true if it is the only board of its kind.
using IdentifyUsbBoard = std::function<void(UsbBoard& board, bool only)>;

/// Every board of a kind, opened if permitted, and identified. Enumerates the bus each time, so
/// that a board plugged in later is found without udev. A board unplugged meanwhile is omitted.
std::vector<UsbBoard> find_usb_boards(libusb_context* context, const UsbKind& kind,
                                      const IdentifyUsbBoard& identify);

/// The board to open.
struct WantedUsbBoard {
  std::string serial;     ///< empty: the only one attached
  bool of_start = false;  ///< not configured: that of the board with which the run began
};

/// The configured serial number, else that of the board with which the run began: another one has
/// other wires and another calibration. Both are empty where unknown.
WantedUsbBoard wanted_usb_board(const std::string& configured, const std::string& at_start);

/// Appended to the refusal of a board other than that of the start.
inline constexpr const char* not_that_of_the_start =
    ". The run began with it: plug it in again, or restart the daemon to use another";

/// Index of the wanted board. None: `problem` holds reason and remedy.
std::optional<std::size_t> choose_usb_board(const std::vector<UsbBoard>& boards,
                                            const UsbKind& kind, const WantedUsbBoard& wanted,
                                            UsbProblem& problem);

/// Claims the first interface, detaching a kernel driver. Returns libusb's error code.
int claim_usb_board(UsbHandle& handle);

/// Description of libusb's error on opening or claiming a board.
UsbProblem usb_refusal(const UsbKind& kind, const std::string& location, int error);

}  // namespace stickslip::drivers
