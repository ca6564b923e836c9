// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/board_link.h"

#include <libusb-1.0/libusb.h>

#include <map>
#include <utility>

namespace stickslip::drivers::labjack_u6 {

namespace {

constexpr unsigned timeout_ms = 1000;
constexpr unsigned drain_timeout_ms = 20;
constexpr UsbKind kind{"LabJack U6", "labjack_u6", vendor_id, product_id};

Verdict identify(libusb_device_handle* handle, Identity& identity) {
  Command command = request_identity();
  std::array<std::uint8_t, largest_packet> reply{};
  int moved = 0;
  // Replies to a former process may still be pending.
  for (int left = 100; left > 0; --left) {
    if (libusb_bulk_transfer(handle, reply_endpoint, reply.data(), largest_packet, &moved,
                             drain_timeout_ms) != LIBUSB_SUCCESS) {
      break;
    }
  }
  Verdict verdict{Verdict::Kind::length};
  for (int attempt = 0; attempt < 2 && !verdict; ++attempt) {
    if (libusb_bulk_transfer(handle, command_endpoint, command.bytes.data(),
                             static_cast<int>(command.size), &moved,
                             timeout_ms) != LIBUSB_SUCCESS ||
        libusb_bulk_transfer(handle, reply_endpoint, reply.data(), largest_packet, &moved,
                             timeout_ms) != LIBUSB_SUCCESS) {
      verdict = {Verdict::Kind::length};
      continue;
    }
    verdict = parse_identity({reply.data(), static_cast<std::size_t>(moved)}, identity);
  }
  return verdict;
}

/// The reply is discarded by identify.
void send_unchecked(libusb_device_handle* handle, Command command) {
  int moved = 0;
  static_cast<void>(libusb_bulk_transfer(handle, command_endpoint, command.bytes.data(),
                                         static_cast<int>(command.size), &moved, timeout_ms));
}

/// Unsupported product or firmware; none: the board can be used.
Failure unsupported(const Identity& identity, const std::string& location) {
  if (identity.product == product_id && identity.firmware_major != 0) return std::nullopt;
  return UsbProblem{Outcome::needs_attention,
                    name_of(identity) + " at " + location + ": product " +
                        std::to_string(identity.product) + " with firmware " +
                        firmware_of(identity) +
                        ", expected product 6 with firmware 1.00 or later. Update it with the "
                        "vendor's LJSelfUpgrade"};
}

/// By location.
using Identities = std::map<std::string, Identity>;

/// `first` is sent to a board that is the only one.
std::vector<UsbBoard> probe_all(libusb_context* context, Identities& identities,
                                const Command* first = nullptr) {
  const auto refuse = [](UsbBoard& board, UsbProblem problem) {
    board.problem = std::move(problem);
    board.handle.reset();
  };
  const auto identify_board = [&](UsbBoard& board, bool only) {
    if (const int error = claim_usb_board(board.handle); error != LIBUSB_SUCCESS) {
      refuse(board, usb_refusal(kind, board.location, error));
      return;
    }
    if (first != nullptr && only) send_unchecked(board.handle.get(), *first);
    Identity identity;
    if (const Verdict verdict = identify(board.handle.get(), identity); !verdict) {
      refuse(board, {Outcome::temporary, "LabJack U6 at " + board.location +
                                             ": it does not identify itself (" + in_words(verdict) +
                                             "). Unplug it and plug it in again"});
      return;
    }
    board.serial = std::to_string(identity.serial);
    identities[board.location] = identity;
    if (Failure failure = unsupported(identity, board.location)) refuse(board, std::move(*failure));
  };
  return find_usb_boards(context, kind, identify_board);
}

}  // namespace

Failure BoardLink::open(const WantedUsbBoard& wanted, const Command* first) {
  close();
  UsbContext context = new_usb_context();
  if (!context) {
    return UsbProblem{Outcome::needs_attention,
                      "USB cannot be used on this host. Does /dev/bus/usb exist?"};
  }
  Identities identities;
  std::vector<UsbBoard> boards = probe_all(context.get(), identities, first);
  UsbProblem problem;
  const auto chosen = choose_usb_board(boards, kind, wanted, problem);
  if (!chosen) return problem;
  identity_ = identities[boards[*chosen].location];
  handle_ = std::move(boards[*chosen].handle);
  context_ = std::move(context);
  return std::nullopt;
}

void BoardLink::close() noexcept {
  handle_.reset();
  context_.reset();
}

void BoardLink::abandon() noexcept {
  static_cast<void>(handle_.release());
  static_cast<void>(context_.release());
}

Failure BoardLink::send(const char* purpose, const Command& command) {
  Command copy = command;  // libusb requires a mutable buffer
  int moved = 0;
  const int error = libusb_bulk_transfer(handle_.get(), command_endpoint, copy.bytes.data(),
                                         static_cast<int>(copy.size), &moved, timeout_ms);
  if (error == LIBUSB_SUCCESS) return std::nullopt;
  return usb_failure(purpose, error);
}

Failure BoardLink::receive(const char* purpose, std::span<const std::uint8_t>& reply) {
  int moved = 0;
  const int error = libusb_bulk_transfer(handle_.get(), reply_endpoint, reply_.data(),
                                         static_cast<int>(reply_.size()), &moved, timeout_ms);
  if (error == LIBUSB_ERROR_PIPE) libusb_clear_halt(handle_.get(), reply_endpoint);
  if (error != LIBUSB_SUCCESS) return usb_failure(purpose, error);
  reply = {reply_.data(), static_cast<std::size_t>(moved)};
  return std::nullopt;
}

Failure BoardLink::usb_failure(const char* purpose, int error) {
  const std::string board = name_of(identity_) + ": cannot " + purpose + ": ";
  switch (error) {
    case LIBUSB_ERROR_NO_DEVICE:
      return UsbProblem{Outcome::lost, board + "it was unplugged"};
    case LIBUSB_ERROR_TIMEOUT:
      return UsbProblem{Outcome::temporary, board + "it did not answer within 1 s"};
    default:
      return UsbProblem{Outcome::temporary, board + libusb_error_name(error)};
  }
}

Failure BoardLink::failure_of(const char* purpose, const Verdict& verdict) const {
  const bool refused = verdict.kind == Verdict::Kind::error;
  return UsbProblem{refused ? Outcome::needs_attention : Outcome::temporary,
                    name_of(identity_) + ": cannot " + purpose + ": " + in_words(verdict)};
}

void BoardLink::drain() noexcept {
  std::array<std::uint8_t, largest_packet> bytes{};
  for (const std::uint8_t endpoint : {stream_endpoint, reply_endpoint}) {
    for (int packet = 0; packet < 200; ++packet) {
      int moved = 0;
      const int error =
          libusb_bulk_transfer(handle_.get(), endpoint, bytes.data(),
                               static_cast<int>(bytes.size()), &moved, drain_timeout_ms);
      if (error == LIBUSB_ERROR_PIPE) libusb_clear_halt(handle_.get(), endpoint);
      if (error != LIBUSB_SUCCESS) break;
    }
  }
}

std::vector<AttachedDevice> find_boards() {
  std::vector<AttachedDevice> out;
  const UsbContext context = new_usb_context();
  if (!context) return out;
  Identities identities;
  for (const UsbBoard& board : probe_all(context.get(), identities)) {
    AttachedDevice attached;
    attached.kind = kind.section;
    attached.location = board.location;
    attached.name = kind.name;
    attached.serial = board.serial;
    if (const auto known = identities.find(board.location); known != identities.end()) {
      attached.name = name_of(known->second) + ", firmware " + firmware_of(known->second);
    }
    if (!board.handle) attached.problem = board.problem.text;
    out.push_back(attached);
  }
  return out;
}

}  // namespace stickslip::drivers::labjack_u6
