#include "daemon/event_throttle.h"

#include <algorithm>

namespace stickslip::daemon {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

}  // namespace

std::optional<Event> EventThrottle::accept(const Notice& notice, std::int64_t now_ns) {
  const auto* const kind = std::find(kinds.begin(), kinds.end(), notice.kind);
  if (kind == kinds.end()) return event_of(notice);
  Burst& burst = bursts_[static_cast<std::size_t>(kind - kinds.begin())];
  if (!burst.reported_ns || (burst.notices == 0 && now_ns - *burst.reported_ns >= second_ns)) {
    burst.reported_ns = now_ns;
    return event_of(notice);
  }
  ++burst.notices;
  burst.count += notice.count;
  burst.longest_ns = std::max(burst.longest_ns, notice.duration_ns);
  burst.latest = notice;
  return std::nullopt;
}

std::vector<Event> EventThrottle::due(std::int64_t now_ns) {
  std::vector<Event> out;
  for (Burst& burst : bursts_) {
    if (burst.notices == 0 || now_ns - *burst.reported_ns < second_ns) continue;
    out.push_back(summary(burst));
    burst = Burst{};
    burst.reported_ns = now_ns;
  }
  return out;
}

std::vector<Event> EventThrottle::flush() {
  std::vector<Event> out;
  for (Burst& burst : bursts_) {
    if (burst.notices > 0) out.push_back(summary(burst));
    burst = Burst{};
  }
  return out;
}

// A single notice is reported like any other.
Event EventThrottle::summary(const Burst& burst) {
  if (burst.notices == 1) return event_of(burst.latest);
  Notice notice = burst.latest;
  notice.count = burst.count;
  notice.duration_ns = burst.longest_ns;
  return event_of(notice, burst.notices);
}

}  // namespace stickslip::daemon
