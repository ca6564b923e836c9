// SPDX-License-Identifier: Apache-2.0
#include "daemon/event_throttle.h"

#include <algorithm>

namespace stickslip::daemon {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t first_interval_ns = second_ns;
constexpr std::int64_t longest_interval_ns = 60 * second_ns;
constexpr std::int64_t over_ns = 10 * second_ns;

bool is_never_held(Notice::Kind kind) {
  using enum Notice::Kind;
  return kind == fault || kind == state || kind == left_on || kind == end_of_data;
}

}  // namespace

std::optional<Event> EventThrottle::accept(const Notice& notice, std::int64_t now_ns) {
  Event event = event_of(notice);
  if (is_never_held(notice.kind)) return event;
  Burst* const burst = hold(event, now_ns, {});
  if (burst == nullptr) return event;
  Notice sum = notice;
  if (burst->sum) {
    // Of some kinds it is the index of a channel.
    if (event.subject.empty()) sum.count += burst->sum->count;
    sum.duration_ns = std::max(sum.duration_ns, burst->sum->duration_ns);
  }
  burst->sum = sum;
  return std::nullopt;
}

std::optional<Event> EventThrottle::accept(const Event& event, std::int64_t now_ns,
                                           const Allowance& allowance) {
  if (hold(event, now_ns, allowance) != nullptr) return std::nullopt;
  return event;
}

EventThrottle::Burst* EventThrottle::hold(const Event& event, std::int64_t now_ns,
                                          const Allowance& allowance) {
  const auto [found, is_new] = bursts_.try_emplace(event.code + ' ' + event.subject);
  Burst& burst = found->second;
  if (is_new || (burst.held == 0 && now_ns - burst.latest_ns >= over_ns)) {
    burst =
        Burst{.credit = allowance.reports, .latest_ns = now_ns, .interval_ns = first_interval_ns};
  }
  const double passed_s = static_cast<double>(now_ns - burst.latest_ns) * 1e-9;
  burst.credit = std::min(allowance.reports, burst.credit + allowance.per_second * passed_s);
  burst.latest_ns = now_ns;
  const bool due = now_ns - burst.reported_ns >= burst.interval_ns;
  if (burst.held == 0 && (burst.credit >= 1.0 || due)) {
    if (burst.credit < 1.0) {
      burst.interval_ns = std::min(2 * burst.interval_ns, longest_interval_ns);
    }
    burst.credit = std::max(0.0, burst.credit - 1.0);
    burst.reported_ns = now_ns;
    return nullptr;
  }
  ++burst.held;
  burst.latest = event;
  return &burst;
}

std::vector<Event> EventThrottle::due(std::int64_t now_ns) {
  std::vector<Event> out;
  for (auto at = bursts_.begin(); at != bursts_.end();) {
    Burst& burst = at->second;
    const bool over = now_ns - burst.latest_ns >= over_ns;
    if (burst.held > 0 && (over || now_ns - burst.reported_ns >= burst.interval_ns)) {
      out.push_back(summary(burst));
      if (over) out.back().message += "; none for 10 s";
      burst.held = 0;
      burst.sum.reset();
      burst.reported_ns = now_ns;
      burst.interval_ns = std::min(2 * burst.interval_ns, longest_interval_ns);
    }
    at = over ? bursts_.erase(at) : std::next(at);
  }
  return out;
}

std::vector<Event> EventThrottle::flush() {
  std::vector<Event> out;
  for (const auto& [key, burst] : bursts_) {
    if (burst.held > 0) out.push_back(summary(burst));
  }
  bursts_.clear();
  return out;
}

// A single one is reported like any other.
Event EventThrottle::summary(const Burst& burst) {
  if (burst.held == 1) return burst.latest;
  if (burst.sum) return event_of(*burst.sum, burst.held);
  Event out = burst.latest;
  out.message += "; " + std::to_string(burst.held) + " such since the latest report";
  return out;
}

}  // namespace stickslip::daemon
