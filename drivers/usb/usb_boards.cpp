// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb/usb_boards.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "drivers/usb/udev_rule.h"
#include "drivers/usb/usb_location.h"

namespace stickslip::drivers {

namespace {

constexpr int interface_number = 0;

struct FreeList {
  void operator()(libusb_device** list) const noexcept { libusb_free_device_list(list, 1); }
};
using DeviceList = std::unique_ptr<libusb_device*, FreeList>;

bool is_of(const UsbKind& kind, libusb_device* device) {
  libusb_device_descriptor descriptor{};
  return libusb_get_device_descriptor(device, &descriptor) == LIBUSB_SUCCESS &&
         descriptor.idVendor == kind.vendor_id && descriptor.idProduct == kind.product_id;
}

UsbBoard opened(const UsbKind& kind, libusb_device* device, bool only,
                const IdentifyUsbBoard& identify) {
  UsbBoard board;
  board.location = usb_location(device);
  libusb_device_handle* handle = nullptr;
  if (const int error = libusb_open(device, &handle); error != LIBUSB_SUCCESS) {
    board.problem = usb_refusal(kind, board.location, error);
    return board;
  }
  board.handle.reset(handle);
  identify(board, only);
  return board;
}

std::string ids_of(const UsbKind& kind) {
  std::array<char, 10> text{};
  std::snprintf(text.data(), text.size(), "%04x:%04x", unsigned{kind.vendor_id},
                unsigned{kind.product_id});
  return text.data();
}

std::string serials_of(const std::vector<UsbBoard>& boards) {
  std::string out;
  for (const UsbBoard& board : boards) {
    if (!out.empty()) out += ", ";
    out += board.serial.empty() ? "one at " + board.location : board.serial;
  }
  return out;
}

}  // namespace

void CloseUsbHandle::operator()(libusb_device_handle* handle) const noexcept {
  if (claimed) libusb_release_interface(handle, interface_number);
  libusb_close(handle);
}

UsbContext new_usb_context() {
  libusb_context* context = nullptr;
  return UsbContext(libusb_init(&context) == LIBUSB_SUCCESS ? context : nullptr);
}

std::vector<UsbBoard> find_usb_boards(libusb_context* context, const UsbKind& kind,
                                      const IdentifyUsbBoard& identify) {
  std::vector<UsbBoard> boards;
  libusb_device** all = nullptr;
  const ssize_t count = libusb_get_device_list(context, &all);
  if (count < 0) return boards;
  const DeviceList list(all);
  const auto of_kind = [&kind](libusb_device* device) { return is_of(kind, device); };
  const bool only = std::count_if(all, all + count, of_kind) == 1;
  for (ssize_t i = 0; i < count; ++i) {
    if (!of_kind(all[i])) continue;
    UsbBoard board = opened(kind, all[i], only, identify);
    if (!board.handle && board.problem.outcome == Outcome::lost) continue;
    boards.push_back(std::move(board));
  }
  return boards;
}

WantedUsbBoard wanted_usb_board(const std::string& configured, const std::string& at_start) {
  if (!configured.empty()) return {configured, false};
  return {at_start, !at_start.empty()};
}

std::optional<std::size_t> choose_usb_board(const std::vector<UsbBoard>& boards,
                                            const UsbKind& kind, const WantedUsbBoard& wanted,
                                            UsbProblem& problem) {
  const std::string name = kind.name;
  const std::string& serial = wanted.serial;
  if (boards.empty()) {
    problem = {Outcome::lost,
               "no " + name + " is attached. Plug it in; lsusb shows it as " + ids_of(kind)};
    return std::nullopt;
  }
  if (serial.empty() && boards.size() > 1) {
    problem = {Outcome::needs_attention,
               "several " + name + " are attached (" + serials_of(boards) +
                   "). Select one with serial = " + "... in [" + kind.section + "]"};
    return std::nullopt;
  }
  for (std::size_t i = 0; i < boards.size(); ++i) {
    if (!serial.empty() && boards[i].serial != serial) continue;
    if (boards[i].handle) return i;
    problem = boards[i].problem;
    return std::nullopt;
  }
  // The selected board may be one that could not be identified.
  for (const UsbBoard& board : boards) {
    if (!board.serial.empty() || board.handle) continue;
    problem = board.problem;
    return std::nullopt;
  }
  problem = {Outcome::needs_attention, name + " #" + serial +
                                           " is not attached. Attached: " + serials_of(boards) +
                                           (wanted.of_start ? not_that_of_the_start : "")};
  return std::nullopt;
}

int claim_usb_board(UsbHandle& handle) {
  libusb_set_auto_detach_kernel_driver(handle.get(), 1);  // a failure shows on claiming
  const int claimed = libusb_claim_interface(handle.get(), interface_number);
  if (claimed == LIBUSB_SUCCESS) handle.get_deleter().claimed = true;
  return claimed;
}

UsbProblem usb_refusal(const UsbKind& kind, const std::string& location, int error) {
  const std::string board = std::string(kind.name) + " at " + location + ": ";
  switch (error) {
    case LIBUSB_ERROR_ACCESS:
      return {Outcome::needs_attention, board + "permission denied. " + udev_rule_remedy};
    case LIBUSB_ERROR_BUSY:
      return {Outcome::needs_attention,
              board + "another program uses it. Find it with: sudo lsof /dev/bus/usb/*/*"};
    case LIBUSB_ERROR_NO_DEVICE:
      return {Outcome::lost, board + "it was unplugged"};
    default:
      return {Outcome::temporary, board + "it cannot be opened: " + libusb_error_name(error)};
  }
}

}  // namespace stickslip::drivers
