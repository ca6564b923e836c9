// SPDX-License-Identifier: Apache-2.0
// Recovery of a lost device: closes it, then opens and starts it again with increasing delays. Runs
// in its own thread, because opening may take long.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "daemon/loop.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

class DeviceSupervisor {
 public:
  /// Both must outlive it. `schedule` gives the calling thread the loop's scheduling: a device's
  /// threads inherit it from the thread that starts the device, at a restart as well.
  DeviceSupervisor(drivers::Driver& driver, Loop& loop, std::function<void()> schedule);
  ~DeviceSupervisor();
  DeviceSupervisor(const DeviceSupervisor&) = delete;
  DeviceSupervisor& operator=(const DeviceSupervisor&) = delete;

  /// Ends the thread: the driver is not used afterwards.
  void stop();

  /// One attempt on a lost device. True if it was handed back to the loop.
  static bool try_to_restore(drivers::Driver& driver, Loop& loop,
                             const std::function<void()>& schedule);

 private:
  void run();

  drivers::Driver& driver_;
  Loop& loop_;
  std::function<void()> schedule_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace stickslip::daemon
