// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/attach/emulated_libusb.h"

#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <mutex>
#include <set>
#include <utility>

#include "tests/emulated/attach/bus_state.h"

using stickslip::emulated::BusState;
using stickslip::emulated::Ending;
using stickslip::emulated::Plugged;
using stickslip::emulated::PluggedPtr;
using stickslip::emulated::Request;

// Definitions of the library's opaque types.

struct libusb_context {
  struct Ended {
    libusb_transfer* transfer;
    Ending ending;
    std::size_t done;
  };
  std::shared_ptr<BusState> state;
  std::deque<Ended> ended;
  bool interrupted = false;
  bool handling = false;
  int handles = 0;
};

struct libusb_device {
  libusb_context* context;
  PluggedPtr plugged;
  std::atomic<int> references{1};
};

struct libusb_device_handle {
  libusb_device* device;
  bool detaches_kernel_driver = false;
};

namespace {

using Clock = std::chrono::steady_clock;

std::mutex default_context_lock;
libusb_context* default_context = nullptr;
int default_context_users = 0;

thread_local bool in_callback = false;

libusb_context* make_context() {
  auto* context = new libusb_context;
  context->state = BusState::current();
  if (!context->state) context->state = std::make_shared<BusState>();  // no devices
  return context;
}

libusb_context* context_of(libusb_context* context) {
  if (context != nullptr) return context;
  const std::lock_guard hold(default_context_lock);
  return default_context;
}

libusb_context* context_of(const libusb_device_handle* handle) { return handle->device->context; }
BusState& state_of(const libusb_device_handle* handle) { return *context_of(handle)->state; }
Plugged& plugged_of(const libusb_device_handle* handle) { return *handle->device->plugged; }

int error_of(Ending ending) {
  switch (ending) {
    case Ending::completed:
      return LIBUSB_SUCCESS;
    case Ending::timed_out:
      return LIBUSB_ERROR_TIMEOUT;
    case Ending::stall:
      return LIBUSB_ERROR_PIPE;
    case Ending::no_device:
      return LIBUSB_ERROR_NO_DEVICE;
    case Ending::overflow:
      return LIBUSB_ERROR_OVERFLOW;
    case Ending::cancelled:
      break;
  }
  return LIBUSB_ERROR_IO;
}

libusb_transfer_status status_of(Ending ending) {
  switch (ending) {
    case Ending::completed:
      return LIBUSB_TRANSFER_COMPLETED;
    case Ending::timed_out:
      return LIBUSB_TRANSFER_TIMED_OUT;
    case Ending::stall:
      return LIBUSB_TRANSFER_STALL;
    case Ending::no_device:
      return LIBUSB_TRANSFER_NO_DEVICE;
    case Ending::overflow:
      return LIBUSB_TRANSFER_OVERFLOW;
    case Ending::cancelled:
      break;
  }
  return LIBUSB_TRANSFER_CANCELLED;
}

std::optional<Clock::time_point> deadline_after(unsigned timeout_ms) {
  if (timeout_ms == 0) return std::nullopt;
  return Clock::now() + std::chrono::milliseconds(timeout_ms);
}

void note(BusState& state, const char* misuse) { state.misuses().emplace_back(misuse); }

bool must_be_claimed(BusState& state, const libusb_device_handle* handle, std::uint8_t endpoint) {
  if ((endpoint & 0x0FU) == 0 || plugged_of(handle).claims.contains(handle)) return true;
  note(state, "a transfer on an interface that was not claimed");
  return false;
}

bool in_flight(libusb_context& context, const libusb_transfer* transfer) {
  for (const Request& request : context.state->requests()) {
    if (request.owner == transfer) return true;
  }
  return std::any_of(context.ended.begin(), context.ended.end(),
                     [&](const auto& ended) { return ended.transfer == transfer; });
}

/// Removes the transfers selected by `which`, without callbacks. Returns their number.
template <class Which>
std::size_t discard(libusb_context& context, Which which) {
  auto& requests = context.state->requests();
  std::size_t discarded = requests.remove_if([&](const Request& request) {
    return request.owner != nullptr && which(static_cast<libusb_transfer*>(request.owner));
  });
  discarded +=
      std::erase_if(context.ended, [&](const auto& ended) { return which(ended.transfer); });
  context.state->outstanding() -= discarded;
  return discarded;
}

Request request_of(libusb_transfer* transfer) {
  Request request;
  request.plugged = transfer->dev_handle->device->plugged;
  request.endpoint = transfer->endpoint;
  request.data = {transfer->buffer, static_cast<std::size_t>(transfer->length)};
  request.handle = transfer->dev_handle;
  request.owner = transfer;
  request.deadline = deadline_after(transfer->timeout);
  if (transfer->type == LIBUSB_TRANSFER_TYPE_CONTROL) {
    const unsigned char* setup = transfer->buffer;
    const auto word = [setup](int at) {
      return static_cast<std::uint16_t>(setup[at] | (setup[at + 1] << 8));
    };
    request.endpoint = 0;
    request.setup = {setup[0], setup[1], word(2), word(4), word(6)};
    request.data = request.data.subspan(LIBUSB_CONTROL_SETUP_SIZE);
    request.data =
        request.data.first(std::min<std::size_t>(request.data.size(), request.setup.length));
  }
  libusb_context* context = context_of(transfer->dev_handle);
  request.ended = [context, transfer](Request& over) {
    context->ended.push_back({transfer, over.ending, over.done});
  };
  return request;
}

void call_back(const libusb_context::Ended& ended) {
  libusb_transfer* transfer = ended.transfer;
  transfer->status = status_of(ended.ending);
  transfer->actual_length = static_cast<int>(ended.done);
  const bool control = transfer->type == LIBUSB_TRANSFER_TYPE_CONTROL;
  if (transfer->status == LIBUSB_TRANSFER_COMPLETED && !control &&
      (transfer->flags & LIBUSB_TRANSFER_SHORT_NOT_OK) != 0 &&
      transfer->actual_length < transfer->length) {
    transfer->status = LIBUSB_TRANSFER_ERROR;
  }
  const std::uint8_t flags = transfer->flags;
  in_callback = true;
  if (transfer->callback != nullptr) transfer->callback(transfer);
  in_callback = false;
  if ((flags & LIBUSB_TRANSFER_FREE_TRANSFER) != 0) libusb_free_transfer(transfer);
}

int handle_events(libusb_context* given, std::chrono::microseconds timeout, int* completed) {
  libusb_context* context = context_of(given);
  if (context == nullptr) return LIBUSB_ERROR_INVALID_PARAM;
  if (in_callback) return LIBUSB_ERROR_BUSY;
  BusState& state = *context->state;
  const auto until = Clock::now() + timeout;
  std::unique_lock lock(state.mutex());
  const auto over = [completed] { return completed != nullptr && *completed != 0; };
  if (!state.wait_until(lock, until, [&] { return !context->handling || over(); })) return 0;
  if (over()) return 0;
  context->handling = true;
  state.wait_until(lock, until,
                   [&] { return !context->ended.empty() || context->interrupted || over(); });
  context->interrupted = false;
  for (std::size_t left = context->ended.size(); left > 0 && !context->ended.empty(); --left) {
    const libusb_context::Ended ended = context->ended.front();
    context->ended.pop_front();
    --state.outstanding();
    lock.unlock();
    call_back(ended);
    lock.lock();
  }
  context->handling = false;
  state.wake();
  return 0;
}

std::chrono::microseconds timeout_of(const timeval* tv) {
  return std::chrono::seconds(tv->tv_sec) + std::chrono::microseconds(tv->tv_usec);
}

constexpr timeval a_minute{60, 0};

int transfer_now(libusb_device_handle* handle, unsigned char endpoint, unsigned char* data,
                 int length, int* transferred, unsigned timeout_ms) {
  if (in_callback) return LIBUSB_ERROR_BUSY;
  BusState& state = state_of(handle);
  std::unique_lock lock(state.mutex());
  if (transferred != nullptr) *transferred = 0;
  Plugged& plugged = plugged_of(handle);
  if (plugged.device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  must_be_claimed(state, handle, endpoint);
  if (plugged.packet_size(endpoint) == 0) return LIBUSB_ERROR_IO;
  Request request;
  request.plugged = handle->device->plugged;
  request.endpoint = endpoint;
  request.data = {data, static_cast<std::size_t>(length)};
  request.handle = handle;
  request.deadline = deadline_after(timeout_ms);
  const auto [ending, done] = state.perform(lock, std::move(request));
  if (transferred != nullptr) *transferred = static_cast<int>(done);
  return error_of(ending);
}

/// A configuration and the objects that it points to, in one allocation.
struct ConfigWithParts {
  libusb_config_descriptor config{};
  libusb_interface interface {};
  libusb_interface_descriptor setting{};
  std::array<libusb_endpoint_descriptor, 16> endpoints{};
};

ConfigWithParts* parse(const stickslip::emulated::Bytes& bytes) {
  auto* parts = new ConfigWithParts;
  parts->config.bLength = 9;
  parts->config.bDescriptorType = LIBUSB_DT_CONFIG;
  parts->config.wTotalLength = static_cast<std::uint16_t>(bytes.size());
  parts->config.bNumInterfaces = 1;
  parts->config.bConfigurationValue = bytes.at(5);
  parts->config.bmAttributes = bytes.at(7);
  parts->config.MaxPower = bytes.at(8);
  parts->config.interface = &parts->interface;
  parts->interface.altsetting = &parts->setting;
  parts->interface.num_altsetting = 1;
  parts->setting.endpoint = parts->endpoints.data();
  std::size_t endpoints = 0;
  for (std::size_t at = 0; at + 1 < bytes.size() && bytes[at] != 0; at += bytes[at]) {
    if (bytes[at + 1] == LIBUSB_DT_INTERFACE) {
      std::memcpy(&parts->setting, &bytes[at], 9);
    } else if (bytes[at + 1] == LIBUSB_DT_ENDPOINT && endpoints < parts->endpoints.size()) {
      libusb_endpoint_descriptor& endpoint = parts->endpoints[endpoints++];
      endpoint.bLength = bytes[at];
      endpoint.bDescriptorType = bytes[at + 1];
      endpoint.bEndpointAddress = bytes[at + 2];
      endpoint.bmAttributes = bytes[at + 3];
      endpoint.wMaxPacketSize = static_cast<std::uint16_t>(bytes[at + 4] | (bytes[at + 5] << 8));
      endpoint.bInterval = bytes[at + 6];
    }
  }
  return parts;
}

}  // namespace

extern "C" {

// Contexts

int LIBUSB_CALL libusb_init(libusb_context** context) {
  if (context != nullptr) {
    *context = make_context();
    return LIBUSB_SUCCESS;
  }
  const std::lock_guard hold(default_context_lock);
  if (default_context_users++ == 0) default_context = make_context();
  return LIBUSB_SUCCESS;
}

#if LIBUSB_API_VERSION >= 0x0100010A
int LIBUSB_CALL libusb_init_context(libusb_context** context, const struct libusb_init_option[],
                                    int) {
  return libusb_init(context);
}
#endif

void LIBUSB_CALL libusb_exit(libusb_context* context) {
  if (context == nullptr) {
    const std::lock_guard hold(default_context_lock);
    if (default_context_users == 0 || --default_context_users > 0) return;
    context = std::exchange(default_context, nullptr);
  }
  {
    const std::lock_guard hold(context->state->mutex());
    if (context->handles > 0) note(*context->state, "a context left with open handles");
    discard(*context, [context](const libusb_transfer* transfer) {
      return context_of(transfer->dev_handle) == context;
    });
  }
  delete context;
}

int LIBUSB_CALL libusb_set_option(libusb_context*, enum libusb_option, ...) {
  return LIBUSB_SUCCESS;
}
void LIBUSB_CALL libusb_set_debug(libusb_context*, int) {}
void LIBUSB_CALL libusb_set_log_cb(libusb_context*, libusb_log_cb, int) {}

int LIBUSB_CALL libusb_has_capability(std::uint32_t capability) {
  return capability == LIBUSB_CAP_HAS_CAPABILITY ||
                 capability == LIBUSB_CAP_SUPPORTS_DETACH_KERNEL_DRIVER
             ? 1
             : 0;
}

const struct libusb_version* LIBUSB_CALL libusb_get_version(void) {
  static const struct libusb_version version = {1, 0, 26, 0, "", "emulated"};
  return &version;
}

const char* LIBUSB_CALL libusb_error_name(int code) {
  switch (code) {
    case LIBUSB_SUCCESS:
      return "LIBUSB_SUCCESS";
    case LIBUSB_ERROR_IO:
      return "LIBUSB_ERROR_IO";
    case LIBUSB_ERROR_INVALID_PARAM:
      return "LIBUSB_ERROR_INVALID_PARAM";
    case LIBUSB_ERROR_ACCESS:
      return "LIBUSB_ERROR_ACCESS";
    case LIBUSB_ERROR_NO_DEVICE:
      return "LIBUSB_ERROR_NO_DEVICE";
    case LIBUSB_ERROR_NOT_FOUND:
      return "LIBUSB_ERROR_NOT_FOUND";
    case LIBUSB_ERROR_BUSY:
      return "LIBUSB_ERROR_BUSY";
    case LIBUSB_ERROR_TIMEOUT:
      return "LIBUSB_ERROR_TIMEOUT";
    case LIBUSB_ERROR_OVERFLOW:
      return "LIBUSB_ERROR_OVERFLOW";
    case LIBUSB_ERROR_PIPE:
      return "LIBUSB_ERROR_PIPE";
    case LIBUSB_ERROR_INTERRUPTED:
      return "LIBUSB_ERROR_INTERRUPTED";
    case LIBUSB_ERROR_NO_MEM:
      return "LIBUSB_ERROR_NO_MEM";
    case LIBUSB_ERROR_NOT_SUPPORTED:
      return "LIBUSB_ERROR_NOT_SUPPORTED";
    case LIBUSB_ERROR_OTHER:
      return "LIBUSB_ERROR_OTHER";
    default:
      return "**UNKNOWN**";
  }
}
const char* LIBUSB_CALL libusb_strerror(int code) { return libusb_error_name(code); }

// Devices

ssize_t LIBUSB_CALL libusb_get_device_list(libusb_context* given, libusb_device*** list) {
  libusb_context* context = context_of(given);
  if (context == nullptr) return LIBUSB_ERROR_INVALID_PARAM;
  const std::lock_guard hold(context->state->mutex());
  const auto& plugged = context->state->plugged();
  auto** devices =
      static_cast<libusb_device**>(std::calloc(plugged.size() + 1, sizeof(libusb_device*)));
  std::size_t count = 0;
  for (const PluggedPtr& one : plugged) devices[count++] = new libusb_device{context, one};
  *list = devices;
  return static_cast<ssize_t>(count);
}

void LIBUSB_CALL libusb_free_device_list(libusb_device** list, int unref_devices) {
  for (libusb_device** device = list; unref_devices != 0 && *device != nullptr; ++device) {
    libusb_unref_device(*device);
  }
  std::free(list);
}

libusb_device* LIBUSB_CALL libusb_ref_device(libusb_device* device) {
  ++device->references;
  return device;
}

void LIBUSB_CALL libusb_unref_device(libusb_device* device) {
  if (--device->references == 0) delete device;
}

int LIBUSB_CALL libusb_get_device_descriptor(libusb_device* device,
                                             struct libusb_device_descriptor* descriptor) {
  const auto& bytes = device->plugged->device_descriptor;
  const auto word = [&bytes](std::size_t at) {
    return static_cast<std::uint16_t>(bytes.at(at) | (bytes.at(at + 1) << 8));
  };
  *descriptor = {bytes.at(0),  bytes.at(1),  word(2),      bytes.at(4), bytes.at(5),
                 bytes.at(6),  bytes.at(7),  word(8),      word(10),    word(12),
                 bytes.at(14), bytes.at(15), bytes.at(16), bytes.at(17)};
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_get_active_config_descriptor(libusb_device* device,
                                                    struct libusb_config_descriptor** config) {
  *config = &parse(device->plugged->configuration_descriptor)->config;
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_get_config_descriptor(libusb_device* device, std::uint8_t index,
                                             struct libusb_config_descriptor** config) {
  if (index != 0) return LIBUSB_ERROR_NOT_FOUND;
  return libusb_get_active_config_descriptor(device, config);
}

void LIBUSB_CALL libusb_free_config_descriptor(struct libusb_config_descriptor* config) {
  // The configuration is the first member of the allocation.
  delete reinterpret_cast<ConfigWithParts*>(config);
}

std::uint8_t LIBUSB_CALL libusb_get_bus_number(libusb_device*) { return 1; }
std::uint8_t LIBUSB_CALL libusb_get_port_number(libusb_device* device) {
  return device->plugged->port;
}
int LIBUSB_CALL libusb_get_port_numbers(libusb_device* device, std::uint8_t* ports, int capacity) {
  if (capacity < 1) return LIBUSB_ERROR_OVERFLOW;
  ports[0] = device->plugged->port;
  return 1;
}
std::uint8_t LIBUSB_CALL libusb_get_device_address(libusb_device* device) {
  return device->plugged->address;
}
int LIBUSB_CALL libusb_get_device_speed(libusb_device*) { return LIBUSB_SPEED_FULL; }
int LIBUSB_CALL libusb_get_max_packet_size(libusb_device* device, unsigned char endpoint) {
  const auto size = device->plugged->packet_size(endpoint);
  return size == 0 ? static_cast<int>(LIBUSB_ERROR_NOT_FOUND) : static_cast<int>(size);
}

// Handles

int LIBUSB_CALL libusb_open(libusb_device* device, libusb_device_handle** handle) {
  BusState& state = *device->context->state;
  const std::lock_guard hold(state.mutex());
  if (device->plugged->device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  if (device->plugged->refused) return LIBUSB_ERROR_ACCESS;
  *handle = new libusb_device_handle{libusb_ref_device(device)};
  ++device->context->handles;
  ++state.handles();
  return LIBUSB_SUCCESS;
}

libusb_device_handle* LIBUSB_CALL libusb_open_device_with_vid_pid(libusb_context* context,
                                                                  std::uint16_t vendor,
                                                                  std::uint16_t product) {
  libusb_device** list = nullptr;
  if (libusb_get_device_list(context, &list) < 0) return nullptr;
  libusb_device_handle* handle = nullptr;
  for (libusb_device** device = list; *device != nullptr && handle == nullptr; ++device) {
    const Plugged& plugged = *(*device)->plugged;
    if (plugged.vendor_id() != vendor || plugged.product_id() != product) continue;
    if (libusb_open(*device, &handle) != LIBUSB_SUCCESS) handle = nullptr;
  }
  libusb_free_device_list(list, 1);
  return handle;
}

void LIBUSB_CALL libusb_close(libusb_device_handle* handle) {
  if (handle == nullptr) return;
  libusb_context* context = context_of(handle);
  {
    const std::lock_guard hold(context->state->mutex());
    const auto its = [handle](const libusb_transfer* transfer) {
      return transfer->dev_handle == handle;
    };
    if (discard(*context, its) > 0) {
      note(*context->state, "a handle closed with transfers in flight");
    }
    plugged_of(handle).claims.erase(handle);
    --context->handles;
    --context->state->handles();
    context->state->wake();
  }
  libusb_unref_device(handle->device);
  delete handle;
}

libusb_device* LIBUSB_CALL libusb_get_device(libusb_device_handle* handle) {
  return handle->device;
}

int LIBUSB_CALL libusb_get_configuration(libusb_device_handle* handle, int* configuration) {
  const std::lock_guard hold(state_of(handle).mutex());
  if (plugged_of(handle).device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  *configuration = plugged_of(handle).configuration;
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_set_configuration(libusb_device_handle* handle, int configuration) {
  const std::lock_guard hold(state_of(handle).mutex());
  Plugged& plugged = plugged_of(handle);
  if (plugged.device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  if (!plugged.claims.empty() || plugged.kernel_driver) return LIBUSB_ERROR_BUSY;
  if (configuration != 1) return LIBUSB_ERROR_NOT_FOUND;
  plugged.configuration = static_cast<std::uint8_t>(configuration);
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_claim_interface(libusb_device_handle* handle, int number) {
  const std::lock_guard hold(state_of(handle).mutex());
  Plugged& plugged = plugged_of(handle);
  if (plugged.device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  if (number != 0) return LIBUSB_ERROR_NOT_FOUND;
  if (plugged.claims.contains(handle)) return LIBUSB_SUCCESS;
  if (plugged.kernel_driver && handle->detaches_kernel_driver) plugged.kernel_driver = false;
  if (plugged.kernel_driver || !plugged.claims.empty()) return LIBUSB_ERROR_BUSY;
  plugged.claims.insert(handle);
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_release_interface(libusb_device_handle* handle, int) {
  const std::lock_guard hold(state_of(handle).mutex());
  const bool claimed = plugged_of(handle).claims.erase(handle) > 0;
  if (plugged_of(handle).device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  return claimed ? LIBUSB_SUCCESS : LIBUSB_ERROR_NOT_FOUND;
}

int LIBUSB_CALL libusb_set_interface_alt_setting(libusb_device_handle* handle, int number,
                                                 int setting) {
  const std::lock_guard hold(state_of(handle).mutex());
  if (plugged_of(handle).device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  return number == 0 && setting == 0 ? LIBUSB_SUCCESS : LIBUSB_ERROR_NOT_FOUND;
}

int LIBUSB_CALL libusb_kernel_driver_active(libusb_device_handle* handle, int) {
  const std::lock_guard hold(state_of(handle).mutex());
  if (plugged_of(handle).device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  return plugged_of(handle).kernel_driver ? 1 : 0;
}

int LIBUSB_CALL libusb_detach_kernel_driver(libusb_device_handle* handle, int) {
  const std::lock_guard hold(state_of(handle).mutex());
  if (plugged_of(handle).device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  return std::exchange(plugged_of(handle).kernel_driver, false) ? LIBUSB_SUCCESS
                                                                : LIBUSB_ERROR_NOT_FOUND;
}

int LIBUSB_CALL libusb_attach_kernel_driver(libusb_device_handle*, int) {
  return LIBUSB_ERROR_NOT_FOUND;  // no driver supports such a device
}

int LIBUSB_CALL libusb_set_auto_detach_kernel_driver(libusb_device_handle* handle, int enable) {
  handle->detaches_kernel_driver = enable != 0;
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_clear_halt(libusb_device_handle* handle, unsigned char endpoint) {
  BusState& state = state_of(handle);
  const std::lock_guard hold(state.mutex());
  Plugged& plugged = plugged_of(handle);
  if (plugged.device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  if (plugged.packet_size(endpoint) == 0) return LIBUSB_ERROR_NOT_FOUND;
  state.clear_halt(plugged, endpoint);
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_reset_device(libusb_device_handle* handle) {
  BusState& state = state_of(handle);
  const std::lock_guard hold(state.mutex());
  Plugged& plugged = plugged_of(handle);
  if (plugged.device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  for (Request& request : state.requests()) {
    if (request.plugged.get() == &plugged) request.cancelled = true;
  }
  state.pump();
  plugged.device->reset();
  return LIBUSB_SUCCESS;
}

// Synchronous transfers

int LIBUSB_CALL libusb_control_transfer(libusb_device_handle* handle, std::uint8_t request_type,
                                        std::uint8_t request, std::uint16_t value,
                                        std::uint16_t index, unsigned char* data,
                                        std::uint16_t length, unsigned int timeout_ms) {
  if (in_callback) return LIBUSB_ERROR_BUSY;
  BusState& state = state_of(handle);
  std::unique_lock lock(state.mutex());
  if (plugged_of(handle).device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  Request control;
  control.plugged = handle->device->plugged;
  control.setup = {request_type, request, value, index, length};
  control.data = {data, length};
  control.handle = handle;
  control.deadline = deadline_after(timeout_ms);
  const auto [ending, done] = state.perform(lock, std::move(control));
  return ending == Ending::completed ? static_cast<int>(done) : error_of(ending);
}

int LIBUSB_CALL libusb_bulk_transfer(libusb_device_handle* handle, unsigned char endpoint,
                                     unsigned char* data, int length, int* transferred,
                                     unsigned int timeout_ms) {
  return transfer_now(handle, endpoint, data, length, transferred, timeout_ms);
}

int LIBUSB_CALL libusb_interrupt_transfer(libusb_device_handle* handle, unsigned char endpoint,
                                          unsigned char* data, int length, int* transferred,
                                          unsigned int timeout_ms) {
  return transfer_now(handle, endpoint, data, length, transferred, timeout_ms);
}

int LIBUSB_CALL libusb_get_string_descriptor_ascii(libusb_device_handle* handle, std::uint8_t index,
                                                   unsigned char* text, int capacity) {
  if (index == 0) return LIBUSB_ERROR_INVALID_PARAM;
  std::array<unsigned char, 255> bytes{};
  const int got =
      libusb_control_transfer(handle, LIBUSB_ENDPOINT_IN, LIBUSB_REQUEST_GET_DESCRIPTOR,
                              static_cast<std::uint16_t>((LIBUSB_DT_STRING << 8) | index), 0x0409,
                              bytes.data(), static_cast<std::uint16_t>(bytes.size()), 1000);
  if (got < 0) return got;
  if (got < 2 || bytes[0] > got || bytes[1] != LIBUSB_DT_STRING) return LIBUSB_ERROR_IO;
  int length = 0;
  for (std::size_t at = 2; at + 1 < bytes[0] && length + 1 < capacity; at += 2) {
    text[length++] = bytes[at + 1] == 0 && bytes[at] < 0x80 ? bytes[at] : '?';
  }
  if (capacity > 0) text[length] = 0;
  return length;
}

// Asynchronous transfers

struct libusb_transfer* LIBUSB_CALL libusb_alloc_transfer(int packets) {
  const std::size_t size = sizeof(libusb_transfer) +
                           static_cast<std::size_t>(packets) * sizeof(libusb_iso_packet_descriptor);
  auto* transfer = static_cast<libusb_transfer*>(std::calloc(1, size));
  if (transfer != nullptr) transfer->num_iso_packets = packets;
  return transfer;
}

void LIBUSB_CALL libusb_free_transfer(struct libusb_transfer* transfer) {
  if (transfer == nullptr) return;
  // A transfer of a closed handle is no longer in flight, but the handle must not be accessed: the
  // existing bus is searched for the address of the transfer.
  if (const auto state = BusState::current()) {
    const std::lock_guard hold(state->mutex());
    const auto its = [transfer](const Request& request) { return request.owner == transfer; };
    if (const auto count = state->requests().remove_if(its); count > 0) {
      state->outstanding() -= count;
      note(*state, "a transfer freed in flight");
    }
  }
  if ((transfer->flags & LIBUSB_TRANSFER_FREE_BUFFER) != 0) std::free(transfer->buffer);
  std::free(transfer);
}

int LIBUSB_CALL libusb_submit_transfer(struct libusb_transfer* transfer) {
  libusb_context* context = context_of(transfer->dev_handle);
  BusState& state = *context->state;
  const std::lock_guard hold(state.mutex());
  Plugged& plugged = plugged_of(transfer->dev_handle);
  if (plugged.device == nullptr) return LIBUSB_ERROR_NO_DEVICE;
  if (in_flight(*context, transfer)) return LIBUSB_ERROR_BUSY;
  if (transfer->type == LIBUSB_TRANSFER_TYPE_ISOCHRONOUS) return LIBUSB_ERROR_NOT_SUPPORTED;
  if (transfer->length < 0) return LIBUSB_ERROR_INVALID_PARAM;
  if (transfer->type == LIBUSB_TRANSFER_TYPE_CONTROL) {
    if (static_cast<std::size_t>(transfer->length) < LIBUSB_CONTROL_SETUP_SIZE)
      return LIBUSB_ERROR_INVALID_PARAM;
  } else {
    must_be_claimed(state, transfer->dev_handle, transfer->endpoint);
    if (plugged.packet_size(transfer->endpoint) == 0) return LIBUSB_ERROR_IO;
  }
  ++state.outstanding();
  state.submit(request_of(transfer));
  return LIBUSB_SUCCESS;
}

int LIBUSB_CALL libusb_cancel_transfer(struct libusb_transfer* transfer) {
  BusState& state = state_of(transfer->dev_handle);
  const std::lock_guard hold(state.mutex());
  for (Request& request : state.requests()) {
    if (request.owner != transfer) continue;
    request.cancelled = true;
    return LIBUSB_SUCCESS;
  }
  return LIBUSB_ERROR_NOT_FOUND;
}

// Events

int LIBUSB_CALL libusb_handle_events_timeout_completed(libusb_context* context, struct timeval* tv,
                                                       int* completed) {
  return handle_events(context, timeout_of(tv), completed);
}
int LIBUSB_CALL libusb_handle_events_timeout(libusb_context* context, struct timeval* tv) {
  return handle_events(context, timeout_of(tv), nullptr);
}
int LIBUSB_CALL libusb_handle_events_completed(libusb_context* context, int* completed) {
  return handle_events(context, timeout_of(&a_minute), completed);
}
int LIBUSB_CALL libusb_handle_events(libusb_context* context) {
  return handle_events(context, timeout_of(&a_minute), nullptr);
}
void LIBUSB_CALL libusb_interrupt_event_handler(libusb_context* given) {
  libusb_context* context = context_of(given);
  const std::lock_guard hold(context->state->mutex());
  context->interrupted = true;
  context->state->wake();
}

// Hotplug: absent

int LIBUSB_CALL libusb_hotplug_register_callback(libusb_context*, int, int, int, int, int,
                                                 libusb_hotplug_callback_fn, void*,
                                                 libusb_hotplug_callback_handle*) {
  return LIBUSB_ERROR_NOT_SUPPORTED;
}
void LIBUSB_CALL libusb_hotplug_deregister_callback(libusb_context*,
                                                    libusb_hotplug_callback_handle) {}

}  // extern "C"
