#include "daemon/device_keeper.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

constexpr auto look_period = 20ms;
constexpr std::chrono::milliseconds first_wait = 100ms;
constexpr std::chrono::milliseconds longest_wait = 5s;

}  // namespace

DeviceKeeper::DeviceKeeper(drivers::Driver& driver, Loop& loop, std::function<void()> schedule)
    : driver_(driver), loop_(loop), schedule_(std::move(schedule)), thread_([this] { run(); }) {}

DeviceKeeper::~DeviceKeeper() { stop(); }

void DeviceKeeper::stop() {
  stopping_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

bool DeviceKeeper::try_to_bring_back(drivers::Driver& driver, Loop& loop,
                                     const std::function<void()>& schedule) {
  driver.stop();
  // Every few seconds, and with reason. Closing may take as long, and may find out itself.
  const char* const left_on = driver.left_on();
  if (left_on != nullptr) spdlog::error("{}", left_on);
  driver.close();
  if (left_on == nullptr && driver.left_on() != nullptr) spdlog::error("{}", driver.left_on());
  drivers::Result result = driver.open();
  if (result) {
    // A thread that ends with it, so that the next attempt waits at no real-time priority.
    std::thread([&] {
      schedule();
      result = driver.start();
    }).join();
  }
  if (!result) {
    // Every few seconds at most, and a person has to know what to do.
    spdlog::warn("{} is not back: {}", driver.description().name, result.message);
    driver.close();
    return false;
  }
  loop.device_is_back();
  return true;
}

void DeviceKeeper::run() {
  std::chrono::milliseconds wait = first_wait;
  auto next = steady_clock::now();
  bool gone_before = false;
  while (!stopping_.load(std::memory_order_acquire)) {
    std::this_thread::sleep_for(look_period);
    const bool gone = loop_.device_is_gone();
    if (gone && !gone_before) {
      wait = first_wait;
      next = steady_clock::now() + wait;
      if (loop_.device_is_beyond_help()) {
        spdlog::error("{} cannot be brought back: restart the daemon once it is mended",
                      driver_.description().name);
      }
    }
    gone_before = gone;
    if (!gone || loop_.device_is_beyond_help() || steady_clock::now() < next) continue;
    if (try_to_bring_back(driver_, loop_, schedule_)) {
      gone_before = false;
    } else {
      wait = std::min(2 * wait, longest_wait);
      next = steady_clock::now() + wait;
    }
  }
}

}  // namespace stickslip::daemon
