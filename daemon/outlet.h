// Where encoded messages go. The publisher and the recorder differ in nothing but this.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

namespace stickslip::daemon {

class Outlet {
 public:
  Outlet() = default;
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;
  virtual ~Outlet() = default;

  /// False where it was refused. `time_us` since the epoch.
  virtual bool put(const std::string& channel, std::span<const std::uint8_t> bytes,
                   std::int64_t time_us) = 0;

  /// Whether all that was put since the last time has really left.
  virtual bool settle() { return true; }

  /// Everything that was put is safe, or false. Called once, at the end.
  virtual bool close() { return true; }
};

/// LCM at `url`. Throws InputError where the URL is refused.
std::unique_ptr<Outlet> open_lcm(const std::string& url);

/// A new LCM event log. Throws InputError where it cannot be written or where the name asks for
/// another format than the daemon records.
std::unique_ptr<Outlet> open_log(const std::filesystem::path& file);

}  // namespace stickslip::daemon
