#include "drivers/labjack_u6/board_link.h"

#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "drivers/usb_place.h"

namespace stickslip::drivers::labjack_u6 {

namespace {

constexpr unsigned patience_ms = 1000;
constexpr unsigned drain_patience_ms = 20;
constexpr int interface_number = 0;

struct FreeList {
  void operator()(libusb_device** list) const noexcept { libusb_free_device_list(list, 1); }
};
using DeviceList = std::unique_ptr<libusb_device*, FreeList>;

/// A board on the bus, opened as far as it would let itself be.
struct Probe {
  Handle handle;  // null: see `trouble`
  Identity identity;
  bool identified = false;
  std::string where;
  Problem trouble;
};

Problem refusal(const std::string& where, int error) {
  const std::string board = "LabJack U6 at " + where + ": ";
  switch (error) {
    case LIBUSB_ERROR_ACCESS:
      return {Outcome::needs_attention,
              board +
                  "permission denied. Put the rule SUBSYSTEM==\"usb\", ATTR{idVendor}==\"0cd5\", "
                  "ATTR{idProduct}==\"0006\", GROUP=\"stickslip\", MODE=\"0660\" into "
                  "/etc/udev/rules.d/70-stickslip-labjack.rules and run: sudo udevadm control "
                  "--reload && sudo udevadm trigger. Join the group with: sudo usermod -aG "
                  "stickslip $USER, and log in again"};
    case LIBUSB_ERROR_BUSY:
      return {Outcome::needs_attention,
              board + "another program has it. Find it with: sudo lsof /dev/bus/usb/*/*"};
    case LIBUSB_ERROR_NO_DEVICE:
      return {Outcome::lost, board + "it was unplugged"};
    default:
      return {Outcome::temporary, board + "it cannot be opened: " + libusb_error_name(error)};
  }
}

Verdict ask_who(libusb_device_handle* handle, Identity& identity) {
  Command command = ask_identity();
  std::array<std::uint8_t, largest_packet> reply{};
  int moved = 0;
  // What a program that died had asked for may still lie there.
  for (int left = 100; left > 0; --left) {
    if (libusb_bulk_transfer(handle, reply_endpoint, reply.data(), largest_packet, &moved,
                             drain_patience_ms) != LIBUSB_SUCCESS) {
      break;
    }
  }
  Verdict verdict{Verdict::Kind::length};
  for (int attempt = 0; attempt < 2 && !verdict; ++attempt) {
    if (libusb_bulk_transfer(handle, command_endpoint, command.bytes.data(),
                             static_cast<int>(command.size), &moved,
                             patience_ms) != LIBUSB_SUCCESS ||
        libusb_bulk_transfer(handle, reply_endpoint, reply.data(), largest_packet, &moved,
                             patience_ms) != LIBUSB_SUCCESS) {
      verdict = {Verdict::Kind::length};
      continue;
    }
    verdict = parse_identity({reply.data(), static_cast<std::size_t>(moved)}, identity);
  }
  return verdict;
}

/// Its reply is among those that ask_who throws away.
void tell(libusb_device_handle* handle, Command command) {
  int moved = 0;
  static_cast<void>(libusb_bulk_transfer(handle, command_endpoint, command.bytes.data(),
                                         static_cast<int>(command.size), &moved, patience_ms));
}

Probe probe(libusb_device* device, const Command* first = nullptr) {
  Probe out;
  out.where = usb_place(device);
  libusb_device_handle* raw = nullptr;
  if (const int error = libusb_open(device, &raw); error != LIBUSB_SUCCESS) {
    out.trouble = refusal(out.where, error);
    return out;
  }
  Handle handle(raw);
  libusb_set_auto_detach_kernel_driver(raw, 1);  // where that is not possible, claiming tells
  if (const int error = libusb_claim_interface(raw, interface_number); error != LIBUSB_SUCCESS) {
    out.trouble = refusal(out.where, error);
    return out;
  }
  if (first != nullptr) tell(raw, *first);
  if (const Verdict verdict = ask_who(raw, out.identity); !verdict) {
    out.trouble = {Outcome::temporary, "LabJack U6 at " + out.where +
                                           ": it does not say who it is (" + in_words(verdict) +
                                           "). Unplug it and plug it in again"};
    return out;
  }
  out.identified = true;
  if (out.identity.product != product_id || out.identity.firmware_major == 0) {
    out.trouble = {Outcome::needs_attention,
                   name_of(out.identity) + " at " + out.where + ": product " +
                       std::to_string(out.identity.product) + " with firmware " +
                       firmware_of(out.identity) +
                       ", expected product 6 with firmware 1.00 or later. Update it with the "
                       "vendor's LJSelfUpgrade"};
    return out;
  }
  out.handle = std::move(handle);
  return out;
}

bool is_u6(libusb_device* device) {
  libusb_device_descriptor descriptor{};
  return libusb_get_device_descriptor(device, &descriptor) == LIBUSB_SUCCESS &&
         descriptor.idVendor == vendor_id && descriptor.idProduct == product_id;
}

Context new_context() {
  libusb_context* raw = nullptr;
  return Context(libusb_init(&raw) == LIBUSB_SUCCESS ? raw : nullptr);
}

/// `first` goes to a board that is the only one.
std::vector<Probe> probe_all(libusb_context* context, const Command* first = nullptr) {
  std::vector<Probe> out;
  libusb_device** raw = nullptr;
  const ssize_t count = libusb_get_device_list(context, &raw);
  if (count < 0) return out;
  const DeviceList list(raw);
  if (std::count_if(raw, raw + count, is_u6) != 1) first = nullptr;
  for (ssize_t i = 0; i < count; ++i) {
    if (is_u6(raw[i])) out.push_back(probe(raw[i], first));
  }
  return out;
}

std::string serials_of(const std::vector<Probe>& probes) {
  std::string out;
  for (const Probe& board : probes) {
    if (!out.empty()) out += ", ";
    out += board.identified ? std::to_string(board.identity.serial) : "one at " + board.where;
  }
  return out;
}

/// The board to use among those that were found.
Trouble choose(std::vector<Probe>& probes, std::optional<std::uint32_t> serial, Probe& chosen) {
  if (probes.empty()) {
    return Problem{Outcome::lost,
                   "no LabJack U6 is attached. Plug it in; lsusb shows it as 0cd5:0006"};
  }
  if (!serial && probes.size() > 1) {
    return Problem{Outcome::needs_attention, "several LabJack U6 are attached (" +
                                                 serials_of(probes) +
                                                 "). Say which with serial = ... in [labjack_u6]"};
  }
  for (Probe& board : probes) {
    if (serial && !(board.identified && board.identity.serial == *serial)) continue;
    if (!board.handle) return board.trouble;
    chosen = std::move(board);
    return std::nullopt;
  }
  // The one that was asked for may be the one that does not answer.
  for (const Probe& board : probes) {
    if (!board.identified) return board.trouble;
  }
  return Problem{Outcome::needs_attention, "LabJack U6 #" + std::to_string(*serial) +
                                               " is not attached. Attached: " + serials_of(probes)};
}

}  // namespace

void CloseHandle::operator()(libusb_device_handle* handle) const noexcept {
  libusb_release_interface(handle, interface_number);
  libusb_close(handle);
}

void ExitContext::operator()(libusb_context* context) const noexcept { libusb_exit(context); }

Trouble BoardLink::open(std::optional<std::uint32_t> serial, const Command* first) {
  close();
  Context context = new_context();
  if (!context) {
    return Problem{Outcome::needs_attention,
                   "USB cannot be used on this machine. Is /dev/bus/usb there?"};
  }
  Probe chosen;
  {
    std::vector<Probe> probes = probe_all(context.get(), serial ? nullptr : first);
    if (Trouble trouble = choose(probes, serial, chosen)) return trouble;
  }
  context_ = std::move(context);
  handle_ = std::move(chosen.handle);
  identity_ = chosen.identity;
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

Trouble BoardLink::send(const char* purpose, const Command& command) {
  Command copy = command;  // libusb asks for bytes that may be written
  int moved = 0;
  const int error = libusb_bulk_transfer(handle_.get(), command_endpoint, copy.bytes.data(),
                                         static_cast<int>(copy.size), &moved, patience_ms);
  if (error == LIBUSB_SUCCESS) return std::nullopt;
  return usb_trouble(purpose, error);
}

Trouble BoardLink::receive(const char* purpose, std::span<const std::uint8_t>& reply) {
  int moved = 0;
  const int error = libusb_bulk_transfer(handle_.get(), reply_endpoint, reply_.data(),
                                         static_cast<int>(reply_.size()), &moved, patience_ms);
  if (error == LIBUSB_ERROR_PIPE) libusb_clear_halt(handle_.get(), reply_endpoint);
  if (error != LIBUSB_SUCCESS) return usb_trouble(purpose, error);
  reply = {reply_.data(), static_cast<std::size_t>(moved)};
  return std::nullopt;
}

Trouble BoardLink::usb_trouble(const char* purpose, int error) {
  const std::string board = name_of(identity_) + ": cannot " + purpose + ": ";
  switch (error) {
    case LIBUSB_ERROR_NO_DEVICE:
      return Problem{Outcome::lost, board + "it was unplugged"};
    case LIBUSB_ERROR_TIMEOUT:
      return Problem{Outcome::temporary, board + "it did not answer within 1 s"};
    default:
      return Problem{Outcome::temporary, board + libusb_error_name(error)};
  }
}

Trouble BoardLink::trouble_of(const char* purpose, const Verdict& verdict) const {
  const bool refused = verdict.kind == Verdict::Kind::error;
  return Problem{refused ? Outcome::needs_attention : Outcome::temporary,
                 name_of(identity_) + ": cannot " + purpose + ": " + in_words(verdict)};
}

void BoardLink::drain() noexcept {
  std::array<std::uint8_t, largest_packet> bytes{};
  for (const std::uint8_t endpoint : {stream_endpoint, reply_endpoint}) {
    for (int packet = 0; packet < 200; ++packet) {
      int moved = 0;
      const int error =
          libusb_bulk_transfer(handle_.get(), endpoint, bytes.data(),
                               static_cast<int>(bytes.size()), &moved, drain_patience_ms);
      if (error == LIBUSB_ERROR_PIPE) libusb_clear_halt(handle_.get(), endpoint);
      if (error != LIBUSB_SUCCESS) break;
    }
  }
}

std::vector<Attached> find_boards() {
  std::vector<Attached> out;
  const Context context = new_context();
  if (!context) return out;
  for (const Probe& board : probe_all(context.get())) {
    Attached attached;
    attached.kind = "labjack_u6";
    attached.where = board.where;
    attached.name = "LabJack U6";
    if (board.identified) {
      attached.name = name_of(board.identity) + ", firmware " + firmware_of(board.identity);
      attached.serial = std::to_string(board.identity.serial);
    }
    if (!board.handle) attached.trouble = board.trouble.text;
    out.push_back(attached);
  }
  return out;
}

}  // namespace stickslip::drivers::labjack_u6
