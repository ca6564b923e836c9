// The extended Kalman filter behind FrictionObserver, for those who look into it: the observer and
// the smoother.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "observer/consistency.h"
#include "observer/covariance.h"
#include "observer/doubted_constants.h"
#include "observer/layout.h"
#include "observer/misreadings.h"
#include "observer/noise.h"
#include "observer/observer.h"
#include "observer/prediction.h"

namespace stickslip::observer {

class KalmanFilter {
 public:
  KalmanFilter(const physics::Model& declared, double period_s,
               Contact contact = Contact::to_be_learnt);
  // The prediction and the noise point at the rig and the layout.
  KalmanFilter(const KalmanFilter&) = delete;
  KalmanFilter& operator=(const KalmanFilter&) = delete;

  /// Why the model cannot be followed; empty where it can.
  const std::string& unsupported() const { return unsupported_; }
  const FrictionEstimate& estimate() const { return estimate_; }

  /// The last frame as the filter took it: put right where the model says that it was read wrongly.
  const Frame& frame() const { return frame_; }

  const Vector& mean() const { return mean_; }
  const Covariance& covariance() const { return covariance_; }
  const Transition& transition() const { return prediction_->transition(); }

  /// Takes a frame; `pass(*this)` is called for each period until then, and calls predict().
  template <class Pass>
  void update(const Frame& given, Pass&& pass) {
    Frame frame = given;
    const int periods = arrive(frame);
    if (periods < 0) return;
    for (int k = 0; k < periods; ++k) pass(*this);
    frame_ = frame;
    learn(frame);
  }
  void update(const Frame& frame) {
    update(frame, [](KalmanFilter& filter) { filter.predict(); });
  }

  /// One period passes.
  void predict();

  /// What the next predict() adds to the doubt before the period, and what the last one added after
  /// it.
  Covariance process_noise() const;
  Covariance output_noise() const;

  /// How a channel of a frame is read: at its own age, with the variance of its readings and of
  /// what is neglected by looking back along a straight line.
  struct Look {
    const Sight* sight = nullptr;  ///< until the next look at this channel
    double variance = 0.0;
    double foretold = 0.0;
  };
  Look look(Channel channel, const Frame& frame, const Vector& states);

  /// What these states and their covariance say, in the fields of an estimate that speak of the
  /// rig; and what doubted constants add to the doubt, unless null.
  void tell(const Vector& mean, const Covariance& covariance, const DoubtedConstants* constants,
            FrictionEstimate& e) const;

 private:
  KalmanFilter(const Followed& followed, double period_s, Contact contact);

  int arrive(Frame& frame);
  void learn(const Frame& frame);
  void name_quantities();
  double reading_variance(Channel channel) const;
  void hear_and_put_right(Frame& frame);
  void begin(const Frame& frame);
  void correct(const Frame& frame);
  bool use_reading(Channel channel, const Look& look, double innovation);
  bool is_new(Channel channel, const Frame& frame);
  bool is_healthy() const;
  void forget_readings();
  void report(const Frame& frame);
  void report_consistency();
  double base_acceleration_behind_its_chain() const;
  double slip_variance(const Covariance& covariance) const;
  double normal_load(const Vector& mean) const;

  // Declared before the layout, which says into it why there is none.
  std::string unsupported_;
  physics::Model model_;
  Misreadings misreadings_;
  physics::Rig rig_;
  double period_s_;
  Layout layout_;
  int steps_;
  Covariance covariance_;
  // Made only for a supported model.
  std::unique_ptr<Prediction> prediction_;
  std::unique_ptr<Noise> noise_;
  std::unique_ptr<DoubtedConstants> constants_;
  double settle_s_ = 0.0;
  /// The start is over: mu and gamma are learnt, and readings refused, from then on.
  double learn_s_ = 0.0;

  Vector mean_;
  Covariance::States gain_, column_;
  std::array<int, quantity_count> source_{};  ///< of reported quantities

  /// How each channel is looked at: in time, and as it was last, which is almost always the same.
  struct Eye {
    Sight in_time;
    double age_s = 0.0;
    Sight aged;
  };
  std::array<Eye, channel_count> eyes_;
  Frame frame_;
  Misreadings::PerChannel variance_{};  ///< of its readings, where they were put right

  bool started_ = false;
  std::int64_t origin_ns_ = 0;  ///< time 0 of the model
  bool has_origin_ = false;
  std::int64_t time_ns_ = 0;
  double since_start_s_ = 0.0;
  double since_sight_s_ = 0.0;
  double nis_level_ = 1.0;
  Consistency consistency_;
  double since_drive_s_ = 1.0e9;
  double lesson_ = 1.0;  ///< share of the gain on mu
  double absurd_s_ = 0.0;
  std::array<int, channel_count> outliers_in_a_row_{};
  std::array<std::int64_t, channel_count> read_at_ns_{};  ///< of the last reading of each channel
  std::array<bool, channel_count> has_read_{};
  FrictionEstimate estimate_;
};

}  // namespace stickslip::observer
