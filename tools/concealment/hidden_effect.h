// SPDX-License-Identifier: Apache-2.0
// Effects that can be hidden: every listed effect and some beyond, with the benches
// that can have them, their formula in the reference simulator, and the expected result of a
// diagnosis.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/ground_truth.h"
#include "tools/concealment/random_source.h"

namespace stickslip::concealment {

/// Sizes of the motion and the readings of a bench without hidden effects.
struct Sizes {
  double displacement_m = 0.01;                 ///< largest
  double velocity_m_s = 0.1;                    ///< largest
  std::array<double, channel_count> spread{};   ///< standard deviation of each channel
  std::array<double, channel_count> largest{};  ///< magnitude
  double duration_s = 30.0;
};

struct EffectDraw;

struct HiddenEffect {
  std::string_view id;  ///< of docs/formats.md, or a name for unlisted physics
  bool listed = true;
  std::span<const BenchKind> benches;
  BenchRequirements requirements;
  void (*draw)(EffectDraw&) = nullptr;
  bool scalable = true;  ///< true if `strength` changes its visibility
};

/// Listed effects first.
std::span<const HiddenEffect> hidden_effects();

/// The effect of that id, or nullptr.
const HiddenEffect* find_hidden_effect(std::string_view id);

/// Adds the effect to the bench's reference rig. `strength` 1 is moderate; the same random source
/// gives the same effect with a different strength.
TrueEffect hide(const HiddenEffect& effect, double strength, const Sizes& sizes, Bench& bench,
                RandomSource random);

}  // namespace stickslip::concealment
