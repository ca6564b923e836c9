// SPDX-License-Identifier: Apache-2.0
#include "daemon/device_supervisor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

constexpr auto poll_period = 20ms;
constexpr std::chrono::milliseconds first_wait = 100ms;
constexpr std::chrono::milliseconds longest_wait = 5s;

}  // namespace

DeviceSupervisor::DeviceSupervisor(drivers::Driver& driver, Loop& loop,
                                   std::function<void()> schedule)
    : driver_(driver), loop_(loop), schedule_(std::move(schedule)), thread_([this] { run(); }) {}

DeviceSupervisor::~DeviceSupervisor() { stop(); }

void DeviceSupervisor::stop() {
  stopping_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

bool DeviceSupervisor::try_to_restore(drivers::Driver& driver, Loop& loop,
                                      const std::function<void()>& schedule) {
  driver.stop();
  // Reported at every attempt. Closing may take seconds, and may itself leave an output on.
  const char* const left_on = driver.left_on();
  if (left_on != nullptr) spdlog::error("{}", left_on);
  driver.close();
  if (left_on == nullptr && driver.left_on() != nullptr) spdlog::error("{}", driver.left_on());
  drivers::Result result = driver.open();
  if (result) {
    // In a temporary thread, so that this one keeps its ordinary priority.
    std::thread([&] {
      schedule();
      result = driver.start();
    }).join();
  }
  if (!result) {
    spdlog::warn("{} could not be restored: {}", driver.description().name, result.message);
    driver.close();
    return false;
  }
  loop.device_restored();
  return true;
}

void DeviceSupervisor::run() {
  std::chrono::milliseconds wait = first_wait;
  auto next = steady_clock::now();
  bool was_lost = false;
  while (!stopping_.load(std::memory_order_acquire)) {
    std::this_thread::sleep_for(poll_period);
    const bool lost = loop_.device_lost();
    if (lost && !was_lost) {
      wait = first_wait;
      next = steady_clock::now() + wait;
      if (loop_.device_failed()) {
        spdlog::error("{} cannot be restored: restart the daemon once it is repaired",
                      driver_.description().name);
      }
    }
    was_lost = lost;
    if (!lost || loop_.device_failed() || steady_clock::now() < next) continue;
    if (try_to_restore(driver_, loop_, schedule_)) {
      was_lost = false;
    } else {
      wait = std::min(2 * wait, longest_wait);
      next = steady_clock::now() + wait;
    }
  }
}

}  // namespace stickslip::daemon
