// How far the reading or writing of a file is, told to who waits for it.
#pragma once

#include <cstddef>
#include <functional>

namespace stickslip::protocol {

/// Told of the share of a work that is done, 0 to 1, by the thread that does it; may be empty. It
/// is called often, and must cost next to nothing.
using ShareDone = std::function<void(double)>;

/// What to hand to one piece of `all` like ones, of which `before` are done. `whole` must outlive
/// it.
ShareDone share_of_one(const ShareDone& whole, std::size_t before, std::size_t all);

}  // namespace stickslip::protocol
