// SPDX-License-Identifier: Apache-2.0
#include "daemon/loss_monitor.h"
#include "physics/number_text.h"

#include <string>

namespace stickslip::daemon {
namespace {

struct Wording {
  Loss loss;
  const char* code;
  const char* begins;
  const char* ended;
};

constexpr std::array<Wording, 3> wordings = {{
    {Loss::ring_full, "ring_full", "is too slow and its ring is full: frames are being lost",
     "keeps up again"},
    {Loss::write_error, "write_error", "fails: frames are being lost", "works again"},
    {Loss::encode_error, "encode_error", "cannot encode frames: they are being lost",
     "can encode frames again"},
}};

}  // namespace

std::vector<Event> LossMonitor::update(const Balance& balance) {
  std::vector<Event> events;
  // A recording must be whole; publishing is best effort.
  update(balance.recorded, {"recording", Severity::error}, recorded_, events);
  update(balance.published, {"publishing", Severity::warning}, published_, events);
  return events;
}

void LossMonitor::update(const AccountBalance& account, const Consumer& consumer,
                         Episodes& episodes, std::vector<Event>& events) {
  for (const Wording& wording : wordings) {
    Episode& episode = episodes[static_cast<std::size_t>(wording.loss)];
    const std::uint64_t lost = account.lost_to(wording.loss);
    const bool losing = lost > episode.lost;
    if (losing && !episode.losing) {
      episode.at_begin = episode.lost;
      events.push_back(
          {consumer.severity, wording.code, std::string(consumer.name) + ' ' + wording.begins});
      events.back().subject = consumer.name;
    } else if (!losing && episode.losing) {
      events.push_back(
          {Severity::info, "losses_ended",
           std::string(consumer.name) + ' ' + wording.ended + "; " +
               physics::counted(lost - episode.at_begin, "frame was lost", "frames were lost") +
               " (" + std::string(loss_names[static_cast<std::size_t>(wording.loss)]) + ')'});
      events.back().subject = std::string(consumer.name) + ' ' + wording.code;
    }
    episode.losing = losing;
    episode.lost = lost;
  }
}

}  // namespace stickslip::daemon
