#include "drivers/usb_1208fs_plus/session.h"

#include <algorithm>
#include <array>
#include <utility>

#include "drivers/usb_place.h"

namespace stickslip::drivers::usb_1208fs_plus {

namespace {

constexpr unsigned patience_ms = 1000;
constexpr std::uint8_t vendor_out = 0x40;
constexpr std::uint8_t vendor_in = 0xC0;

constexpr const char* cure_of_access =
    "this user may not open it. Give access once, then plug the board in again:\n"
    "  echo 'SUBSYSTEM==\"usb\", ATTR{idVendor}==\"09db\", ATTR{idProduct}==\"00e8\", "
    "MODE=\"0660\", GROUP=\"stickslip\", TAG+=\"uaccess\"' | "
    "sudo tee /etc/udev/rules.d/60-usb-1208fs-plus.rules && sudo udevadm control --reload";

int request_of(libusb_device_handle* handle, std::uint8_t type, Request request,
               std::uint16_t value, std::uint16_t index, std::span<std::uint8_t> bytes) {
  return libusb_control_transfer(handle, type, static_cast<std::uint8_t>(request), value, index,
                                 bytes.data(), static_cast<std::uint16_t>(bytes.size()),
                                 patience_ms);
}

/// `error` is libusb's where it does not answer.
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

struct Found {
  Handle handle;  // null: it could not be opened
  int error = 0;
  std::string serial;
  std::string where;
};

std::vector<Found> search(libusb_context* context) {
  std::vector<Found> found;
  libusb_device** list = nullptr;
  const auto count = libusb_get_device_list(context, &list);
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(list[i], &descriptor) != 0) continue;
    if (descriptor.idVendor != vendor_id || descriptor.idProduct != product_id) continue;
    Found one;
    one.where = usb_place(list[i]);
    libusb_device_handle* handle = nullptr;
    one.error = libusb_open(list[i], &handle);
    int unread = 0;
    if (one.error == 0) {
      one.handle.reset(handle);
      one.serial = serial_of(handle, unread);
    }
    // It was pulled out while it was looked at.
    if (one.error == LIBUSB_ERROR_NO_DEVICE || unread == LIBUSB_ERROR_NO_DEVICE) continue;
    found.push_back(std::move(one));
  }
  if (count >= 0) libusb_free_device_list(list, 1);
  return found;
}

std::string trouble_of(const Found& found) {
  if (found.error == 0) return {};
  if (found.error == LIBUSB_ERROR_ACCESS) return cure_of_access;
  return std::string("it cannot be opened: ") + libusb_error_name(found.error);
}

Context make_context() {
  libusb_context* context = nullptr;
  return libusb_init(&context) == 0 ? Context(context) : Context();
}

}  // namespace

Outcome Session::open(const std::string& wanted, std::string& refusal) {
  context_ = make_context();
  if (!context_) {
    refusal = "USB-1208FS-Plus: libusb cannot begin; is /dev/bus/usb there?";
    return Outcome::fatal;
  }
  auto boards = search(context_.get());
  if (boards.empty()) {
    refusal =
        "no USB-1208FS-Plus (09db:00e8) is attached; plug it in. `lsusb -d 09db:` shows whether "
        "the host sees it";
    return Outcome::lost;
  }
  std::string seen;
  for (const Found& board : boards) {
    if (!board.handle) {
      refusal = "USB-1208FS-Plus at " + board.where + ": " + trouble_of(board);
      if (boards.size() == 1) return Outcome::needs_attention;
    }
    if (!seen.empty()) seen += ", ";
    seen += board.serial.empty() ? board.where : board.serial;
  }
  if (wanted.empty() && boards.size() > 1) {
    refusal =
        "several USB-1208FS-Plus are attached (" + seen + "); say which as usb_1208fs_plus.serial";
    return Outcome::needs_attention;
  }
  for (Found& board : boards) {
    if (!board.handle || (!wanted.empty() && board.serial != wanted)) continue;
    handle_ = std::move(board.handle);
    serial_ = board.serial;
    break;
  }
  if (!handle_) {
    if (refusal.empty()) {
      refusal =
          "no USB-1208FS-Plus with serial number " + wanted + " is attached; there is " + seen;
    }
    return Outcome::needs_attention;
  }
  libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
  const int claimed = libusb_claim_interface(handle_.get(), 0);
  if (claimed == 0) return Outcome::ok;
  refusal = "USB-1208FS-Plus " + serial_ + ": " +
            (claimed == LIBUSB_ERROR_BUSY
                 ? "another program uses it; end that program"
                 : std::string("its interface cannot be claimed: ") + libusb_error_name(claimed));
  return claimed == LIBUSB_ERROR_NO_DEVICE ? Outcome::lost : Outcome::needs_attention;
}

void Session::release() const {
  // Where it fails the board is gone, and free.
  static_cast<void>(libusb_release_interface(handle_.get(), 0));
}

int Session::send(Request request, std::span<const std::uint8_t> bytes, std::uint16_t value,
                  std::uint16_t index) const {
  // libusb takes what is sent as it takes what is filled; the longest is 14 bytes.
  std::array<std::uint8_t, 16> out{};
  std::copy(bytes.begin(), bytes.end(), out.begin());
  return request_of(handle_.get(), vendor_out, request, value, index,
                    std::span(out).first(bytes.size()));
}

int Session::receive(Request request, std::span<std::uint8_t> bytes, std::uint16_t value) const {
  return request_of(handle_.get(), vendor_in, request, value, 0, bytes);
}

std::vector<Attached> find_all() {
  std::vector<Attached> attached;
  const Context context = make_context();
  if (!context) return attached;
  for (const Found& board : search(context.get())) {
    Attached one;
    one.kind = "usb_1208fs_plus";
    one.name = "USB-1208FS-Plus" + (board.serial.empty() ? "" : " #" + board.serial);
    one.serial = board.serial;
    one.where = board.where;
    one.trouble = trouble_of(board);
    attached.push_back(std::move(one));
  }
  return attached;
}

}  // namespace stickslip::drivers::usb_1208fs_plus
