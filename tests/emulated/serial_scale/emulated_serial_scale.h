// SPDX-License-Identifier: Apache-2.0
// An emulated balance that transmits lines through a pseudo-terminal. Written from the instrument's
// description, not from the driver.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

namespace stickslip::emulated {

/// A line of the balance; status 'S', 'M' or 'E', unit "g" or "kg". An error ignores the number.
std::string scale_line(char status, double number, const std::string& unit);

class EmulatedSerialScale {
 public:
  /// `folder` receives a link `scale` to the serial line, which is constant over unplugging.
  explicit EmulatedSerialScale(std::filesystem::path folder);
  ~EmulatedSerialScale();
  EmulatedSerialScale(const EmulatedSerialScale&) = delete;
  EmulatedSerialScale& operator=(const EmulatedSerialScale&) = delete;

  std::string port() const { return (folder_ / "scale").string(); }

  /// Transmits bytes immediately.
  void write(const std::string& bytes);
  /// Transmits periodically from a separate thread until stop: the result of `next`, every
  /// `period_ns`.
  void start(std::int64_t period_ns, std::function<std::string()> next);
  void stop();

  // Not during periodic transmission.
  void unplug();
  void plug_in();

 private:
  std::filesystem::path folder_;
  int its_end_ = -1;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace stickslip::emulated
