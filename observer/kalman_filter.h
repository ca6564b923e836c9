// SPDX-License-Identifier: Apache-2.0
// Extended Kalman filter of FrictionObserver, with the interface that the smoother and tests need.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "observer/consider_parameters.h"
#include "observer/consistency.h"
#include "observer/continuation.h"
#include "observer/covariance.h"
#include "observer/layout.h"
#include "observer/noise.h"
#include "observer/observer.h"
#include "observer/prediction.h"
#include "observer/sensor_correction.h"

namespace stickslip::observer {

/// Where equations are linearised: states, and the variance of the slip velocity about them
/// [(m/s)^2].
struct LinearisationPoint {
  Vector mean;
  double slip_variance = 0.0;
};

class KalmanFilter {
 public:
  /// `step_s`: longest step of the integration; none: whatever the rig needs, and its exact linear
  /// part where it has one. A contact that reverses within a step has the time of the reversal
  /// rounded to the step, which matters where the slip velocity is known well.
  KalmanFilter(const physics::Model& declared, double period_s,
               FrictionPrior prior = FrictionPrior::from_model, std::optional<double> step_s = {});
  // The prediction and the noise model point at the rig and the layout.
  KalmanFilter(const KalmanFilter&) = delete;
  KalmanFilter& operator=(const KalmanFilter&) = delete;

  /// Reason why the model is not supported; empty where it is.
  const std::string& unsupported() const { return unsupported_; }
  const FrictionEstimate& estimate() const { return estimate_; }

  /// Last frame, with its sensor errors corrected.
  const Frame& frame() const { return frame_; }

  const Vector& mean() const { return mean_; }
  /// Without the part of the consider parameters.
  const Covariance& covariance() const { return covariance_; }
  const ConsiderParameters& consider_parameters() const { return *consider_; }
  /// Their paths (physics::parameters_of), in order.
  const std::vector<std::string>& considered() const { return considered_; }
  const Transition& transition() const { return prediction_->transition(); }

  /// Processes a frame. `time_update(*this)` is called for each period up to it, and has to call
  /// predict().
  template <class TimeUpdate>
  void update(const Frame& given, TimeUpdate&& time_update) {
    Frame frame = given;
    const int periods = accept(frame);
    if (periods < 0) return;
    for (int k = 0; k < periods; ++k) time_update(*this);
    frame_ = frame;
    measurement_update(frame);
  }
  void update(const Frame& frame) {
    update(frame, [](KalmanFilter& filter) { filter.predict(); });
  }

  /// See FrictionObserver::continue_from.
  Continuation continue_from(const KalmanFilter& before);

  /// Linearises the next update() about other states than the filter's own: those before its first
  /// period, and those after its readings; null: the filter's own. Both must live until then.
  void linearise_about(const LinearisationPoint* before, const LinearisationPoint* after) {
    about_before_ = before;
    about_after_ = after;
  }

  /// Time update by one period.
  void predict();

  /// Noise that the next predict() adds before the transition, and that the last one added after
  /// it. Valid until the next call of either.
  const Covariance& process_noise();
  const Covariance& output_noise();

  /// Prediction of a reading at its own age.
  struct PredictedReading {
    const MeasurementRow* row = nullptr;  ///< valid until the next prediction for this channel
    /// Variance of the reading's noise and of the error of the linear extrapolation to its age.
    double variance = 0.0;
    double value = 0.0;
  };
  PredictedReading predict_reading(Channel channel, const Frame& frame, const Vector& states);

  /// The quantities of an estimate as functions of the states near `mean`.
  std::array<QuantityRow, quantity_count> rows_of(const Vector& mean) const;

  /// Fills the fields of an estimate that describe the rig from states and their covariance.
  /// `consider`: added to the covariance unless null.
  void fill_estimate(const Vector& mean, const Covariance& covariance,
                     const ConsiderParameters* consider, FrictionEstimate& e) const;

 private:
  KalmanFilter(const SeparatedModel& separated, double period_s, FrictionPrior prior,
               std::optional<double> step_s);

  int accept(Frame& frame);
  void measurement_update(const Frame& frame);
  void map_quantities();
  QuantityRow load_row(const Vector& mean) const;
  double reading_variance(Channel channel) const;
  InputVariances input_variances() const;
  void correct_sensor_errors(Frame& frame);
  void reinitialise(const Frame& frame);
  void keep_agreeing(const KalmanFilter& before, Correspondence& from) const;
  void take_states(const KalmanFilter& before, const Correspondence& from);
  /// With the part of the consider parameters.
  double total_covariance(int row, int column) const;
  void apply_readings(const Frame& frame);
  double project_covariance(const MeasurementRow& row);
  bool apply_reading(Channel channel, const PredictedReading& predicted, double innovation);
  void compute_gain(Channel channel, double innovation_variance);
  bool is_new(Channel channel, const Frame& frame);
  bool is_healthy() const;
  void clear_innovations();
  void fill_report(const Frame& frame);
  void fill_covariance(const Vector& mean, const Covariance& covariance,
                       const ConsiderParameters* consider, FrictionEstimate& e) const;
  void report_consistency();
  double filtered_base_acceleration() const;
  double slip_variance(const Covariance& covariance) const;
  double slip_variance() const;  ///< of the present estimate, with the consider parameters
  struct Centre {
    const Vector& mean;
    double slip_variance;
  };
  /// `about`, or the present estimate where it is null.
  Centre centre(const LinearisationPoint* about) const;
  void add_output_noise(Covariance& covariance) const;
  double normal_load(const Vector& mean) const;

  // Declared before the layout, whose construction sets it.
  std::string unsupported_;
  physics::Model model_;
  SensorCorrection correction_;
  physics::Rig rig_;
  double period_s_;
  Layout layout_;
  int steps_;
  Covariance covariance_;
  // Only for a supported model.
  std::unique_ptr<Prediction> prediction_;
  std::unique_ptr<NoiseModel> noise_;
  std::unique_ptr<ConsiderParameters> consider_;
  std::vector<std::string> considered_;
  double settle_s_ = 0.0;
  /// Duration of the start, during which mu and gamma are not estimated and no reading is rejected.
  double startup_s_ = 0.0;

  Vector mean_;
  Vector before_;  ///< mean at the beginning of the last period
  const LinearisationPoint* about_before_ = nullptr;
  const LinearisationPoint* about_after_ = nullptr;
  Covariance::States gain_, column_;
  Covariance reported_noise_;
  std::array<QuantityRow, quantity_count> source_{};  ///< of the reported quantities

  /// Measurement row of a channel for age 0, and for its last age, which rarely changes.
  struct CachedRow {
    MeasurementRow current;
    double age_s = 0.0;
    MeasurementRow aged;
  };
  std::array<CachedRow, channel_count> rows_;
  Frame frame_;
  SensorCorrection::PerChannel variance_{};  ///< of corrected readings

  bool started_ = false;
  std::int64_t origin_ns_ = 0;  ///< time 0 of the model
  bool has_origin_ = false;
  std::int64_t time_ns_ = 0;
  double since_start_s_ = 0.0;
  double since_mechanical_s_ = 0.0;  ///< since a reading of mass or friction force was used
  double nis_level_ = 1.0;
  Consistency consistency_;
  double since_drive_s_ = 1.0e9;
  double mu_gain_factor_ = 1.0;
  double implausible_s_ = 0.0;
  std::array<int, channel_count> outliers_in_a_row_{};
  std::array<std::int64_t, channel_count> read_at_ns_{};  ///< time of each channel's last reading
  std::array<bool, channel_count> has_read_{};
  FrictionEstimate estimate_;
};

}  // namespace stickslip::observer
