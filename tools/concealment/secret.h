// Physics that can be hidden: for every effect of the contract and some beyond it, in which rigs it
// can hide, how nature writes it, and what a diagnosis should then say.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/concealment/truth.h"
#include "tools/concealment/world.h"

namespace stickslip::concealment {

/// The sizes of things in a rig with nothing hidden in it.
struct Sizes {
  double displacement_m = 0.01;                 ///< largest
  double velocity_m_s = 0.1;                    ///< largest
  std::array<double, channel_count> spread{};   ///< standard deviation of each channel
  std::array<double, channel_count> largest{};  ///< magnitude
  double duration_s = 30.0;
};

/// Something that can be hidden.
struct Secret {
  std::string_view id;  ///< of the contract, or of the physics that no contract lists
  bool listed = true;
  std::span<const World> worlds;
  Wishes wishes;
  bool scalable = true;  ///< whether `strength` makes it more or less visible
};

/// All that can be hidden: the contract's catalogue first.
std::span<const Secret> all_secrets();

/// The secret of that name, or nullptr.
const Secret* secret_named(std::string_view id);

/// Hides it in the rig's nature and says what was done. `strength` 1 is middling, more is plainer;
/// the same dice give the same secret but for its strength.
TrueEffect hide(const Secret& secret, double strength, const Sizes& sizes, Rig& rig, Dice dice);

}  // namespace stickslip::concealment
