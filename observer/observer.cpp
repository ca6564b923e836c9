// SPDX-License-Identifier: Apache-2.0
#include "observer/observer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "observer/kalman_filter.h"

namespace stickslip::observer {

std::string_view words_for(EstimateStatus status) {
  switch (status) {
    case EstimateStatus::good:
      return "good";
    case EstimateStatus::waiting:
      return "waiting for a frame with displacement, velocity or friction force";
    case EstimateStatus::settling:
      return "settling: started less than the settling time of the sensor chains ago";
    case EstimateStatus::blind:
      return "no reading of the mass or of the friction force for too long";
    case EstimateStatus::out_of_step:
      return "the frame's time did not advance";
    case EstimateStatus::unsupported:
      return "the observer does not support this model";
    case EstimateStatus::impossible:
      return "beyond what the friction law allows";
  }
  return "";
}

double FrictionEstimate::standard_deviation(Quantity quantity) const {
  for (std::size_t i = 0; i < used; ++i) {
    if (quantities[i] == quantity) return std::sqrt(std::max(0.0, covariance[i][i]));
  }
  return 0.0;
}

bool is_possible(const FrictionEstimate& estimate) {
  for (std::size_t i = 0; i < estimate.used; ++i) {
    if (!(estimate.covariance[i][i] >= 0.0) || std::isinf(estimate.covariance[i][i])) return false;
  }
  const bool contact = estimate.normal_load_n > 0.0;  // without it theta has no meaning
  const double margin = std::min(4.0 * estimate.standard_deviation(Quantity::theta), 0.5);
  if (!std::isfinite(estimate.theta + estimate.sticking + estimate.slip_velocity_std_m_s)) {
    return false;
  }
  return (!contact || std::abs(estimate.theta) <= 1.0 + margin);
}

FrictionObserver::FrictionObserver(const physics::Model& model, double period_s) {
  if (!(period_s > 0.0) || !std::isfinite(period_s)) {
    throw std::invalid_argument("observer: the sampling period must be more than 0");
  }
  filter_ = std::make_unique<KalmanFilter>(model, period_s);
}

FrictionObserver::~FrictionObserver() = default;
FrictionObserver::FrictionObserver(FrictionObserver&&) noexcept = default;
FrictionObserver& FrictionObserver::operator=(FrictionObserver&&) noexcept = default;

const std::string& FrictionObserver::unsupported() const { return filter_->unsupported(); }

const FrictionEstimate& FrictionObserver::latest() const { return filter_->estimate(); }

Continuation FrictionObserver::continue_from(const FrictionObserver& before) {
  return filter_->continue_from(*before.filter_);
}

const FrictionEstimate& FrictionObserver::update(const Frame& frame) {
  filter_->update(frame);
  return filter_->estimate();
}

}  // namespace stickslip::observer
