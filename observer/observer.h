// SPDX-License-Identifier: Apache-2.0
// Real-time estimate of friction force, its internal state theta and the friction coefficient mu,
// with their covariance: an extended Kalman filter on the rig's equations (physics::Rig), the
// states of its sensor chains, the drive and slowly varying parameters. docs/observer.md describes
// states, noises and limitations.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>

#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

/// Quantities of an estimate's covariance.
enum class Quantity : std::uint8_t {
  displacement,          ///< x [m]
  velocity,              ///< x' [m/s]
  load_cell_deflection,  ///< y [m], resonant load cell
  load_cell_velocity,    ///< y' [m/s], resonant load cell
  theta,                 ///< friction over mu N [1]
  mu,                    ///< coefficient of friction [1]; [N] where no normal load is declared
  gamma,                 ///< rate of theta [1/s]
  normal_load,           ///< N [N]
  friction_force,        ///< f [N]
};

inline constexpr std::size_t quantity_count = 9;

/// Column name of a quantity, with its unit.
constexpr std::string_view name_of(Quantity quantity) {
  constexpr std::array<std::string_view, quantity_count> names = {"displacement_m",
                                                                  "velocity_m_s",
                                                                  "load_cell_deflection_m",
                                                                  "load_cell_velocity_m_s",
                                                                  "theta",
                                                                  "mu",
                                                                  "gamma_per_s",
                                                                  "normal_load_n",
                                                                  "friction_force_n"};
  return names[static_cast<std::size_t>(quantity)];
}

/// Validity of an estimate.
enum class EstimateStatus : std::uint8_t {
  good,         ///< valid, within its covariance
  waiting,      ///< no frame yet from which the filter can start
  settling,     ///< started less than the settling time of the sensor chains ago
  blind,        ///< no reading of the mass or of the friction force for too long
  out_of_step,  ///< the frame's time did not advance; the estimate is the last one
  unsupported,  ///< see FrictionObserver::unsupported()
  impossible,   ///< beyond what the friction law allows, see is_possible()
};

/// Description for a person.
std::string_view words_for(EstimateStatus status);

/// One estimate. A plain value of fixed size without padding between its fields. Where `status` is
/// waiting or unsupported every number is 0; numbers are always finite.
struct FrictionEstimate {
  std::int64_t time_ns = 0;    ///< of its frame; free of filter delay
  std::uint64_t sequence = 0;  ///< of that frame

  double theta = 0.0;             ///< friction over mu N, about -1 to 1
  double mu = 0.0;                ///< [1]; [N] where no normal load is declared
  double gamma_per_s = 0.0;       ///< 0 where the law has none
  double friction_force_n = 0.0;  ///< f on the mass, positive against positive velocity
  double normal_load_n = 0.0;     ///< N; 1 where no normal load is declared
  double displacement_m = 0.0;
  double velocity_m_s = 0.0;
  double slip_velocity_m_s = 0.0;
  double slip_velocity_std_m_s = 0.0;
  /// Probability that the slip speed is below the law's transition speed, or 1 mm/s if that is
  /// larger, for a Gaussian slip velocity. 0 to 1.
  double sticking = 0.0;

  /// Eq. (1) of the paper, k_l y + m_l b'', on the force channel (corrected for gain and curvature
  /// of [[physics]] terms only), including the delay of its sensor chain; and the same over N, 0
  /// where N is 0. For comparison; see raw_valid.
  double raw_friction_force_n = 0.0;
  double raw_friction_over_load = 0.0;

  /// Covariance of the first `used` of `quantities`, in their units; symmetric, 0 beyond them.
  std::array<std::array<double, quantity_count>, quantity_count> covariance{};

  /// Reading minus predicted reading of each channel of this frame [unit of the channel], and its
  /// expected standard deviation.
  std::array<double, channel_count> innovation{};
  std::array<double, channel_count> innovation_std{};

  /// Normalised innovation squared of the channels that were used: chi-squared distributed with
  /// nis_freedom degrees of freedom for a consistent filter.
  double nis = 0.0;

  /// NIS per degree of freedom, mean over the last two seconds, with its 95 % bounds for a
  /// consistent filter; 0, 0, 0 before the first reading.
  double nis_mean = 0.0, nis_mean_low = 0.0, nis_mean_high = 0.0;
  /// Lag-one correlation of each channel's normalised innovations, mean over the last two seconds,
  /// and its 95 % bound for white innovations.
  std::array<double, channel_count> whiteness{};
  std::array<double, channel_count> whiteness_bound{};

  std::uint64_t restarts = 0;  ///< reinitialisations after a divergence
  std::uint64_t refusals = 0;  ///< readings rejected as outliers since construction

  std::array<Quantity, quantity_count> quantities{};
  std::uint8_t used = 0;  ///< number of `quantities` that this model has

  EstimateStatus status = EstimateStatus::waiting;
  bool valid = false;      ///< status == EstimateStatus::good
  bool raw_valid = false;  ///< the frame had a force channel; otherwise the raw numbers are 0
  std::uint8_t nis_freedom = 0;
  std::uint8_t innovation_valid = 0;  ///< bit i: channel i was compared with its prediction
  std::uint8_t refused = 0;           ///< bit i: channel i was rejected as an outlier

  /// Standard deviation of a quantity; 0 where the estimate does not contain it.
  double standard_deviation(Quantity quantity) const;
};

static_assert(std::is_trivially_copyable_v<FrictionEstimate>);

/// True if the variances are finite and not negative and, in contact, abs(theta) exceeds 1 by at
/// most four standard deviations, and by at most 0.5.
bool is_possible(const FrictionEstimate& estimate);

/// Outcome of FrictionObserver::continue_from.
struct Continuation {
  std::uint8_t kept = 0;  ///< states that were taken over
  std::uint8_t anew = 0;  ///< states that start anew
  bool motion = false;    ///< displacement and velocity were taken over
  bool mu = false;        ///< these parameters were; false also where one of the models has none
  bool gamma = false;
  bool load = false;
  /// True if no state of the motion, the contact or the sensors starts anew: estimates stay good.
  bool settled = false;
};
static_assert(std::is_trivially_copyable_v<Continuation>);

class KalmanFilter;

/// Estimator for one rig. All memory is allocated by the constructor. Not thread-safe.
class FrictionObserver {
 public:
  /// `period_s`: sampling period, > 0. Throws std::invalid_argument for other periods, or where
  /// inconsistencies_of(model) is not empty. For a consistent model that is not supported see
  /// supported().
  FrictionObserver(const physics::Model& model, double period_s);
  ~FrictionObserver();
  FrictionObserver(FrictionObserver&&) noexcept;
  FrictionObserver& operator=(FrictionObserver&&) noexcept;

  bool supported() const { return unsupported().empty(); }
  /// Reason why the model is not supported; empty where it is.
  const std::string& unsupported() const;

  /// Processes a frame in SI units, with any set of valid channels; returns the estimate at its
  /// time. Gaps of up to 10 periods are bridged, a longer one reinitialises the filter (not counted
  /// as a restart). Values that are not finite, or beyond 10^4 m, m/s and 10^9 N, count as not
  /// measured. No allocation, no lock, bounded time. The reference is valid until the next call.
  const FrictionEstimate& update(const Frame& frame);

  const FrictionEstimate& latest() const;

  /// Goes on from the state of an observer of the same rig and period with another model, which is
  /// not changed; before the first update. States that both models have are taken over with their
  /// covariance (observer/continuation.h), but for mu, gamma and a constant load that differ from
  /// this model by more than three standard deviations. The others start anew from the latest
  /// frame. Counts of restarts and rejected readings continue; NIS and whiteness start anew. No
  /// allocation, no lock, bounded time.
  Continuation continue_from(const FrictionObserver& before);

 private:
  std::unique_ptr<KalmanFilter> filter_;
};

}  // namespace stickslip::observer
