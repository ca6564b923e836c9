#include "protocol/share_done.h"

namespace stickslip::protocol {

ShareDone share_of_one(const ShareDone& whole, std::size_t before, std::size_t all) {
  if (!whole) return {};
  return [&whole, before, all](double share) {
    whole((static_cast<double>(before) + share) / static_cast<double>(all));
  };
}

}  // namespace stickslip::protocol
