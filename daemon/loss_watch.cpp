#include "daemon/loss_watch.h"

#include <string>

namespace stickslip::daemon {
namespace {

struct Words {
  Loss loss;
  const char* code;
  const char* begins;
  const char* ended;
};

constexpr std::array<Words, 3> words = {{
    {Loss::ring_full, "ring_full", "is too slow and its ring is full: frames are being lost",
     "keeps up again"},
    {Loss::write_error, "write_error", "is refused: frames are being lost", "works again"},
    {Loss::encode_error, "encode_error", "cannot encode frames: they are being lost",
     "can encode frames again"},
}};

}  // namespace

std::vector<Event> LossWatch::look(const Balance& balance) {
  std::vector<Event> events;
  look(balance.recorded, "recording", recorded_, events);
  look(balance.published, "publishing", published_, events);
  return events;
}

void LossWatch::look(const AccountBalance& account, const char* consumer, Losses& losses,
                     std::vector<Event>& events) {
  for (const Words& word : words) {
    Seen& seen = losses[static_cast<std::size_t>(word.loss)];
    const std::uint64_t lost = account.lost_to(word.loss);
    const bool losing = lost > seen.lost;
    if (losing && !seen.losing) {
      seen.at_begin = seen.lost;
      events.push_back({Severity::warning, word.code, std::string(consumer) + ' ' + word.begins});
    } else if (!losing && seen.losing) {
      events.push_back({Severity::info, "losses_ended",
                        std::string(consumer) + ' ' + word.ended + "; " +
                            std::to_string(lost - seen.at_begin) + " frames were lost (" +
                            std::string(loss_names[static_cast<std::size_t>(word.loss)]) + ')'});
    }
    seen.losing = losing;
    seen.lost = lost;
  }
}

}  // namespace stickslip::daemon
