// Whether the rig still follows its model: a sequential test on the observer's estimates, one call
// per frame. It says which relation of the contract is broken, since when, how sure that is and
// which stretch of the recording to hand to `stickslip diagnose`.
//
// docs/observer.md, "Live model check", derives statistic and thresholds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "observer/observer.h"
#include "physics/effects/effect.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

struct ModelCheckSettings {
  /// Mean time between false alarms [days], > 0: every threshold follows from it.
  double days_between_false_alarms = 30.0;
};

enum class ModelStanding : std::uint8_t {
  learning,  ///< too little was seen to know how well the model fits when all is well
  follows,
  broken,  ///< the verdict says what; stays until the rig follows again
};

/// "learning", "follows", "broken"
std::string_view name_of(ModelStanding standing);

/// What the check holds of the rig. A plain value of fixed size.
struct ModelVerdict {
  ModelStanding standing = ModelStanding::learning;

  physics::Relation relation = physics::Relation::friction_law;
  Channel channel = Channel::displacement;  ///< Relation::sensor only
  /// The next likely one, where the two are hard to tell apart.
  physics::Relation alternative = physics::Relation::friction_law;
  /// Of the relation against the others, 0 to 1, by rule of thumb: that something is broken is as
  /// sure as `days_between_false_alarms` says.
  double probability = 0.0;

  std::int64_t since_ns = 0;     ///< when the change began, to about 0.2 s
  std::int64_t reported_ns = 0;  ///< when it was certain enough
  std::int64_t from_ns = 0;  ///< stretch for a diagnosis: 20 s of good standing before the change
  std::int64_t to_ns = 0;    ///< and all until it was told, at least 5 s after the change

  /// Where a parameter has moved: what it was and what it is; 0 and 0 otherwise.
  double parameter_was = 0.0;
  double parameter_is = 0.0;
  /// What had been learnt of the rig until the change; 0 where nothing was.
  double usual_mu = 0.0;
  double usual_gamma_per_s = 0.0;
  double usual_load_n = 0.0;  ///< the normal load at rest
  /// Log likelihood ratio of the worst statistic and the threshold that it passed.
  double evidence = 0.0;
  double threshold = 0.0;

  std::uint64_t alarms = 0;  ///< since construction
};

static_assert(std::is_trivially_copyable_v<ModelVerdict>);

/// "The rig no longer follows its model: friction_law (0.93), for 4 s. ..." in one sentence for a
/// person; of a verdict that is broken.
std::string words_for(const ModelVerdict& verdict);

/// Log likelihood ratio of one block of 0.1 s for "the slow innovations of this channel have
/// grown". `ratio`: their energy over what is expected.
double energy_evidence(double ratio);

/// The same for "this parameter is another one". `squared_deviation`: from its reference, over the
/// variance allowed.
double parameter_evidence(double squared_deviation);

/// The evidence at which `tests` cumulative sums of a block's ratios each 0.1 s give one false
/// alarm in so many days, at most.
double evidence_threshold(double days, double tests);

/// What the relation is named from: the innovations from the change on, for a second at most.
struct Signature {
  std::array<double, channel_count> energy{};  ///< of the slow part, 1 where the filter is right
  double velocity_force = 0.0;         ///< correlation of the two channels' innovations, -1 to 1
  double displacement_velocity = 0.0;  ///< likewise
  double velocity_by_motion = 0.0;     ///< share of the velocity's that x and x' explain, 0 to 1
  double ringing = 0.0;                ///< of the force's, below the load cell's frequency, -1 to 1
  double force_rate = 0.0;  ///< correlation of the force's with the rate of the reading, -1 to 1
  double refused = 0.0;     ///< share of refused readings
  double frames = 0.0;      ///< that it was made of
};

/// Watches one rig. Holds no heap memory; no lock, no allocation, bounded time.
class ModelCheck {
 public:
  /// `period_s`: of the frames, > 0. Throws std::invalid_argument for settings or a period outside
  /// their range.
  ModelCheck(const physics::Model& model, double period_s, const ModelCheckSettings& settings = {});

  /// Takes the estimate of a frame; true where the standing has changed with it, or an alarm has
  /// found its name. Estimates without a good standing are counted as not seen.
  bool update(const FrictionEstimate& estimate);

  const ModelVerdict& verdict() const { return verdict_; }

  /// Of the latest suspicion. For tests and studies.
  Signature signature() const;

 private:
  static constexpr std::size_t bins = 12;
  static constexpr std::size_t force_past = 256;
  static constexpr std::size_t ring_lags = 3;

  /// What is summed over a block, and over a suspicion.
  struct Sums {
    std::int64_t begun_ns = 0;
    double frames = 0.0;
    std::array<double, channel_count> count{};
    std::array<double, channel_count> square{};  ///< of slow innovations
    double velocity_force = 0.0, displacement_velocity = 0.0;
    double xx = 0.0, xv = 0.0, vv = 0.0, x_innovation = 0.0, v_innovation = 0.0;
    std::array<double, ring_lags> whole_lag{}, half_lag{};
    double rate_force = 0.0, rate_square = 0.0;
    double speed_square = 0.0;
    double sticking = 0.0;
    double refused = 0.0;
    void add(const Sums& other);
  };

  /// How the innovations of a channel behave while all is well, at one level of motion.
  struct Reference {
    double mean = 0.0;
    double mean_square = 0.0;
    double blocks = 0.0;
    /// What is expected at most: two standard deviations over the mean.
    double level() const;
  };

  /// A parameter and what it was.
  struct Watched {
    Quantity quantity = Quantity::mu;
    physics::Relation relation = physics::Relation::friction_law;
    double tolerance = 0.0;  ///< relative
    bool used = false;
    double reference = 0.0;
    double spread = 0.0;  ///< mean square about it
    double blocks = 0.0;
    double now = 0.0;
    double evidence = 0.0;
  };

  void add_frame(const FrictionEstimate& e);
  bool end_block(const FrictionEstimate& e);
  bool is_stirred() const;
  double worst_evidence() const;
  void weigh_channels();
  void weigh_parameters(const FrictionEstimate& e, bool quiet);
  bool judge(std::int64_t now_ns);
  bool tell(std::int64_t now_ns, const Watched* moved);
  void forget_suspicion();
  Reference& reference(std::size_t channel) { return references_[bin_][channel]; }
  double expected_energy(std::size_t channel) const;
  std::size_t bin_of(double speed_m_s) const;

  double period_s_;
  double threshold_;
  double most_per_block_;
  double slow_;               ///< weight of the slow part's low-pass
  double slow_gain_;          ///< brings white innovations of variance 1 to an energy of 1
  double wedge_slope_ = 0.0;  ///< of the normal load [1/m]
  int frames_per_block_;
  std::array<std::size_t, ring_lags> whole_lag_{}, half_lag_{};  ///< in frames
  std::size_t past_stride_ = 1;

  int frames_seen_ = 0;  ///< of this block, valid or not
  int to_skip_ = 0;      ///< frames to leave out after a start or a gap
  std::uint64_t restarts_ = 0;
  std::array<double, channel_count> slow_part_{};
  std::array<double, force_past> past_force_{};
  std::size_t past_at_ = 0;
  double slow_reading_ = 0.0, slower_reading_ = 0.0;
  Sums block_;
  Sums suspicion_;
  bool suspicious_ = false;
  bool collecting_ = false;
  bool quiet_block_ = true;
  double since_quiet_s_ = 0.0;
  double moving_s_ = 0.0;
  double speed_square_ = 0.0;  ///< smoothed
  double sticking_ = 1.0;
  double since_onset_s_ = 0.0;
  double good_s_ = 0.0;
  std::size_t bin_ = 0;
  std::size_t onset_bin_ = 0;
  std::int64_t good_since_ns_ = 0;
  std::int64_t last_ns_ = 0;
  std::array<std::array<Reference, channel_count>, bins> references_{};
  std::array<double, channel_count> evidence_{};
  double restart_evidence_ = 0.0;
  std::array<Watched, 3> watched_{};
  ModelVerdict verdict_;
};

}  // namespace stickslip::observer
