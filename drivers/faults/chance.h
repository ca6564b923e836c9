// SPDX-License-Identifier: Apache-2.0
// Stateless random numbers: each draw is a function of the seed and of its purpose, independent of
// earlier draws.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace stickslip::drivers {

/// Purpose of a draw. Draws for different purposes are independent.
enum class Purpose : std::uint64_t { moment, hit, noise_radius, noise_angle };

/// Random draws of one fault of a script.
class Chance {
 public:
  /// `position`: index of the fault in the script.
  constexpr Chance(std::uint64_t seed, std::uint64_t position)
      : key_(mixed(mixed(seed) + position * step)) {}

  /// Uniform in [0, 1). `number`: index of the frame, call or repetition.
  constexpr double uniform(Purpose purpose, std::uint64_t number, std::uint64_t channel = 0) const {
    const std::uint64_t stream = static_cast<std::uint64_t>(purpose) * 64 + channel;
    const std::uint64_t bits = mixed(mixed(key_ + stream * step) + number * step);
    return static_cast<double>(bits >> 11U) * 0x1.0p-53;
  }

  /// Normal, of mean 0 and standard deviation 1.
  double normal(std::uint64_t number, std::uint64_t channel) const {
    const double radius =
        std::sqrt(-2.0 * std::log1p(-uniform(Purpose::noise_radius, number, channel)));
    const double angle = uniform(Purpose::noise_angle, number, channel);
    return radius * std::cos(2.0 * std::numbers::pi * angle);
  }

  constexpr bool hits(double probability, std::uint64_t number) const {
    return probability >= 1.0 || uniform(Purpose::hit, number) < probability;
  }

 private:
  static constexpr std::uint64_t step = 0x9E3779B97F4A7C15U;  // odd, near 2^64 / golden ratio

  /// SplitMix64: a bijection in which every bit of the argument affects every bit of the result.
  static constexpr std::uint64_t mixed(std::uint64_t z) {
    z += step;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31U);
  }

  std::uint64_t key_;
};

}  // namespace stickslip::drivers
