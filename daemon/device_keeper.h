// Brings a device back that the loop has lost: closes it, and opens and starts it again, with
// growing patience. In a thread of its own, because opening may take long.
#pragma once

#include <atomic>
#include <thread>

#include "daemon/loop.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

class DeviceKeeper {
 public:
  /// Both must outlive it.
  DeviceKeeper(drivers::Driver& driver, Loop& loop);
  ~DeviceKeeper();
  DeviceKeeper(const DeviceKeeper&) = delete;
  DeviceKeeper& operator=(const DeviceKeeper&) = delete;

  /// Afterwards the driver is left alone.
  void stop();

  /// One attempt on a device that is gone. Whether the loop has it again.
  static bool try_to_bring_back(drivers::Driver& driver, Loop& loop);

 private:
  void run();

  drivers::Driver& driver_;
  Loop& loop_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace stickslip::daemon
