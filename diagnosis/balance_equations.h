// SPDX-License-Identifier: Apache-2.0
// The five balances of a rig: equations between measured quantities, each of which holds or fails
// by itself. Their residuals come straight from the readings, without integrating the motion.
//
//   kinematics     x' - v
//   force balance  m x'' + c x' + k x + f + m b''  (or - F; two wells likewise; terms of the model)
//   friction law   f - mu N theta(v)               (with the model's memory and terms)
//   normal load    N - N(x)
//   excitation     the drive where it has stopped moving: b or F above its own band, within that of
//                  the reaction x, v and f, where only noise should be read
//
// f is the reading of the friction channel by Eq. (1) or by the load cell's whole equation; without
// that channel the force balance takes it from the law. v is the velocity channel, or x' without
// it; the slip of a resonant cell is x' - y'. Nothing in a model predicts a drive: the fifth
// balance says whether the drive carries more noise than stated.
//
// Spectra of tapered readings are divided by the response of their filters, so that no
// derivative is approximated. Only what is not linear (friction, magnets, unilateral load) is
// evaluated in time, on signals from which the noise has been filtered.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <optional>
#include <vector>

#include "diagnosis/experiment.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

enum class Balance : std::uint8_t {
  kinematics,
  force_balance,
  friction_law,
  normal_load,
  excitation
};

inline constexpr std::size_t balance_count = 5;
inline constexpr std::array<Balance, balance_count> all_balances = {
    Balance::kinematics, Balance::force_balance, Balance::friction_law, Balance::normal_load,
    Balance::excitation};

constexpr std::size_t index_of(Balance balance) { return static_cast<std::size_t>(balance); }

/// Half of the spectrum of real samples.
using HalfSpectrum = std::vector<std::complex<double>>;

/// Tapered readings of one stretch without a gap, as spectra of `padded` samples.
struct ReadingSpectra {
  double period_s = 0.0;
  std::size_t count = 0;
  std::size_t padded = 0;
  std::size_t ramp = 0;  ///< samples over which the taper rises and falls
  std::array<HalfSpectrum, channel_count> spectrum;  ///< empty: not recorded
  HalfSpectrum taper;                                ///< spectrum of a constant reading of 1
  /// Wiener's gain of each coefficient, up to the last one that stands out of the noise.
  std::array<std::vector<double>, channel_count> denoising;
  std::array<double, channel_count> highest_hz{};  ///< of what stands out of the noise
  std::array<double, channel_count>
      readable_hz{};  ///< below it the rate of a slow channel shows all

  double bin_hz() const { return 1.0 / (static_cast<double>(padded) * period_s); }
  bool has(Channel channel) const { return !spectrum[index_of(channel)].empty(); }
};

/// The longest segment of the experiment, at most the first `most` instants of it. Time-dependent
/// sensor errors that `model` states as terms are subtracted.
ReadingSpectra stretch_of(const protocol::Recording& recording, const Experiment& experiment,
                          const physics::Model& model, std::size_t most);

/// Bins from `first` to before `last`, in which a balance is judged; empty: it cannot be measured.
struct BalanceBand {
  std::size_t first = 0;
  std::size_t last = 0;
  bool empty() const { return last <= first; }
};
using BalanceBands = std::array<BalanceBand, balance_count>;

/// Up to the highest frequency at which a channel of the balance stands out of its noise.
BalanceBands bands_of(const ReadingSpectra& stretch, const physics::Model& model);

/// Residuals in N (force balance, friction law, normal load), in m/s (kinematics), or in the
/// unit of the drive's channel; bins from 0 to before BalanceBand::last, those below
/// BalanceBand::first 0.
using BalanceResiduals = std::array<HalfSpectrum, balance_count>;

/// The contact's friction force under the measured motion, kept for models that do not change it.
class ContactForce {
 public:
  /// The first `bins` coefficients of mu N theta; empty where the model has no friction.
  const HalfSpectrum& of(const ReadingSpectra& stretch, const physics::Model& model,
                         std::size_t bins);

 private:
  std::optional<physics::Model> model_;  // what the force depends on
  HalfSpectrum force_;
};

/// `contact` holds the force of a similar model of the same stretch and bands, or nothing.
BalanceResiduals residuals_of(const ReadingSpectra& stretch, const BalanceBands& bands,
                              const physics::Model& model, ContactForce contact);

/// Velocity of the mass, from the displacement [m/s], at the instants of the stretch.
std::vector<double> measured_velocity(const ReadingSpectra& stretch, const physics::Model& model);

/// Samples of a spectrum at `points` instants over its `padded` samples; `points` is more than
/// twice the size of the spectrum or equal to `padded`.
std::vector<double> samples_of(const HalfSpectrum& spectrum, std::size_t padded,
                               std::size_t points);

/// The smallest number from `least` on that is even and has prime factors up to 5 only.
std::size_t fast_length(std::size_t least);

}  // namespace stickslip::diagnosis
