// Where encoded messages go. The publisher and the recorder differ in nothing but this.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "daemon/ledger.h"

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

  /// Whether it would rather settle now than when it is time to.
  virtual bool wants_to_settle() const { return false; }

  /// Everything that was put is safe, or false. Called once, at the end.
  virtual bool close() { return true; }
};

/// LCM at `url`. Throws InputError where the URL is refused.
std::unique_ptr<Outlet> open_lcm(const std::string& url);

/// How the recorder cuts and keeps its log.
struct RecorderSettings {
  std::optional<double> rotate_s =
      {};  ///< a part lasts so long, in the time of its frames; above 0
  std::optional<double> rotate_mb = {};  ///< a part holds so many 10^6 bytes; above 0
  double sync_s = 1.0;       ///< the disk has all but the last so many seconds; 0: no matter
  Ledger* ledger = nullptr;  ///< the books with which a part ends, and in which it is written down
                             ///< what the disk confirms; null: neither
};

/// A new LCM event log, in parts where the settings say so: run.log, run.001.log, ... A log that
/// bears its name already is kept under another one. All that a recording needs to stand alone is
/// learnt from the description that is put first. Throws InputError where the log cannot be written
/// or where the name asks for another format than the daemon records.
std::unique_ptr<Outlet> open_log(const std::filesystem::path& file,
                                 const RecorderSettings& settings = {});

}  // namespace stickslip::daemon
