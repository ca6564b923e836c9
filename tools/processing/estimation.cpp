// SPDX-License-Identifier: Apache-2.0
#include "tools/processing/estimation.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "observer/kalman_filter.h"
#include "physics/problem.h"

namespace stickslip::processing {

using observer::FrictionEstimate;
using observer::Quantity;

namespace {

// An estimate has no field for the deflection of the load cell.
bool has_value(Quantity quantity) { return quantity != Quantity::load_cell_deflection; }

double value_of(const FrictionEstimate& e, Quantity quantity) {
  switch (quantity) {
    case Quantity::displacement:
      return e.displacement_m;
    case Quantity::velocity:
      return e.velocity_m_s;
    case Quantity::load_cell_velocity:
      return e.velocity_m_s - e.slip_velocity_m_s;
    case Quantity::theta:
      return e.theta;
    case Quantity::mu:
      return e.mu;
    case Quantity::gamma:
      return e.gamma_per_s;
    case Quantity::normal_load:
      return e.normal_load_n;
    case Quantity::friction_force:
      return e.friction_force_n;
    case Quantity::load_cell_deflection:
      break;
  }
  return 0.0;
}

nlohmann::ordered_json spread_json(const EstimateSummary::Spread& s) {
  nlohmann::ordered_json out;
  if (s.weight > 0.0) out = {{"mean", s.mean()}, {"low", s.low}, {"high", s.high}};
  return out;
}

double per_reading(double sum, const observer::PredictionQuality& predicted) {
  return sum / std::max(1.0, static_cast<double>(predicted.readings));
}

}  // namespace

std::vector<EstimateColumn> columns_of(const FrictionEstimate& first,
                                       const physics::ResultUnits& units) {
  std::vector<EstimateColumn> columns = {{units.column("time_s"), "%.9f"}};
  const auto add_with_deviation = [&columns](const std::string& name) {
    columns.push_back({name, "%.9g"});
    columns.push_back({name + "_std", "%.3g"});
  };
  for (std::size_t i = 0; i < first.used; ++i) {
    if (!has_value(first.quantities[i])) continue;
    add_with_deviation(units.column(observer::name_of(first.quantities[i])));
  }
  add_with_deviation(units.column("slip_velocity_m_s"));
  columns.push_back({"sticking", "%.4f"});
  columns.push_back({"nis", "%.4g"});
  columns.push_back({"good", "%.0f"});
  return columns;
}

std::vector<double> row_of(const FrictionEstimate& e) {
  std::vector<double> row = {static_cast<double>(e.time_ns) * 1.0e-9};
  for (std::size_t i = 0; i < e.used; ++i) {
    if (!has_value(e.quantities[i])) continue;
    row.push_back(value_of(e, e.quantities[i]));
    row.push_back(std::sqrt(std::max(0.0, e.covariance[i][i])));
  }
  for (const double each :
       {e.slip_velocity_m_s, e.slip_velocity_std_m_s, e.sticking, e.nis, e.valid ? 1.0 : 0.0}) {
    row.push_back(each);
  }
  return row;
}

void EstimateSummary::Spread::add(double value, double deviation) {
  if (!(deviation > 0.0)) return;
  low = weight > 0.0 ? std::min(low, value) : value;
  high = weight > 0.0 ? std::max(high, value) : value;
  sum += value / (deviation * deviation);
  weight += 1.0 / (deviation * deviation);
}

void EstimateSummary::add(const FrictionEstimate& e) {
  ++frames;
  if (!e.valid) return;
  ++good;
  mu.add(e.mu, e.standard_deviation(Quantity::mu));
  gamma.add(e.gamma_per_s, e.standard_deviation(Quantity::gamma));
  sticking += e.sticking;
}

double EstimateSummary::sticking_share() const {
  return good > 0 ? sticking / static_cast<double>(good) : 0.0;
}

double EstimateSummary::nll_per_reading() const {
  return per_reading(predicted.negative_log_likelihood, predicted);
}

double EstimateSummary::nis_per_reading() const {
  return per_reading(predicted.normalised_squares, predicted);
}

EstimateSummary estimate(const protocol::Recording& recording, const physics::Model& model,
                         const std::string& model_name,
                         const std::function<void(const FrictionEstimate&)>& take,
                         const protocol::ProgressCallback& done) {
  const double period_s = protocol::median_period_s(recording.frames);
  if (!(period_s > 0.0)) {
    throw InputError(Problem{recording.source, 0, 0,
                             "holds one sample, hence no sampling period; expected two or more"});
  }
  if (const std::string why = observer::KalmanFilter(model, period_s).unsupported(); !why.empty()) {
    throw InputError(Problem{model_name, 0, 0, why});
  }
  EstimateSummary summary;
  const auto add = [&](const FrictionEstimate& each) {
    summary.add(each);
    take(each);
  };
  summary.predicted = observer::smooth(model, period_s, recording.frames, add, {}, done);
  return summary;
}

nlohmann::ordered_json summary_json(const EstimateSummary& summary, const physics::Model& model) {
  nlohmann::ordered_json json;
  json["schema"] = 1;
  if (model.dimensionless) json["dimensionless"] = true;
  json["frames"] = summary.frames;
  json["good_frames"] = summary.good;
  json["mu"] = spread_json(summary.mu);
  json["gamma_per_s"] = spread_json(summary.gamma);
  json["sticking_share"] = summary.sticking_share();
  json["nll_per_reading"] = summary.nll_per_reading();
  json["nis_per_reading"] = summary.nis_per_reading();
  json["refused_readings"] = summary.predicted.refused;
  json["restarts"] = summary.predicted.restarts;
  return json;
}

}  // namespace stickslip::processing
