// What nobody can measure, estimated at every frame: the friction force, its state theta and the
// coefficient mu, with the doubt about them. An extended Kalman filter on the rig's own equations
// (physics::Rig), the memories of its sensor chains, the drive and the slowly varying parameters.
// docs/observer.md says which states and noises, and what the filter cannot do yet.
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

/// What the covariance of an estimate is about.
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

/// The column name of a quantity, with its unit.
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

/// Why an estimate is to be believed, or not.
enum class Standing : std::uint8_t {
  good,         ///< believe it, within its covariance
  waiting,      ///< no frame yet from which the filter could start
  settling,     ///< started or restarted less than the sensor chains' memory ago
  blind,        ///< for too long no frame had a channel of the mass or of the friction force
  out_of_step,  ///< the frame's time did not advance; the estimate is the last one
  unsupported,  ///< the model is outside what this observer does: FrictionObserver::unsupported()
};

/// The standing in words that a person reads.
std::string_view words_for(Standing standing);

/// One estimate. A plain value of fixed size without padding between its fields. Where `standing`
/// is waiting or unsupported every number is 0; numbers are always finite.
struct FrictionEstimate {
  std::int64_t time_ns = 0;    ///< of the frame that it belongs to: no delay of a filter is left in
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
  /// Probability that the slip speed is below the law's transition speed (1 mm/s where that is
  /// less), the filter's doubt about the speed being taken as Gaussian. 0 to 1.
  double sticking = 0.0;

  /// Eq. (1) of the paper on the force channel as it was read (but for a gain or a
  /// curvature that [[physics]] terms tell), k_l y + m_l b'', with the delay of its sensor chain
  /// in it; and that over N, 0 where N is. For comparison; see raw_valid.
  double raw_friction_force_n = 0.0;
  double raw_friction_over_load = 0.0;

  /// Covariance of the first `used` of `quantities`, in their units; symmetric, 0 beyond them.
  std::array<std::array<double, quantity_count>, quantity_count> covariance{};

  /// Reading minus prediction for each channel of this frame [unit of the channel], and the
  /// standard deviation that the filter expected of it.
  std::array<double, channel_count> innovation{};
  std::array<double, channel_count> innovation_std{};

  /// Normalised innovation squared of the channels that were used: chi-squared distributed with
  /// nis_freedom degrees where the filter is right about its doubt.
  double nis = 0.0;

  /// NIS per degree of freedom, mean over the last two seconds, and the bounds that hold 95 % of
  /// such means where the filter is right about its doubt; 0, 0, 0 before the first reading.
  double nis_mean = 0.0, nis_mean_low = 0.0, nis_mean_high = 0.0;
  /// Correlation of each channel's normalised innovations with those of the frame before, mean over
  /// the last two seconds, and the magnitude below which 95 % of such means are where they are
  /// white.
  std::array<double, channel_count> whiteness{};
  std::array<double, channel_count> whiteness_bound{};

  std::uint64_t restarts = 0;  ///< how often the filter diverged and began anew
  std::uint64_t refusals = 0;  ///< channel readings refused as outliers since construction

  std::array<Quantity, quantity_count> quantities{};
  std::uint8_t used = 0;  ///< how many of `quantities` this model has

  Standing standing = Standing::waiting;
  bool valid = false;      ///< standing == Standing::good
  bool raw_valid = false;  ///< the frame had a force channel; otherwise the raw numbers are 0
  std::uint8_t nis_freedom = 0;
  std::uint8_t innovation_valid = 0;  ///< bit i: channel i was compared with its prediction
  std::uint8_t refused = 0;           ///< bit i: channel i was an outlier, used for nothing

  /// The standard deviation of a quantity; 0 where the estimate does not hold it.
  double standard_deviation(Quantity quantity) const;
};

static_assert(std::is_trivially_copyable_v<FrictionEstimate>);

class KalmanFilter;

/// Follows one rig. All memory is allocated by the constructor. Not for use by two threads at once.
class FrictionObserver {
 public:
  /// `period_s`: the sampling period, > 0. Throws std::invalid_argument where the period is not, or
  /// where inconsistencies_of(model) is not empty. A sound model that the observer cannot follow
  /// does not throw: see supported().
  FrictionObserver(const physics::Model& model, double period_s);
  ~FrictionObserver();
  FrictionObserver(FrictionObserver&&) noexcept;
  FrictionObserver& operator=(FrictionObserver&&) noexcept;

  bool supported() const { return unsupported().empty(); }
  /// Why the model is not supported, in words; empty where it is.
  const std::string& unsupported() const;

  /// Takes a frame in SI units, with whatever channels are valid in it, and says what is known at
  /// its time. Frames may be missing: up to 10 periods are bridged, a longer gap starts anew
  /// (without counting as a restart). Values that are not finite, or beyond 10^4 m, m/s
  /// and 10^9 N, are taken as not measured. No allocation, no lock, bounded time. The reference
  /// holds until the next call.
  const FrictionEstimate& update(const Frame& frame);

  const FrictionEstimate& latest() const;

 private:
  std::unique_ptr<KalmanFilter> filter_;
};

}  // namespace stickslip::observer
