// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/attach/emulated_bus.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "tests/emulated/attach/bus_state.h"

namespace stickslip::emulated {

namespace {

using Clock = std::chrono::steady_clock;

/// A full-speed bus has frames of 1 ms; four polls per frame keep the latency small.
constexpr auto frame_quarter = std::chrono::microseconds(250);

/// The bus of the library replacements, which are C functions without a context for it.
std::mutex registration;
std::weak_ptr<BusState> registered;

std::uint16_t word_at(const Bytes& bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes.at(at) | (bytes.at(at + 1) << 8));
}

Bytes string_descriptor(const std::string& text) {
  Bytes bytes = {static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
  for (const char letter : text) {
    bytes.push_back(static_cast<std::uint8_t>(letter));
    bytes.push_back(0);
  }
  return bytes;
}

}  // namespace

// Plugged

std::uint16_t Plugged::vendor_id() const { return word_at(device_descriptor, 8); }
std::uint16_t Plugged::product_id() const { return word_at(device_descriptor, 10); }

std::size_t Plugged::packet_size(std::uint8_t endpoint_address) const {
  if ((endpoint_address & 0x0FU) == 0) return device_descriptor.at(7);
  const Bytes& all = configuration_descriptor;
  for (std::size_t at = 0; at + 6 < all.size() && all[at] != 0; at += all[at]) {
    if (all[at + 1] == 5 && all[at + 2] == endpoint_address) return word_at(all, at + 4) & 0x7FFU;
  }
  return 0;
}

// BusState

BusState::BusState() = default;

BusState::~BusState() { halt(); }

std::shared_ptr<BusState> BusState::current() {
  const std::lock_guard hold(registration);
  return registered.lock();
}

bool BusState::enlist(const std::shared_ptr<BusState>& state) {
  const std::lock_guard hold(registration);
  if (registered.lock()) return false;
  registered = state;
  return true;
}

void BusState::dismiss(const std::shared_ptr<BusState>& state) {
  const std::lock_guard hold(registration);
  if (registered.lock() == state) registered.reset();
}

void BusState::run() {
  running_ = true;
  controller_ = std::thread([this] {
    std::unique_lock lock(mutex_);
    while (running_) {
      if (requests_.empty()) {
        work_.wait(lock, [this] { return !running_ || !requests_.empty(); });
      } else {
        work_.wait_for(lock, frame_quarter);
      }
      pump();
    }
  });
}

void BusState::halt() {
  {
    const std::lock_guard hold(mutex_);
    running_ = false;
    work_.notify_all();
  }
  if (controller_.joinable()) controller_.join();
}

void BusState::submit(Request request) {
  requests_.push_back(std::move(request));
  work_.notify_all();
}

void BusState::pump() {
  // Requests to one endpoint are served one after the other.
  std::set<std::pair<const Plugged*, std::uint8_t>> busy;
  bool any = false;
  for (auto request = requests_.begin(); request != requests_.end();) {
    const auto endpoint =
        std::pair<const Plugged*, std::uint8_t>(request->plugged.get(), request->endpoint);
    bool over = true;
    if (request->plugged->device == nullptr) {
      request->ending = Ending::no_device;
    } else if (request->cancelled) {
      request->ending = Ending::cancelled;
    } else if (!busy.contains(endpoint) && move(*request)) {
      // move() has set the ending.
    } else if (request->deadline && *request->deadline <= Clock::now()) {
      request->ending = Ending::timed_out;
    } else {
      over = false;
    }
    if (!over) {
      busy.insert(endpoint);
      ++request;
      continue;
    }
    any = true;
    if (request->ended) request->ended(*request);
    if (request->repeats && request->ending == Ending::completed) {
      request->done = 0;  // once per pump
      busy.insert(endpoint);
      ++request;
      continue;
    }
    request = requests_.erase(request);
  }
  if (any) changed_.notify_all();
}

bool BusState::move(Request& request) {
  if (request.endpoint == 0) return move_control(request);
  UsbDevice& device = *request.plugged->device;
  const auto number = static_cast<std::uint8_t>(request.endpoint & 0x0FU);
  if ((request.endpoint & 0x80U) == 0) {
    const UsbStatus status = device.out(number, request.data);
    if (status == UsbStatus::not_ready) return false;
    request.ending = status == UsbStatus::stall ? Ending::stall : Ending::completed;
    if (status == UsbStatus::ok) request.done = request.data.size();
    return true;
  }
  // A host requests complete packets: one that exceeds the buffer overflows.
  const std::size_t packet =
      std::max<std::size_t>(1, request.plugged->packet_size(request.endpoint));
  while (true) {
    const std::size_t left = request.data.size() - request.done;
    const std::size_t capacity = std::max<std::size_t>(1, (left + packet - 1) / packet) * packet;
    const UsbAnswer answer = device.in(number, capacity);
    if (answer.status == UsbStatus::not_ready) return false;
    if (answer.status == UsbStatus::stall) {
      request.ending = Ending::stall;
      return true;
    }
    const std::size_t fits = std::min(left, answer.bytes.size());
    std::copy_n(answer.bytes.begin(), fits,
                request.data.begin() + static_cast<std::ptrdiff_t>(request.done));
    request.done += fits;
    if (answer.bytes.size() > left) {
      request.ending = Ending::overflow;
      return true;
    }
    const bool full = request.done == request.data.size();
    const bool short_packet = answer.bytes.size() % packet != 0 || answer.bytes.empty();
    if (full || short_packet) {
      request.ending = Ending::completed;
      return true;
    }
  }
}

bool BusState::move_control(Request& request) {
  const UsbSetup& setup = request.setup;
  const bool standard = (setup.request_type & 0x60U) == 0;
  const bool of_interface = (setup.request_type & 0x1FU) == 1;
  const bool in = (setup.request_type & 0x80U) != 0;
  const std::span<const std::uint8_t> out = in ? std::span<std::uint8_t>() : request.data;
  const UsbAnswer answer = standard && !of_interface ? standard_request(*request.plugged, setup)
                                                     : request.plugged->device->control(setup, out);
  if (answer.status == UsbStatus::not_ready) return false;
  request.ending = answer.status == UsbStatus::stall ? Ending::stall : Ending::completed;
  if (answer.status != UsbStatus::ok) return true;
  request.done = request.data.size();
  if (in) {
    request.done = std::min(request.data.size(), answer.bytes.size());
    std::copy_n(answer.bytes.begin(), request.done, request.data.begin());
  }
  return true;
}

UsbAnswer BusState::standard_request(Plugged& plugged, const UsbSetup& setup) {
  const auto index = static_cast<std::uint8_t>(setup.value);
  switch (setup.request) {
    case 0x00:  // GET_STATUS
      return {UsbStatus::ok, {0, 0}};
    case 0x01:  // CLEAR_FEATURE: endpoint halt only
      if ((setup.request_type & 0x1FU) == 2) {
        clear_halt(plugged, static_cast<std::uint8_t>(setup.index));
      }
      return {};
    case 0x06:  // GET_DESCRIPTOR
      switch (setup.value >> 8) {
        case 1:
          return {UsbStatus::ok, plugged.device_descriptor};
        case 2:
          return {UsbStatus::ok, plugged.configuration_descriptor};
        case 3: {
          if (index == 0) return {UsbStatus::ok, {4, 3, 0x09, 0x04}};
          const std::string text = plugged.device->string(index);
          if (text.empty()) return {UsbStatus::stall, {}};
          return {UsbStatus::ok, string_descriptor(text)};
        }
        default:
          return {UsbStatus::stall, {}};
      }
    case 0x08:  // GET_CONFIGURATION
      return {UsbStatus::ok, {plugged.configuration}};
    case 0x09:  // SET_CONFIGURATION
      plugged.configuration = index;
      return {};
    default:
      return {UsbStatus::stall, {}};
  }
}

std::pair<Ending, std::size_t> BusState::perform(std::unique_lock<std::mutex>& lock,
                                                 Request request) {
  std::optional<std::pair<Ending, std::size_t>> result;
  request.ended = [&result](Request& over) { result = {over.ending, over.done}; };
  submit(std::move(request));
  pump();
  changed_.wait(lock, [&result] { return result.has_value(); });
  return *result;
}

void BusState::clear_halt(Plugged& plugged, std::uint8_t endpoint_address) {
  if (plugged.device != nullptr) plugged.device->clear_halt(endpoint_address);
}

// EmulatedBus

EmulatedBus::EmulatedBus() : state_(std::make_shared<BusState>()) {
  if (!BusState::enlist(state_)) throw std::logic_error("an emulated bus exists already");
  state_->run();
}

EmulatedBus::~EmulatedBus() {
  BusState::dismiss(state_);
  {
    const std::lock_guard hold(state_->mutex());
    for (const PluggedPtr& plugged : state_->plugged()) plugged->device = nullptr;
    state_->plugged().clear();
    state_->pump();
    state_->wake();
  }
  state_->halt();
}

void EmulatedBus::plug(UsbDevice& device, std::uint8_t port) {
  const std::lock_guard hold(state_->mutex());
  device.reset();
  auto plugged = std::make_shared<Plugged>();
  plugged->device = &device;
  plugged->port = port;
  plugged->address = state_->next_address();
  plugged->device_descriptor = device.device_descriptor();
  plugged->configuration_descriptor = device.configuration_descriptor();
  state_->plugged().push_back(std::move(plugged));
}

void EmulatedBus::unplug(UsbDevice& device) {
  const std::lock_guard hold(state_->mutex());
  for (const PluggedPtr& plugged : state_->plugged()) {
    if (plugged->device == &device) plugged->device = nullptr;
  }
  state_->plugged().remove_if([](const PluggedPtr& plugged) { return plugged->device == nullptr; });
  state_->pump();
  state_->wake();
}

void EmulatedBus::refuse_access(UsbDevice& device, bool refuse) {
  const std::lock_guard hold(state_->mutex());
  for (const PluggedPtr& plugged : state_->plugged()) {
    if (plugged->device == &device) plugged->refused = refuse;
  }
}

void EmulatedBus::hold_by_kernel_driver(UsbDevice& device) {
  const std::lock_guard hold(state_->mutex());
  for (const PluggedPtr& plugged : state_->plugged()) {
    if (plugged->device == &device) plugged->kernel_driver = true;
  }
}

void EmulatedBus::between_calls(const std::function<void()>& action) {
  const std::lock_guard hold(state_->mutex());
  action();
}

int EmulatedBus::open_handles() const {
  const std::lock_guard hold(state_->mutex());
  return state_->handles();
}

std::size_t EmulatedBus::transfers_in_flight() const {
  const std::lock_guard hold(state_->mutex());
  return state_->outstanding();
}

std::size_t EmulatedBus::transfers_waiting() const {
  const std::lock_guard hold(state_->mutex());
  const auto& requests = state_->requests();
  return static_cast<std::size_t>(
      std::count_if(requests.begin(), requests.end(),
                    [](const Request& request) { return request.owner != nullptr; }));
}

std::vector<std::string> EmulatedBus::misuses() const {
  const std::lock_guard hold(state_->mutex());
  return state_->misuses();
}

}  // namespace stickslip::emulated
