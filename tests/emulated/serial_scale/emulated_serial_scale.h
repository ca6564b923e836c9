// A balance that writes lines into one end of a pseudo-terminal. Written from the instrument's
// description, not from the driver.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

namespace stickslip::emulated {

/// The line that such a balance writes; status 'S', 'M' or 'E', unit "g" or "kg". Of an error the
/// number does not matter.
std::string scale_line(char status, double number, const std::string& unit);

class EmulatedSerialScale {
 public:
  /// `folder` gets a link `scale` to the serial line, which stays the same when it is plugged in
  /// again.
  explicit EmulatedSerialScale(std::filesystem::path folder);
  ~EmulatedSerialScale();
  EmulatedSerialScale(const EmulatedSerialScale&) = delete;
  EmulatedSerialScale& operator=(const EmulatedSerialScale&) = delete;

  std::string port() const { return (folder_ / "scale").string(); }

  /// Bytes onto the line, now.
  void write(const std::string& bytes);
  /// From now on it writes by itself, from a thread of its own: `next` says what, and is called
  /// every `period_ns`, until stop.
  void start(std::int64_t period_ns, std::function<std::string()> next);
  void stop();

  // While it does not write by itself.
  void unplug();
  void plug_in();

 private:
  std::filesystem::path folder_;
  int its_end_ = -1;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace stickslip::emulated
