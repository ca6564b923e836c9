// Fault detection: a sequential test of the observer's innovations and parameters for a change of
// the rig, one call per frame. An alarm names the broken relation of the model, the time of the
// change, a probability, and the stretch of the recording to diagnose.
//
// docs/observer.md, "Live model check", derives the test statistics and thresholds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "observer/observer.h"
#include "physics/effect.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

struct ModelCheckSettings {
  /// Mean time between false alarms [days], > 0; determines every threshold.
  double days_between_false_alarms = 30.0;
};

enum class ModelStatus : std::uint8_t {
  learning,  ///< the reference statistics of the healthy rig are not known yet
  follows,   ///< no change detected
  broken,    ///< alarm; stays until the rig follows its model again
};

/// "learning", "follows", "broken"
std::string_view name_of(ModelStatus status);

/// Result of the check. A plain value of fixed size.
struct ModelVerdict {
  ModelStatus status = ModelStatus::learning;

  physics::Relation relation = physics::Relation::friction_law;
  Channel channel = Channel::displacement;  ///< Relation::sensor only
  /// Second most probable relation.
  physics::Relation alternative = physics::Relation::friction_law;
  /// Probability of the relation given that there is a change, 0 to 1; heuristic. The certainty of
  /// the change itself is set by `days_between_false_alarms`.
  double probability = 0.0;

  std::int64_t since_ns = 0;     ///< time of the change, accurate to about 0.2 s
  std::int64_t reported_ns = 0;  ///< time of the alarm
  /// Stretch for a diagnosis: from 20 s of valid estimates before the change to the alarm, at least
  /// 5 s after the change.
  std::int64_t from_ns = 0;
  std::int64_t to_ns = 0;

  /// Value of a changed parameter before and after; 0 and 0 otherwise.
  double parameter_was = 0.0;
  double parameter_is = 0.0;
  /// Parameters estimated before the change; 0 where not known.
  double reference_mu = 0.0;
  double reference_gamma_per_s = 0.0;
  double reference_load_n = 0.0;  ///< normal load at rest
  /// Largest CUSUM of log-likelihood ratios, and its threshold.
  double cusum = 0.0;
  double threshold = 0.0;

  std::uint64_t alarms = 0;  ///< since construction
};

static_assert(std::is_trivially_copyable_v<ModelVerdict>);

/// Description of an alarm for a person, in one sentence.
std::string words_for(const ModelVerdict& verdict);

/// Log-likelihood ratio of one block of 0.1 s for larger low-pass innovations of a channel.
/// `ratio`: their energy over the expected one.
double energy_log_ratio(double ratio);

/// Log-likelihood ratio for a changed parameter. `squared_deviation`: from its reference, over the
/// allowed variance.
double parameter_log_ratio(double squared_deviation);

/// CUSUM threshold for at most one false alarm in `days` days, for `tests` sums with one block each
/// 0.1 s.
double cusum_threshold(double days, double tests);

/// Fault signature, from the innovations of at most one second after the change.
struct Signature {
  std::array<double, channel_count>
      energy{};                        ///< of the low-pass innovations, 1 for a consistent filter
  double velocity_force = 0.0;         ///< correlation of the innovations, -1 to 1
  double displacement_velocity = 0.0;  ///< likewise
  double velocity_by_motion =
      0.0;                  ///< share of the velocity's energy explained by x and x', 0 to 1
  double ringing = 0.0;     ///< of the force innovations, below the cell's frequency, -1 to 1
  double force_rate = 0.0;  ///< correlation of the force innovations with the force's rate, -1 to 1
  double refused = 0.0;     ///< share of frames with rejected readings
  double frames = 0.0;      ///< number of frames
};

/// Monitors one rig. No heap memory, no lock, bounded time.
class ModelCheck {
 public:
  /// `period_s`: sampling period, > 0. Throws std::invalid_argument for settings or a period
  /// outside their range.
  ModelCheck(const physics::Model& model, double period_s, const ModelCheckSettings& settings = {});

  /// Processes the estimate of a frame; true where the status has changed. Estimates that are not
  /// valid are ignored.
  bool update(const FrictionEstimate& estimate);

  const ModelVerdict& verdict() const { return verdict_; }

  /// Signature of the latest change. For tests and studies.
  Signature signature() const;

 private:
  static constexpr std::size_t bins = 12;
  static constexpr std::size_t force_history = 256;
  static constexpr std::size_t ring_lags = 3;

  /// Sums over a block, or since a change.
  struct Sums {
    std::int64_t begin_ns = 0;
    double frames = 0.0;
    std::array<double, channel_count> count{};
    std::array<double, channel_count> square{};  ///< of low-pass innovations
    double velocity_force = 0.0, displacement_velocity = 0.0;
    double xx = 0.0, xv = 0.0, vv = 0.0, x_innovation = 0.0, v_innovation = 0.0;
    std::array<double, ring_lags> whole_lag{}, half_lag{};
    double rate_force = 0.0, rate_square = 0.0;
    double speed_square = 0.0;
    double sticking = 0.0;
    double refused = 0.0;
    void add(const Sums& other);
  };

  /// Innovation energy of a channel of the healthy rig, at one level of motion.
  struct Reference {
    double mean = 0.0;
    double mean_square = 0.0;
    double blocks = 0.0;
    /// Upper limit: mean plus two standard deviations.
    double level() const;
  };

  struct MonitoredParameter {
    Quantity quantity = Quantity::mu;
    physics::Relation relation = physics::Relation::friction_law;
    double tolerance = 0.0;  ///< relative
    bool used = false;
    double reference = 0.0;
    double spread = 0.0;  ///< mean square about the reference
    double blocks = 0.0;
    double now = 0.0;
    double cusum = 0.0;
  };

  void add_frame(const FrictionEstimate& e);
  void add_force_frame(const FrictionEstimate& e);
  bool end_block(const FrictionEstimate& e);
  bool is_moving(double elapsed_s);
  void update_tests(const FrictionEstimate& e, double elapsed_s);
  void track_change(std::int64_t now_ns, double elapsed_s);
  bool is_disturbed() const;
  double largest_cusum() const;
  void update_channel_tests();
  void update_parameter_tests(const FrictionEstimate& e, bool nominal);
  void update_parameter_test(MonitoredParameter& parameter, double value, double deviation,
                             bool nominal);
  bool decide(std::int64_t now_ns);
  const MonitoredParameter* changed_parameter() const;
  double known_reference(Quantity quantity) const;
  void raise_alarm(std::int64_t now_ns, const MonitoredParameter* changed);
  void discard_change();
  Reference& reference(std::size_t channel) { return references_[bin_][channel]; }
  double expected_energy(std::size_t channel) const;
  std::size_t bin_of(double speed_m_s) const;

  double period_s_;
  double threshold_;
  double max_per_block_;
  double low_pass_;           ///< weight of the low-pass of innovations
  double low_pass_gain_;      ///< gives white innovations of variance 1 an energy of 1
  double wedge_slope_ = 0.0;  ///< of the normal load [1/m]
  int frames_per_block_;
  std::array<std::size_t, ring_lags> whole_lag_{}, half_lag_{};  ///< in frames
  std::size_t history_stride_ = 1;

  int block_frames_ = 0;  ///< of this block, valid or not
  int to_skip_ = 0;       ///< frames to skip after a start or a gap
  std::uint64_t restarts_ = 0;
  std::array<double, channel_count> low_pass_innovation_{};
  std::array<double, force_history> force_history_{};
  std::size_t history_at_ = 0;
  double filtered_force_ = 0.0, slow_force_ = 0.0;
  Sums block_;
  Sums change_;                   ///< since the possible change
  bool change_possible_ = false;  ///< a test is above 0, or the block is disturbed
  bool collecting_ = false;       ///< change_ still grows
  bool nominal_block_ = true;
  double since_disturbed_s_ = 0.0;
  double moving_s_ = 0.0;
  double speed_square_ = 0.0;  ///< smoothed
  double sticking_ = 1.0;
  double since_change_s_ = 0.0;
  double tested_s_ = 0.0;
  std::size_t bin_ = 0;
  std::size_t change_bin_ = 0;
  std::int64_t tested_since_ns_ = 0;
  std::array<std::array<Reference, channel_count>, bins> references_{};
  std::array<double, channel_count> cusum_{};
  double restart_cusum_ = 0.0;
  std::array<MonitoredParameter, 3> parameters_{};
  ModelVerdict verdict_;
};

}  // namespace stickslip::observer
