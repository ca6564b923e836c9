// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/session.h"

#include <algorithm>
#include <array>
#include <utility>

namespace stickslip::drivers::usb_1208fs_plus {

namespace {

constexpr unsigned timeout_ms = 1000;
constexpr std::uint8_t vendor_out = 0x40;
constexpr std::uint8_t vendor_in = 0xC0;

constexpr UsbKind kind{"USB-1208FS-Plus", "usb_1208fs_plus", vendor_id, product_id};

int request_of(libusb_device_handle* handle, std::uint8_t type, Request request,
               std::uint16_t value, std::uint16_t index, std::span<std::uint8_t> bytes) {
  return libusb_control_transfer(handle, type, static_cast<std::uint8_t>(request), value, index,
                                 bytes.data(), static_cast<std::uint16_t>(bytes.size()),
                                 timeout_ms);
}

/// `error` is that of libusb if the board does not respond.
std::string serial_of(libusb_device_handle* handle, int& error) {
  std::array<std::uint8_t, 8> text{};
  const int got = request_of(handle, vendor_in, Request::serial, 0, 0, text);
  error = std::min(got, 0);
  if (got != static_cast<int>(text.size())) return {};
  std::string serial(text.begin(), text.end());
  while (!serial.empty() && (serial.back() == '\0' || serial.back() == ' ')) serial.pop_back();
  const bool printable = std::all_of(serial.begin(), serial.end(),
                                     [](char letter) { return letter > ' ' && letter < '\x7F'; });
  return printable ? serial : std::string();
}

std::vector<UsbBoard> search(libusb_context* context) {
  return find_usb_boards(context, kind, [](UsbBoard& board, bool) {
    int error = 0;
    board.serial = serial_of(board.handle.get(), error);
    if (error != LIBUSB_ERROR_NO_DEVICE) return;
    board.problem = usb_refusal(kind, board.location, error);
    board.handle.reset();
  });
}

}  // namespace

Outcome Session::open(const WantedUsbBoard& wanted, std::string& refusal) {
  context_ = new_usb_context();
  if (!context_) {
    refusal = "USB-1208FS-Plus: libusb cannot be initialized. Does /dev/bus/usb exist?";
    return Outcome::fatal;
  }
  auto boards = search(context_.get());
  UsbProblem problem;
  if (const auto chosen = choose_usb_board(boards, kind, wanted, problem)) {
    handle_ = std::move(boards[*chosen].handle);
    serial_ = boards[*chosen].serial;
    const int claimed = claim_usb_board(handle_);
    if (claimed == LIBUSB_SUCCESS) return Outcome::ok;
    problem = usb_refusal(kind, boards[*chosen].location, claimed);
  }
  refusal = std::move(problem.text);
  return problem.outcome;
}

void Session::release() const {
  // On failure the board is disconnected, and so released.
  static_cast<void>(libusb_release_interface(handle_.get(), 0));
}

int Session::send(Request request, std::span<const std::uint8_t> bytes, std::uint16_t value,
                  std::uint16_t index) const {
  // libusb requires a mutable buffer; the longest request has 14 bytes.
  std::array<std::uint8_t, 16> out{};
  std::copy(bytes.begin(), bytes.end(), out.begin());
  return request_of(handle_.get(), vendor_out, request, value, index,
                    std::span(out).first(bytes.size()));
}

int Session::receive(Request request, std::span<std::uint8_t> bytes, std::uint16_t value) const {
  return request_of(handle_.get(), vendor_in, request, value, 0, bytes);
}

std::vector<AttachedDevice> find_all() {
  std::vector<AttachedDevice> attached;
  const UsbContext context = new_usb_context();
  if (!context) return attached;
  for (const UsbBoard& board : search(context.get())) {
    AttachedDevice one;
    one.kind = kind.section;
    one.name = kind.name + (board.serial.empty() ? "" : " #" + board.serial);
    one.serial = board.serial;
    one.location = board.location;
    if (!board.handle) one.problem = board.problem.text;
    attached.push_back(std::move(one));
  }
  return attached;
}

}  // namespace stickslip::drivers::usb_1208fs_plus
