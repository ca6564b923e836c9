// An LCM event log as an outlet.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "daemon/outlet.h"
#include "physics/problem.h"
#include "protocol/recording.h"

namespace stickslip::daemon {
namespace {

class LogOutlet final : public Outlet {
 public:
  explicit LogOutlet(const std::filesystem::path& file) : name_(file.string()), log_(file) {}

  bool put(const std::string& channel, std::span<const std::uint8_t> bytes,
           std::int64_t time_us) override {
    // Players and seekers expect times that do not go back; where rig time runs faster than the
    // wall clock, messages of the wall's time would.
    latest_us_ = std::max(latest_us_, time_us);
    const bool taken = log_.append(channel, bytes, latest_us_);
    // Taken is not yet written: that it works again is known when it has settled.
    return taken || told(false);
  }

  bool settle() override { return told(log_.flush()); }

  bool close() override { return told(log_.close()); }

 private:
  /// Says once when the disk begins to refuse, and once when it takes again.
  bool told(bool worked) {
    if (worked == working_) return worked;
    working_ = worked;
    if (worked) {
      spdlog::info("recording into {} works again", name_);
    } else {
      spdlog::error("recording into {} fails: {}; the rig goes on, the loss is counted", name_,
                    std::strerror(errno));
    }
    return worked;
  }

  std::string name_;
  protocol::LogWriter log_;
  std::int64_t latest_us_ = 0;
  bool working_ = true;
};

}  // namespace

std::unique_ptr<Outlet> open_log(const std::filesystem::path& file) {
  if (file.extension() == ".csv") {
    throw InputError({file.string(), 0, 0,
                      "the daemon records LCM event logs, not CSV; record into '" +
                          std::filesystem::path(file).replace_extension(".log").string() +
                          "' and convert that: stickslip convert LOG CSV"});
  }
  return std::make_unique<LogOutlet>(file);
}

}  // namespace stickslip::daemon
