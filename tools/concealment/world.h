// Rigs to hide something in, drawn at random: what their owner believes (a model with priors and
// declared sensors) and what they really are (true parameters drawn from those priors).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "physics/model.h"
#include "tools/concealment/nature.h"

namespace stickslip::concealment {

/// Random numbers that are the same on every machine.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  double uniform(double low, double high);
  double log_uniform(double low, double high);
  double normal();
  /// 0 to count - 1
  std::size_t pick(std::size_t count);
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }
  double sign() { return chance(0.5) ? 1.0 : -1.0; }

 private:
  std::mt19937_64 engine_;
};

enum class World { regular, skewed, two_well, motivational, force, imposed };
inline constexpr std::array all_worlds = {World::regular,      World::skewed, World::two_well,
                                          World::motivational, World::force,  World::imposed};
std::string_view name_of(World world);

/// A rig with nothing hidden in it.
struct Rig {
  World world = World::regular;
  physics::Model believed;
  Nature nature;
  double sample_rate_hz = 500.0;
  /// What one sigma more of each uncertain parameter would change.
  std::vector<std::function<void(Nature&)>> shifts;
};

/// Draws a rig. `lacks_friction`: its owner believes in none (force-excited rigs only);
/// `relaxes`, `rings`: whether the friction law has a memory and the load cell its resonance, where
/// that is a choice.
struct Wishes {
  bool lacks_friction = false;
  bool relaxes = false;
  bool rings = true;
  bool set_valued = false;
};
Rig draw_rig(World world, const Wishes& wishes, Dice& dice);

/// Another run of a rig: other tones of about the same size.
std::vector<Tone> draw_drive(World world, const Nature& nature, Dice& dice);

}  // namespace stickslip::concealment
