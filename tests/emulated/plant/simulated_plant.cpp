// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/plant/simulated_plant.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace stickslip::emulated {

namespace {

constexpr std::size_t memory =
    static_cast<std::size_t>(SimulatedPlant::memory_s / SimulatedPlant::step_s);

config::SimulatedDriver without_noise(config::SimulatedDriver rig) {
  rig.noise = false;
  rig.resolution = {};
  rig.relay.clear();
  return rig;
}

}  // namespace

SimulatedPlant::SimulatedPlant(config::SimulatedDriver rig, const config::ShakerOutput& shaker,
                               std::int64_t begin_ns)
    : rig_(without_noise(std::move(rig)), step_s),
      shaker_(shaker),
      begin_ns_(begin_ns),
      volts_(shaker.rest_v),
      enabled_since_ns_(begin_ns) {
  drivers::Result result = rig_.open();
  if (result) result = rig_.start();
  if (!result) throw std::runtime_error(result.message);
  Frame first;
  static_cast<void>(rig_.read(first));
  past_.push_back(first);
}

void SimulatedPlant::command() {
  const double drive = (volts_ - shaker_.rest_v) / shaker_.volts_per_unit;
  static_cast<void>(rig_.write({drive, enabled_}));
}

void SimulatedPlant::advance_to(std::int64_t time_ns) {
  while (begin_ns_ + past_.back().time_ns < time_ns) {
    command();
    Frame next;
    const drivers::Result result = rig_.read(next);
    if (!result) throw std::runtime_error(result.message);
    past_.push_back(next);
    if (past_.size() > memory) past_.pop_front();
  }
}

double SimulatedPlant::truth(Channel channel, std::int64_t time_ns) {
  return truth(time_ns)[channel];
}

Frame SimulatedPlant::truth(std::int64_t time_ns) {
  const std::lock_guard lock(mutex_);
  advance_to(time_ns);
  const std::int64_t rig_ns = time_ns - begin_ns_;
  const auto after =
      std::lower_bound(past_.begin(), past_.end(), rig_ns,
                       [](const Frame& frame, std::int64_t t) { return frame.time_ns < t; });
  if (after == past_.begin()) return past_.front();
  const Frame& b = *after;
  Frame out = *std::prev(after);
  const double part =
      static_cast<double>(rig_ns - out.time_ns) / static_cast<double>(b.time_ns - out.time_ns);
  for (std::size_t i = 0; i < channel_count; ++i)
    out.value[i] += part * (b.value[i] - out.value[i]);
  out.time_ns = rig_ns;
  return out;
}

void SimulatedPlant::drive(double volts, std::int64_t time_ns) {
  const std::lock_guard lock(mutex_);
  advance_to(time_ns);
  volts_ = volts;
  ++drives_;
}

void SimulatedPlant::enable(bool on, std::int64_t time_ns) {
  const std::lock_guard lock(mutex_);
  advance_to(time_ns);
  if (on != enabled_) enabled_since_ns_ = time_ns;
  enabled_ = on;
}

bool SimulatedPlant::amplifier_fault() const {
  const std::lock_guard lock(mutex_);
  return amplifier_fault_;
}

bool SimulatedPlant::emergency_stop() const {
  const std::lock_guard lock(mutex_);
  return emergency_stop_;
}

void SimulatedPlant::set_amplifier_fault(bool fault) {
  const std::lock_guard lock(mutex_);
  amplifier_fault_ = fault;
}

void SimulatedPlant::press_emergency_stop(bool pressed) {
  const std::lock_guard lock(mutex_);
  emergency_stop_ = pressed;
}

bool SimulatedPlant::enabled() const {
  const std::lock_guard lock(mutex_);
  return enabled_;
}

std::int64_t SimulatedPlant::enabled_since_ns() const {
  const std::lock_guard lock(mutex_);
  return enabled_since_ns_;
}

std::uint64_t SimulatedPlant::drives() const {
  const std::lock_guard lock(mutex_);
  return drives_;
}

}  // namespace stickslip::emulated
