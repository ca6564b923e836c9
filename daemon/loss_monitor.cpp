#include "daemon/loss_monitor.h"

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
  update(balance.recorded, "recording", recorded_, events);
  update(balance.published, "publishing", published_, events);
  return events;
}

void LossMonitor::update(const AccountBalance& account, const char* consumer, Episodes& episodes,
                         std::vector<Event>& events) {
  for (const Wording& wording : wordings) {
    Episode& episode = episodes[static_cast<std::size_t>(wording.loss)];
    const std::uint64_t lost = account.lost_to(wording.loss);
    const bool losing = lost > episode.lost;
    if (losing && !episode.losing) {
      episode.at_begin = episode.lost;
      events.push_back(
          {Severity::warning, wording.code, std::string(consumer) + ' ' + wording.begins});
    } else if (!losing && episode.losing) {
      events.push_back({Severity::info, "losses_ended",
                        std::string(consumer) + ' ' + wording.ended + "; " +
                            std::to_string(lost - episode.at_begin) + " frames were lost (" +
                            std::string(loss_names[static_cast<std::size_t>(wording.loss)]) + ')'});
    }
    episode.losing = losing;
    episode.lost = lost;
  }
}

}  // namespace stickslip::daemon
