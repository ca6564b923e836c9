// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/gpio/emulated_gpio.h"

#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <utility>

namespace stickslip::emulated {

EmulatedGpio& emulated_gpio() {
  static EmulatedGpio chips;
  return chips;
}

const EmulatedGpio::Chip* EmulatedGpio::chip(const std::string& path) const {
  for (const Chip& one : chips_) {
    if (one.path == path && !one.gone) return &one;
  }
  return nullptr;
}

EmulatedGpio::Chip* EmulatedGpio::chip(const std::string& path) {
  return const_cast<Chip*>(std::as_const(*this).chip(path));
}

void EmulatedGpio::clear() {
  const std::lock_guard lock(mutex_);
  chips_.clear();
}

void EmulatedGpio::add_chip(const std::string& path, const std::string& label,
                            std::vector<std::string> line_names) {
  const std::lock_guard lock(mutex_);
  Chip& added = chips_.emplace_back();
  added.path = path;
  added.label = label;
  for (std::string& name : line_names) added.lines.emplace_back().name = std::move(name);
}

void EmulatedGpio::forbid(const std::string& path, bool forbidden) {
  const std::lock_guard lock(mutex_);
  chip(path)->forbidden = forbidden;
}

void EmulatedGpio::set_edge_support(const std::string& path, bool supported) {
  const std::lock_guard lock(mutex_);
  chip(path)->has_edges = supported;
}

void EmulatedGpio::unplug(const std::string& path) {
  const std::lock_guard lock(mutex_);
  chip(path)->gone = true;
}

void EmulatedGpio::fail_next_sets(const std::string& path, int count) {
  const std::lock_guard lock(mutex_);
  chip(path)->failing_sets = count;
}

void EmulatedGpio::swallow_next_sets(const std::string& path, int count) {
  const std::lock_guard lock(mutex_);
  chip(path)->swallowed_sets = count;
}

void EmulatedGpio::set_read_back(const std::string& path, bool supported) {
  const std::lock_guard lock(mutex_);
  chip(path)->has_read_back = supported;
}

void EmulatedGpio::occupy(const std::string& path, unsigned offset, const std::string& consumer) {
  const std::lock_guard lock(mutex_);
  chip(path)->lines.at(offset).consumer = consumer;
}

void EmulatedGpio::put(const std::string& path, unsigned offset, bool high, bool notify) {
  const std::lock_guard lock(mutex_);
  Line& line = chip(path)->lines.at(offset);
  if (line.high == high) return;
  line.high = high;
  if (!notify || line.edge_file < 0) return;
  const GpioEdge edge{offset, high != line.request.active_low};
  if (::write(line.edge_file, &edge, sizeof edge) != static_cast<ssize_t>(sizeof edge)) {
    throw std::runtime_error("an edge event could not be written");
  }
}

void EmulatedGpio::let_float(const std::string& path, unsigned offset, bool floats) {
  const std::lock_guard lock(mutex_);
  chip(path)->lines.at(offset).floats = floats;
}

void EmulatedGpio::hold_gets(bool hold) {
  const std::lock_guard lock(mutex_);
  holds_gets_ = hold;
  released_.notify_all();
}

void EmulatedGpio::hold_sets(bool hold) {
  const std::lock_guard lock(mutex_);
  holds_sets_ = hold;
  released_.notify_all();
}

void EmulatedGpio::edge_taken(const std::string& path, const GpioEdge& edge) {
  const std::lock_guard lock(mutex_);
  Chip* its = chip(path);
  if (its == nullptr || edge.offset >= its->lines.size()) return;
  const Line& line = its->lines[edge.offset];
  if (!line.floats || line.edge_file < 0) return;
  const GpioEdge next{edge.offset, !edge.rising};
  if (::write(line.edge_file, &next, sizeof next) != static_cast<ssize_t>(sizeof next)) {
    throw std::runtime_error("an edge event could not be written");
  }
}

bool EmulatedGpio::level(const std::string& path, unsigned offset) const {
  const std::lock_guard lock(mutex_);
  const Chip* its = chip(path);
  return its != nullptr && its->lines.at(offset).high;
}

std::vector<bool> EmulatedGpio::history(const std::string& path, unsigned offset) const {
  const std::lock_guard lock(mutex_);
  const Chip* its = chip(path);
  return its == nullptr ? std::vector<bool>() : its->lines.at(offset).history;
}

Pull EmulatedGpio::pull(const std::string& path, unsigned offset) const {
  const std::lock_guard lock(mutex_);
  return chip(path)->lines.at(offset).request.pull;
}

std::string EmulatedGpio::consumer(const std::string& path, unsigned offset) const {
  const std::lock_guard lock(mutex_);
  return chip(path)->lines.at(offset).consumer;
}

int EmulatedGpio::open(const std::string& path) const {
  const std::lock_guard lock(mutex_);
  const Chip* its = chip(path);
  if (its == nullptr) return ENOENT;
  return its->forbidden ? EACCES : 0;
}

std::string EmulatedGpio::name(const std::string& path) const {
  return path.substr(path.rfind('/') + 1);
}

std::string EmulatedGpio::label(const std::string& path) const {
  const std::lock_guard lock(mutex_);
  const Chip* its = chip(path);
  return its == nullptr ? "" : its->label;
}

unsigned EmulatedGpio::lines(const std::string& path) const {
  const std::lock_guard lock(mutex_);
  const Chip* its = chip(path);
  return its == nullptr ? 0 : static_cast<unsigned>(its->lines.size());
}

int EmulatedGpio::find(const std::string& path, const std::string& line_name) const {
  const std::lock_guard lock(mutex_);
  const Chip* its = chip(path);
  if (its == nullptr) return -1;
  for (std::size_t i = 0; i < its->lines.size(); ++i) {
    if (its->lines[i].name == line_name) return static_cast<int>(i);
  }
  return -1;
}

int EmulatedGpio::request(const std::string& path, unsigned offset, const GpioRequest& request,
                          int edge_file) {
  const std::lock_guard lock(mutex_);
  Chip* its = chip(path);
  if (its == nullptr) return ENODEV;
  if (offset >= its->lines.size()) return EINVAL;
  Line& line = its->lines[offset];
  if (!line.consumer.empty()) return EBUSY;
  if (request.edges && !its->has_edges) return ENXIO;
  line.consumer = request.consumer.empty() ? "?" : request.consumer;
  line.request = request;
  line.edge_file = request.edges ? edge_file : -1;
  if (request.output) {
    line.high = request.initially_active != request.active_low;
    line.history.push_back(line.high);
  }
  return 0;
}

void EmulatedGpio::release(const std::string& path, unsigned offset) {
  const std::lock_guard lock(mutex_);
  Chip* its = chip(path);
  if (its == nullptr || offset >= its->lines.size()) return;
  its->lines[offset].consumer.clear();
  its->lines[offset].edge_file = -1;
}

int EmulatedGpio::set(const std::string& path, unsigned offset, bool active) {
  std::unique_lock lock(mutex_);
  released_.wait(lock, [this] { return !holds_sets_; });
  Chip* its = chip(path);
  if (its == nullptr) return ENODEV;
  if (its->failing_sets > 0) {
    --its->failing_sets;
    return EIO;
  }
  Line& line = its->lines.at(offset);
  if (!line.request.output) return EPERM;
  if (its->swallowed_sets > 0) {
    --its->swallowed_sets;
    return 0;
  }
  line.high = active != line.request.active_low;
  line.history.push_back(line.high);
  return 0;
}

int EmulatedGpio::get(const std::string& path, unsigned offset, bool& active) const {
  std::unique_lock lock(mutex_);
  released_.wait(lock, [this] { return !holds_gets_; });
  const Chip* its = chip(path);
  if (its == nullptr) return ENODEV;
  const Line& line = its->lines.at(offset);
  if (line.request.output && !its->has_read_back) return EIO;
  active = line.high != line.request.active_low;
  return 0;
}

}  // namespace stickslip::emulated
