// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/attach/emulated_hidapi.h"

#include <hidapi/hidapi.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <cwchar>
#include <deque>
#include <string>
#include <utility>

#include "tests/emulated/attach/bus_state.h"

using stickslip::emulated::BusState;
using stickslip::emulated::Bytes;
using stickslip::emulated::Ending;
using stickslip::emulated::Plugged;
using stickslip::emulated::PluggedPtr;
using stickslip::emulated::Request;
using stickslip::emulated::UsbSetup;

// Definition of the library's opaque type.
struct hid_device_ {
  std::shared_ptr<BusState> state;
  PluggedPtr plugged;
  std::array<std::uint8_t, 64> buffer{};
  std::deque<Bytes> reports;
  bool blocking = true;
  std::wstring error = L"Success";
};

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint8_t report_endpoint = 0x81;
/// The kernel's queue of a hidraw device.
constexpr std::size_t queued_reports = 64;
constexpr auto timeout = std::chrono::seconds(1);

bool is_hid(const Plugged& plugged) {
  const Bytes& all = plugged.configuration_descriptor;
  for (std::size_t at = 0; at + 5 < all.size() && all[at] != 0; at += all[at]) {
    if (all[at + 1] == 4) return all[at + 5] == 3;
  }
  return false;
}

/// The first interrupt OUT endpoint; 0: none.
std::uint8_t output_endpoint(const Plugged& plugged) {
  const Bytes& all = plugged.configuration_descriptor;
  for (std::size_t at = 0; at + 3 < all.size() && all[at] != 0; at += all[at]) {
    if (all[at + 1] == 5 && (all[at + 2] & 0x80U) == 0 && (all[at + 3] & 3U) == 3) {
      return all[at + 2];
    }
  }
  return 0;
}

std::wstring string_of(const Plugged& plugged, std::size_t at) {
  const std::uint8_t index = plugged.device_descriptor.at(at);
  if (index == 0 || plugged.device == nullptr) return {};
  const std::string text = plugged.device->string(index);
  return {text.begin(), text.end()};
}

std::string path_of(const Plugged& plugged) {
  return "/dev/hidraw" + std::to_string(plugged.address);
}

wchar_t* copy_of(const std::wstring& text) {
  auto* copy = static_cast<wchar_t*>(std::calloc(text.size() + 1, sizeof(wchar_t)));
  std::copy(text.begin(), text.end(), copy);
  return copy;
}

char* copy_of(const std::string& text) {
  auto* copy = static_cast<char*>(std::calloc(text.size() + 1, 1));
  std::copy(text.begin(), text.end(), copy);
  return copy;
}

/// Requires the state's lock.
hid_device_info* info_of(const Plugged& plugged) {
  auto* info = static_cast<hid_device_info*>(std::calloc(1, sizeof(hid_device_info)));
  info->path = copy_of(path_of(plugged));
  info->vendor_id = plugged.vendor_id();
  info->product_id = plugged.product_id();
  info->release_number = static_cast<unsigned short>(plugged.device_descriptor.at(12) |
                                                     plugged.device_descriptor.at(13) << 8);
  info->manufacturer_string = copy_of(string_of(plugged, 14));
  info->product_string = copy_of(string_of(plugged, 15));
  info->serial_number = copy_of(string_of(plugged, 16));
  info->interface_number = 0;
  info->bus_type = HID_API_BUS_USB;
  return info;
}

/// Keeps one request for a report pending. Requires the state's lock.
void ask_for_report(hid_device* device) {
  Request request;
  request.plugged = device->plugged;
  request.endpoint = report_endpoint;
  request.data = device->buffer;
  request.handle = device;
  request.ended = [device](Request& over) {
    if (over.ending != Ending::completed || over.done == 0) return;
    device->reports.emplace_back(device->buffer.begin(),
                                 device->buffer.begin() + static_cast<std::ptrdiff_t>(over.done));
    if (device->reports.size() > queued_reports) device->reports.pop_front();
  };
  request.repeats = true;
  device->state->submit(std::move(request));
}

int fail(hid_device* device, const wchar_t* why) {
  device->error = why;
  return -1;
}

int control(hid_device* device, const UsbSetup& setup, std::span<std::uint8_t> data) {
  std::unique_lock lock(device->state->mutex());
  if (device->plugged->device == nullptr) return fail(device, L"No such device");
  Request request;
  request.plugged = device->plugged;
  request.setup = setup;
  request.data = data;
  request.deadline = Clock::now() + timeout;
  const auto [ending, done] = device->state->perform(lock, std::move(request));
  if (ending != Ending::completed) return fail(device, L"Broken pipe");
  return static_cast<int>(done);
}

int copy_string(hid_device* device, std::size_t at, wchar_t* text, std::size_t capacity) {
  const std::lock_guard hold(device->state->mutex());
  if (device->plugged->device == nullptr) return fail(device, L"No such device");
  const std::wstring found = string_of(*device->plugged, at);
  if (capacity == 0) return -1;
  const std::size_t length = std::min(capacity - 1, found.size());
  std::copy_n(found.begin(), length, text);
  text[length] = 0;
  return 0;
}

}  // namespace

extern "C" {

int HID_API_EXPORT hid_init(void) { return 0; }
int HID_API_EXPORT hid_exit(void) { return 0; }

struct hid_device_info HID_API_EXPORT* hid_enumerate(unsigned short vendor,
                                                     unsigned short product) {
  const auto state = BusState::current();
  if (!state) return nullptr;
  const std::lock_guard hold(state->mutex());
  hid_device_info* first = nullptr;
  hid_device_info** end = &first;
  for (const PluggedPtr& plugged : state->plugged()) {
    if (!is_hid(*plugged) || (vendor != 0 && plugged->vendor_id() != vendor) ||
        (product != 0 && plugged->product_id() != product)) {
      continue;
    }
    *end = info_of(*plugged);
    end = &(*end)->next;
  }
  return first;
}

void HID_API_EXPORT hid_free_enumeration(struct hid_device_info* list) {
  while (list != nullptr) {
    hid_device_info* next = list->next;
    std::free(list->path);
    std::free(list->manufacturer_string);
    std::free(list->product_string);
    std::free(list->serial_number);
    std::free(list);
    list = next;
  }
}

HID_API_EXPORT hid_device* hid_open_path(const char* path) {
  const auto state = BusState::current();
  if (!state) return nullptr;
  const std::lock_guard hold(state->mutex());
  for (const PluggedPtr& plugged : state->plugged()) {
    if (!is_hid(*plugged) || plugged->refused || path_of(*plugged) != path) continue;
    auto* device = new hid_device_;
    device->state = state;
    device->plugged = plugged;
    ++state->handles();
    ask_for_report(device);
    return device;
  }
  return nullptr;
}

HID_API_EXPORT hid_device* hid_open(unsigned short vendor, unsigned short product,
                                    const wchar_t* serial) {
  hid_device_info* list = hid_enumerate(vendor, product);
  hid_device* device = nullptr;
  for (const hid_device_info* one = list; one != nullptr && device == nullptr; one = one->next) {
    if (serial != nullptr && std::wcscmp(serial, one->serial_number) != 0) continue;
    device = hid_open_path(one->path);
  }
  hid_free_enumeration(list);
  return device;
}

void HID_API_EXPORT hid_close(hid_device* device) {
  if (device == nullptr) return;
  {
    const std::lock_guard hold(device->state->mutex());
    device->state->requests().remove_if(
        [device](const Request& request) { return request.handle == device; });
    --device->state->handles();
  }
  delete device;
}

int HID_API_EXPORT hid_read_timeout(hid_device* device, unsigned char* data, size_t length,
                                    int milliseconds) {
  std::unique_lock lock(device->state->mutex());
  const auto something = [device] {
    return !device->reports.empty() || device->plugged->device == nullptr;
  };
  const auto read_timeout = milliseconds < 0 ? std::chrono::milliseconds(3'600'000)
                                             : std::chrono::milliseconds(milliseconds);
  if (!device->state->wait_until(lock, Clock::now() + read_timeout, something)) return 0;
  if (device->reports.empty()) return fail(device, L"No such device");
  const Bytes report = std::move(device->reports.front());
  device->reports.pop_front();
  const std::size_t count = std::min(length, report.size());
  std::copy_n(report.begin(), count, data);
  return static_cast<int>(count);
}

int HID_API_EXPORT hid_read(hid_device* device, unsigned char* data, size_t length) {
  return hid_read_timeout(device, data, length, device->blocking ? -1 : 0);
}

int HID_API_EXPORT hid_set_nonblocking(hid_device* device, int nonblock) {
  device->blocking = nonblock == 0;
  return 0;
}

int HID_API_EXPORT hid_write(hid_device* device, const unsigned char* data, size_t length) {
  if (length < 1) return fail(device, L"Invalid argument");
  Bytes report(data, data + length);
  if (report[0] == 0) report.erase(report.begin());
  const std::uint8_t endpoint = output_endpoint(*device->plugged);
  if (endpoint == 0) {
    const UsbSetup setup{0x21, 0x09, static_cast<std::uint16_t>(0x0200 | data[0]), 0,
                         static_cast<std::uint16_t>(report.size())};
    return control(device, setup, report) < 0 ? -1 : static_cast<int>(length);
  }
  std::unique_lock lock(device->state->mutex());
  if (device->plugged->device == nullptr) return fail(device, L"No such device");
  Request request;
  request.plugged = device->plugged;
  request.endpoint = endpoint;
  request.data = report;
  request.deadline = Clock::now() + timeout;
  const auto [ending, done] = device->state->perform(lock, std::move(request));
  if (ending != Ending::completed) return fail(device, L"Input/output error");
  return static_cast<int>(length);
}

int HID_API_EXPORT hid_send_feature_report(hid_device* device, const unsigned char* data,
                                           size_t length) {
  if (length < 1) return fail(device, L"Invalid argument");
  Bytes report(data, data + length);
  if (report[0] == 0) report.erase(report.begin());
  const UsbSetup setup{0x21, 0x09, static_cast<std::uint16_t>(0x0300 | data[0]), 0,
                       static_cast<std::uint16_t>(report.size())};
  return control(device, setup, report) < 0 ? -1 : static_cast<int>(length);
}

int HID_API_EXPORT hid_get_feature_report(hid_device* device, unsigned char* data, size_t length) {
  if (length < 1) return fail(device, L"Invalid argument");
  const std::size_t skip = data[0] == 0 ? 1 : 0;
  const UsbSetup setup{0xA1, 0x01, static_cast<std::uint16_t>(0x0300 | data[0]), 0,
                       static_cast<std::uint16_t>(length - skip)};
  const int got = control(device, setup, {data + skip, length - skip});
  return got < 0 ? -1 : got + static_cast<int>(skip);
}

int HID_API_EXPORT_CALL hid_get_manufacturer_string(hid_device* device, wchar_t* text,
                                                    size_t capacity) {
  return copy_string(device, 14, text, capacity);
}
int HID_API_EXPORT_CALL hid_get_product_string(hid_device* device, wchar_t* text, size_t capacity) {
  return copy_string(device, 15, text, capacity);
}
int HID_API_EXPORT_CALL hid_get_serial_number_string(hid_device* device, wchar_t* text,
                                                     size_t capacity) {
  return copy_string(device, 16, text, capacity);
}

#if HID_API_VERSION >= HID_API_MAKE_VERSION(0, 14, 0)
int HID_API_EXPORT_CALL hid_get_report_descriptor(hid_device* device, unsigned char* data,
                                                  size_t length) {
  return control(device, {0x81, 0x06, 0x2200, 0, static_cast<std::uint16_t>(length)},
                 {data, length});
}
#endif

HID_API_EXPORT const wchar_t* hid_error(hid_device* device) {
  return device == nullptr ? L"Permission denied" : device->error.c_str();
}

HID_API_EXPORT const struct hid_api_version* hid_version(void) {
  static const struct hid_api_version version = {0, 13, 1};
  return &version;
}
HID_API_EXPORT const char* hid_version_str(void) { return "emulated"; }

}  // extern "C"
