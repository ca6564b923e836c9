// Brings a device back that the loop has lost: closes it, and opens and starts it again, with
// growing patience. In a thread of its own, because opening may take long.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "daemon/loop.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

class DeviceKeeper {
 public:
  /// Both must outlive it. `schedule` gives the calling thread what the loop's has: a device's
  /// threads inherit it from the one that starts the device, and shall have it the second time as
  /// well.
  DeviceKeeper(drivers::Driver& driver, Loop& loop, std::function<void()> schedule);
  ~DeviceKeeper();
  DeviceKeeper(const DeviceKeeper&) = delete;
  DeviceKeeper& operator=(const DeviceKeeper&) = delete;

  /// Afterwards the driver is left alone.
  void stop();

  /// One attempt on a device that is gone. Whether the loop has it again.
  static bool try_to_bring_back(drivers::Driver& driver, Loop& loop,
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
