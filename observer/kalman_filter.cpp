// SPDX-License-Identifier: Apache-2.0
#include "observer/kalman_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <utility>

#include "observer/covariance.h"
#include "observer/dual_prediction.h"
#include "observer/layout.h"
#include "observer/noise.h"
#include "observer/prediction.h"
#include "physics/catalogue.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::Model;
namespace state = physics::state;

constexpr int longest_gap_periods = 10;
constexpr int max_steps = 64;
constexpr double outlier_sigmas = 8.0;
constexpr double outliers_to_restart_s = 0.05;
constexpr double nis_memory_s = 0.5;
constexpr double nis_to_restart = 12.0;  // per degree of freedom, averaged over nis_memory_s
constexpr double blind_after_s = 0.5;
constexpr double implausible_to_restart_s = 0.2;  // of mu or gamma
// While the drive is measured only its own channel corrects it: errors of the rig's model must not
// be attributed to the drive.
constexpr double drive_measured_s = 0.1;

// A set-valued law is approximated by a steep one, whose transition is widened further by the
// uncertainty of the slip velocity.
constexpr double steep_transition_m_s = 5.0e-4;
constexpr double sticking_speed_m_s = 1.0e-3;

Model without_jumps(Model model) {
  if (model.friction.law != physics::FrictionLaw::none) {
    auto& speed = model.friction.transition_speed_m_s.value;
    speed = std::max(speed, steep_transition_m_s);
  }
  for (physics::Term& term : model.terms) {
    const physics::Effect* effect = physics::effect_of(term);
    if (effect == nullptr || !effect->card().transition_speed) continue;
    const auto& name = effect->card().parameters[*effect->card().transition_speed].name;
    auto& speed = term.parameters[std::string(name)].value;
    speed = std::max(speed, steep_transition_m_s);
  }
  return model;
}

double square(double x) { return x * x; }

double probability_below(double limit, double mean, double deviation) {
  // Beyond eight standard deviations it is 0 or 1 in double precision.
  const double beyond = std::abs(mean) - limit;
  if (std::abs(beyond) >= 8.0 * deviation) return beyond < 0.0 ? 1.0 : 0.0;
  const double scale = 1.0 / (deviation * std::numbers::sqrt2);
  return 0.5 * (std::erf((limit - mean) * scale) + std::erf((limit + mean) * scale));
}

// Limits far beyond any bench, within which squares do not overflow.
bool is_measurable(Channel channel, double value) {
  const bool force = channel == Channel::friction_force || channel == Channel::normal_load ||
                     channel == Channel::drive_force;
  return std::abs(value) < (force ? 1.0e9 : 1.0e4);  // false for NaN
}

void drop_impossible(Frame& frame) {
  for (Channel channel : all_channels) {
    if (frame.has(channel) && !is_measurable(channel, frame[channel])) frame.invalidate(channel);
  }
}

constexpr std::array mechanical_channels = {Channel::displacement, Channel::velocity,
                                            Channel::friction_force};

}  // namespace

KalmanFilter::KalmanFilter(const Model& declared, double period_s, FrictionPrior prior,
                           std::optional<double> step_s)
    : KalmanFilter(separate_sensor_errors(declared), period_s, prior, step_s) {}

KalmanFilter::KalmanFilter(const SeparatedModel& separated, double period_s, FrictionPrior prior,
                           std::optional<double> step_s)
    : model_(without_jumps(separated.model)),
      correction_(separated.laws),
      rig_(model_),
      period_s_(period_s),
      layout_(make_layout(model_, rig_, unsupported_, separated.laws)),
      steps_(static_cast<int>(std::ceil(period_s / rig_.longest_step_s() - 1.0e-9))),
      covariance_(std::min(layout_.count, max_states)),
      reported_noise_(covariance_.count()),
      consistency_(period_s) {
  if (unsupported_.empty() && steps_ > max_steps) {
    unsupported_ = "the sampling period of " + std::to_string(period_s) + " s needs " +
                   std::to_string(steps_) +
                   " integration steps of this rig, the observer supports at most " +
                   std::to_string(max_steps) + ": sample faster";
  }
  if (!unsupported_.empty()) {
    estimate_.status = EstimateStatus::unsupported;
    return;
  }
  if (step_s) {
    const int fine = static_cast<int>(std::ceil(period_s / *step_s - 1.0e-9));
    prediction_ = std::make_unique<DualPrediction>(rig_, model_, layout_, period_s_,
                                                   std::clamp(fine, steps_, max_steps));
  } else {
    prediction_ = make_prediction(rig_, model_, layout_, period_s_, steps_);
  }
  noise_ =
      std::make_unique<NoiseModel>(model_, rig_, layout_, prediction_->numbers(), period_s_, prior);
  std::unique_ptr<ParameterResponse> response =
      prediction_->response_to(uncertain_parameters(model_, rig_, layout_), model_);
  considered_ = response->paths();
  considered_.insert(considered_.end(), separated.shifted_paths.begin(),
                     separated.shifted_paths.end());
  consider_ = std::make_unique<ConsiderParameters>(
      std::move(response), ReadingErrors(separated.laws, separated.shifted, layout_, period_s_),
      layout_, covariance_);
  covariance_ = Covariance(layout_.count, consider_->count());
  prediction_->set_row_width(covariance_.width());
  const physics::SensorBank bank(model_, period_s_ / steps_);
  double latest_s = 0.0;
  for (const Chain& chain : layout_.chain) latest_s = std::max(latest_s, chain.delay_s);
  settle_s_ = std::clamp(bank.settling_time_s() + latest_s, 20.0 * period_s_, 2.0);
  startup_s_ = 2.0 * settle_s_;
  before_ = mean_ = Vector::Zero(layout_.count);
  for (Channel channel : all_channels) {
    if (!layout_.of(channel).used) continue;
    CachedRow& row = rows_[index_of(channel)];
    row.current = row.aged = measurement_row(layout_, channel, 0.0);
  }
  map_quantities();
}

// Selects the quantities whose covariance is reported, with their states.
void KalmanFilter::map_quantities() {
  const auto add = [this](Quantity quantity, int index) {
    if (index < 0) return;
    estimate_.quantities[estimate_.used] = quantity;
    source_[estimate_.used] = {{index, -1}, {1.0, 0.0}, quantity == Quantity::normal_load};
    ++estimate_.used;
  };
  add(Quantity::displacement, layout_.rig[state::x]);
  add(Quantity::velocity, layout_.rig[state::v]);
  add(Quantity::load_cell_deflection, layout_.rig[state::y]);
  add(Quantity::load_cell_velocity, layout_.rig[state::u]);
  add(Quantity::theta, layout_.theta);
  add(Quantity::mu, layout_.mu);
  add(Quantity::gamma, layout_.log_rate);
  const bool wedge =
      rig_.structure().loaded && rig_.structure().load_law == physics::NormalLoadLaw::wedge;
  add(Quantity::normal_load, wedge ? layout_.rig[state::x] : layout_.load);
  add(Quantity::friction_force, layout_.friction);
}

// Also where the contact is lost: the load is then between 0 and what its uncertainty allows.
QuantityRow KalmanFilter::load_row(const Vector& mean) const {
  if (rig_.structure().load_law != physics::NormalLoadLaw::wedge) {
    return {{layout_.load, -1}, {1.0, 0.0}, true};
  }
  const auto& c = prediction_->numbers().c;
  const int x = layout_.rig[state::x];
  const double load = layout_.load >= 0 ? mean[layout_.load] : c.load;
  return {{x, layout_.load}, {load * c.load_slope, 1.0 + c.load_slope * mean[x]}, true};
}

std::array<QuantityRow, quantity_count> KalmanFilter::rows_of(const Vector& mean) const {
  std::array<QuantityRow, quantity_count> rows = source_;
  for (QuantityRow& row : rows) {
    if (row.is_load) row = load_row(mean);
  }
  return rows;
}

double KalmanFilter::slip_variance(const Covariance& covariance) const {
  const int v = layout_.rig[state::v];
  const int u = layout_.rig[state::u];
  if (u < 0) return covariance(v, v);
  return covariance(v, v) + covariance(u, u) - 2.0 * covariance(v, u);
}

double KalmanFilter::slip_variance() const {
  return slip_variance(covariance_) + consider_->slip_variance();
}

double KalmanFilter::normal_load(const Vector& mean) const {
  const auto& structure = rig_.structure();
  if (!structure.loaded) return 1.0;
  const auto& c = prediction_->numbers().c;
  const double load = layout_.load >= 0 ? mean[layout_.load] : c.load;
  if (structure.load_law != physics::NormalLoadLaw::wedge) return std::max(0.0, load);
  return std::max(0.0, load * (1.0 + c.load_slope * mean[layout_.rig[state::x]]));
}

double KalmanFilter::reading_variance(Channel channel) const {
  return correction_.any() ? variance_[index_of(channel)] : noise_->reading_variance(channel);
}

InputVariances KalmanFilter::input_variances() const {
  return {.drive = reading_variance(drive_channel(rig_.structure())),
          .load = layout_.load_rate >= 0 ? reading_variance(Channel::normal_load) : 0.0};
}

// Saturated readings are dropped first: they would bias the estimate of the noise.
void KalmanFilter::correct_sensor_errors(Frame& frame) {
  const auto update_variances = [this] {
    for (Channel channel : all_channels) {
      variance_[index_of(channel)] = noise_->reading_variance(channel);
    }
  };
  update_variances();
  correction_.drop_saturated(frame, variance_);
  noise_->estimate_reading_noise(frame);
  update_variances();
  correction_.correct(frame, variance_);
  drop_impossible(frame);
}

// Initial state from this frame alone.
void KalmanFilter::reinitialise(const Frame& frame) {
  const bool observed = std::any_of(mechanical_channels.begin(), mechanical_channels.end(),
                                    [&](Channel c) { return frame.has(c) && layout_.of(c).used; });
  if (!observed) {
    started_ = false;
    estimate_.status = EstimateStatus::waiting;
    return;
  }
  if (!has_origin_) origin_ns_ = frame.time_ns;
  has_origin_ = true;
  // The mu of a diverged filter may be NaN.
  const bool keeps_mu = layout_.mu >= 0 && started_ && std::isfinite(mean_[layout_.mu]);
  const double old_mu = keeps_mu ? mean_[layout_.mu] : 0.0;
  noise_->initialise(frame, old_mu, mean_, covariance_);
  implausible_s_ = 0.0;
  started_ = true;
  since_start_s_ = 0.0;
  since_mechanical_s_ = 0.0;
  nis_level_ = 1.0;
  consistency_.reinitialise();
  outliers_in_a_row_.fill(0);
}

KalmanFilter::Centre KalmanFilter::centre(const LinearisationPoint* about) const {
  if (about != nullptr) return {about->mean, about->slip_variance};
  return {mean_, slip_variance()};
}

void KalmanFilter::predict() {
  const double time_s = static_cast<double>(time_ns_ - origin_ns_) * 1.0e-9;
  const auto& [centre_mean, variance] = centre(about_before_);
  noise_->add_process_noise(centre_mean, variance, since_start_s_, input_variances(), covariance_);
  before_ = centre_mean;
  Vector deviation;
  if (about_before_ != nullptr) {
    deviation = mean_ - before_;
    mean_ = before_;
  }
  prediction_->advance(mean_, time_s, variance);
  covariance_.propagate(prediction_->transition());
  if (consider_->any()) {
    consider_->propagate(before_, mean_, time_s, prediction_->widened_transition_speed(variance));
  }
  if (about_before_ != nullptr) mean_ += prediction_->transition().dense() * deviation;
  about_before_ = nullptr;  // that of later periods is not known
  add_output_noise(covariance_);
}

void KalmanFilter::add_output_noise(Covariance& covariance) const {
  if (layout_.friction < 0 || layout_.theta < layout_.core) return;
  const auto& [mean, variance] = centre(about_after_);
  noise_->add_output_noise(mean, variance, covariance);
}

const Covariance& KalmanFilter::process_noise() {
  reported_noise_.set_zero();
  const auto& [mean, variance] = centre(about_before_);
  noise_->add_process_noise(mean, variance, since_start_s_, input_variances(), reported_noise_);
  return reported_noise_;
}

const Covariance& KalmanFilter::output_noise() {
  reported_noise_.set_zero();
  add_output_noise(reported_noise_);
  return reported_noise_;
}

KalmanFilter::PredictedReading KalmanFilter::predict_reading(Channel channel, const Frame& frame,
                                                             const Vector& states) {
  PredictedReading out;
  const Chain& chain = layout_.of(channel);
  const double age_s =
      std::max(0, frame.age_us[index_of(channel)]) * 1.0e-6 + std::min(0.0, chain.delay_s);
  CachedRow& cached = rows_[index_of(channel)];
  if (cached.age_s != age_s) {
    cached.age_s = age_s;
    cached.aged = measurement_row(layout_, channel, age_s);
  }
  const MeasurementRow& row = cached.aged;
  out.row = &row;
  out.variance = reading_variance(channel);
  out.value = row.product(states, row.count);
  if (age_s != 0.0) {
    const double change = row.product(states, row.dynamic_terms) -
                          cached.current.product(states, cached.current.dynamic_terms);
    out.variance += square(0.5 * age_s * row.bandwidth_rad_s * change);
  }
  return out;
}

// The reading of a slow source is repeated, with growing age, until the next one. It is used once.
bool KalmanFilter::is_new(Channel channel, const Frame& frame) {
  const std::size_t i = index_of(channel);
  const std::int64_t at_ns = frame.time_ns - std::int64_t{frame.age_us[i]} * 1000;
  const auto half_period_ns = static_cast<std::int64_t>(0.5e9 * period_s_);
  if (has_read_[i] && std::abs(at_ns - read_at_ns_[i]) < half_period_ns) return false;
  read_at_ns_[i] = at_ns;
  has_read_[i] = true;
  return true;
}

// column_ becomes P H'; returns H P H'.
inline double KalmanFilter::project_covariance(const MeasurementRow& row) {
  covariance_.column(row.state[0], column_);
  if (row.count == 1) return column_[row.state[0]];
  const auto terms = static_cast<std::size_t>(row.count);
  for (int k = 0; k < layout_.count; ++k) column_[k] *= row.weight[0];
  for (std::size_t j = 1; j < terms; ++j) {
    covariance_.column(row.state[j], gain_);
    for (int k = 0; k < layout_.count; ++k) column_[k] += row.weight[j] * gain_[k];
  }
  double variance = 0.0;
  for (std::size_t j = 0; j < terms; ++j) variance += row.weight[j] * column_[row.state[j]];
  return variance;
}

// Optimal gain from column_, without the corrections that would harm the filter.
inline void KalmanFilter::compute_gain(Channel channel, double innovation_variance) {
  covariance_.optimal_gain(column_, consider_->innovation_error(), innovation_variance, gain_);
  if (layout_.mu >= 0) gain_[layout_.mu] *= mu_gain_factor_;
  if (layout_.log_rate >= 0 && since_start_s_ < startup_s_) gain_[layout_.log_rate] = 0.0;
  const Channel driven = drive_channel(rig_.structure());
  const bool is_own =
      channel == driven || (driven == Channel::displacement && channel == Channel::velocity);
  if (is_own || since_drive_s_ >= drive_measured_s) return;
  for (int k = 0; k < 4; ++k) gain_[layout_.drive + k] = 0.0;
  layout_.of(driven).for_each_state([this](int state) { gain_[state] = 0.0; });
}

// False where the reading is rejected as an outlier.
bool KalmanFilter::apply_reading(Channel channel, const PredictedReading& predicted,
                                 double innovation) {
  const MeasurementRow& row = *predicted.row;
  const double own_variance = project_covariance(row) + predicted.variance;
  const double innovation_variance = own_variance + consider_->project(channel, row, mean_);
  const std::size_t i = index_of(channel);
  const auto bit = static_cast<std::uint8_t>(1U << i);
  estimate_.innovation[i] = innovation;
  estimate_.innovation_std[i] = std::sqrt(innovation_variance);
  if (correction_.any()) {  // in the units of the uncorrected reading
    estimate_.innovation[i] /= correction_.slope(channel);
    estimate_.innovation_std[i] /= correction_.slope(channel);
  }
  estimate_.innovation_valid = static_cast<std::uint8_t>(estimate_.innovation_valid | bit);
  const double squared = square(innovation) / innovation_variance;
  if (since_start_s_ > startup_s_ && squared > square(outlier_sigmas)) {
    estimate_.refused = static_cast<std::uint8_t>(estimate_.refused | bit);
    ++estimate_.refusals;
    ++outliers_in_a_row_[i];
    return false;
  }
  outliers_in_a_row_[i] = 0;
  consistency_.add_innovation(i, estimate_.innovation[i] / estimate_.innovation_std[i]);
  estimate_.nis += squared;
  ++estimate_.nis_freedom;

  compute_gain(channel, innovation_variance);
  for (int k = 0; k < layout_.count; ++k) mean_[k] += gain_[k] * innovation;
  covariance_.correct(gain_, column_, own_variance, consider_->innovation_error());
  return true;
}

void KalmanFilter::apply_readings(const Frame& frame) {
  bool mechanical = false;
  since_drive_s_ += period_s_;
  if (layout_.mu >= 0) {
    const auto& [mean, variance] = centre(about_after_);
    mu_gain_factor_ = since_start_s_ < startup_s_ ? 0.0 : noise_->mu_gain_factor(mean, variance);
  }
  for (Channel channel : all_channels) {
    if (!frame.has(channel) || !layout_.of(channel).used || !is_new(channel, frame)) continue;
    const PredictedReading predicted = predict_reading(channel, frame, mean_);
    const double innovation = frame[channel] - predicted.value;
    const bool used = apply_reading(channel, predicted, innovation);
    const std::size_t i = index_of(channel);
    noise_->adapt_input_noise(channel, estimate_.innovation[i] / estimate_.innovation_std[i]);
    if (channel == drive_channel(rig_.structure())) since_drive_s_ = 0.0;
    mechanical =
        mechanical || (used && std::find(mechanical_channels.begin(), mechanical_channels.end(),
                                         channel) != mechanical_channels.end());
  }
  since_mechanical_s_ = mechanical ? 0.0 : since_mechanical_s_ + period_s_;
  if (estimate_.nis_freedom > 0) {
    consistency_.add_nis(estimate_.nis, estimate_.nis_freedom);
    const double weight = std::min(1.0, period_s_ / nis_memory_s);
    nis_level_ += weight * (estimate_.nis / estimate_.nis_freedom - nis_level_);
  }
}

bool KalmanFilter::is_healthy() const {
  constexpr double most = std::numeric_limits<double>::max();
  int wrong = 0;  // without branches
  for (int i = 0; i < layout_.count; ++i) {
    const double variance = covariance_(i, i);
    wrong += static_cast<int>(!(std::abs(mean_[i]) <= most)) +
             static_cast<int>(!(variance <= most)) + static_cast<int>(!(variance >= -1.0e-18));
  }
  if (wrong > 0) return false;
  if (implausible_s_ > implausible_to_restart_s) return false;
  if (since_start_s_ > startup_s_ && nis_level_ > nis_to_restart) return false;
  const int longest = std::max(5, static_cast<int>(outliers_to_restart_s / period_s_));
  return std::none_of(outliers_in_a_row_.begin(), outliers_in_a_row_.end(),
                      [longest](int count) { return count > longest; });
}

// Second derivative of the output of the base sensor's chain. It has the delay of the load cell's
// reading where both have the same filters, as on the paper's rig.
double KalmanFilter::filtered_base_acceleration() const {
  const Chain& chain = layout_.of(Channel::base_displacement);
  if (chain.sections.empty() || !chain.sections.back().second_order) {
    return mean_[layout_.drive + 2];
  }
  const Section& last = chain.sections.back();
  double input = mean_[layout_.drive];
  if (chain.sections.size() > 1) {
    const Section& before = chain.sections[chain.sections.size() - 2];
    input = mean_[chain.reading - (before.second_order ? 2 : 1)];
  }
  return square(last.omega) * (input - mean_[chain.reading]) -
         last.damping * mean_[chain.reading + 1];
}

void KalmanFilter::fill_estimate(const Vector& mean, const Covariance& covariance,
                                 const ConsiderParameters* consider, FrictionEstimate& e) const {
  const auto& structure = rig_.structure();
  const auto& c = prediction_->numbers().c;
  e.displacement_m = mean[layout_.rig[state::x]];
  e.velocity_m_s = mean[layout_.rig[state::v]];
  const int u = layout_.rig[state::u];
  e.slip_velocity_m_s = e.velocity_m_s - (u >= 0 ? mean[u] : 0.0);
  double variance = slip_variance(covariance);
  if (consider != nullptr) variance += consider->slip_variance();
  e.slip_velocity_std_m_s = std::sqrt(std::max(0.0, variance));
  e.normal_load_n = normal_load(mean);
  if (structure.friction) {
    e.theta = mean[layout_.theta];
    e.mu = mean[layout_.mu];
    e.friction_force_n = mean[layout_.friction];
    if (structure.kinetics == physics::Kinetics::relaxing) {
      e.gamma_per_s = layout_.log_rate >= 0 ? std::exp(mean[layout_.log_rate]) : c.rate;
    }
    e.sticking = probability_below(std::max(c.transition_speed, sticking_speed_m_s),
                                   e.slip_velocity_m_s, e.slip_velocity_std_m_s);
  }
  if (e.normal_load_n <= 0.0) e.theta = std::clamp(e.theta, -1.0, 1.0);  // nothing to measure
  fill_covariance(mean, covariance, consider, e);
}

namespace {

double covariance_of(const QuantityRow& one, const QuantityRow& other,
                     const Covariance& covariance) {
  const auto of = [&](std::size_t a, std::size_t b) {
    return one.weight[a] * other.weight[b] * covariance(one.state[a], other.state[b]);
  };
  double sum = of(0, 0);
  if (one.state[1] >= 0) sum += of(1, 0);
  if (other.state[1] >= 0) sum += of(0, 1);
  if (one.state[1] >= 0 && other.state[1] >= 0) sum += of(1, 1);
  return sum;
}

}  // namespace

void KalmanFilter::fill_covariance(const Vector& mean, const Covariance& covariance,
                                   const ConsiderParameters* consider, FrictionEstimate& e) const {
  // The state is ln gamma, the reported quantity gamma.
  std::array<double, quantity_count> scale{};
  const std::array<QuantityRow, quantity_count> rows = rows_of(mean);
  for (std::size_t i = 0; i < e.used; ++i) {
    scale[i] = e.quantities[i] == Quantity::gamma ? e.gamma_per_s : 1.0;
  }
  if (consider != nullptr) {
    consider->covariance_of(std::span(rows).first(e.used), e.covariance);
  } else {
    for (std::size_t i = 0; i < e.used; ++i) e.covariance[i].fill(0.0);
  }
  for (std::size_t i = 0; i < e.used; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      e.covariance[i][j] = e.covariance[j][i] =
          scale[i] * scale[j] * (e.covariance[i][j] + covariance_of(rows[i], rows[j], covariance));
    }
    if (e.quantities[i] == Quantity::mu) e.covariance[i][i] += square(backbone_std * e.mu);
  }
}

void KalmanFilter::fill_report(const Frame& frame) {
  FrictionEstimate& e = estimate_;
  fill_estimate(mean_, covariance_, consider_->any() ? consider_.get() : nullptr, e);
  const auto& structure = rig_.structure();
  e.raw_valid = structure.friction && frame.has(Channel::friction_force);
  e.raw_friction_force_n = 0.0;
  e.raw_friction_over_load = 0.0;
  if (e.raw_valid) {
    e.raw_friction_force_n = frame[Channel::friction_force];
    if (structure.load_cell && structure.excitation == Excitation::base) {
      e.raw_friction_force_n += prediction_->numbers().c.cell_mass * filtered_base_acceleration();
    }
    if (e.normal_load_n > 0.0) e.raw_friction_over_load = e.raw_friction_force_n / e.normal_load_n;
  }
  report_consistency();
  if (since_start_s_ < settle_s_) {
    e.status = EstimateStatus::settling;
  } else if (since_mechanical_s_ > blind_after_s) {
    e.status = EstimateStatus::blind;
  } else {
    e.status = is_possible(e) ? EstimateStatus::good : EstimateStatus::impossible;
  }
}

void KalmanFilter::report_consistency() {
  FrictionEstimate& e = estimate_;
  const RunningMean& nis = consistency_.nis();
  e.nis_mean = nis.mean();
  const bool any = nis.bound() > 0.0;
  e.nis_mean_low = any ? 1.0 - nis.bound() : 0.0;
  e.nis_mean_high = any ? 1.0 + nis.bound() : 0.0;
  for (std::size_t i = 0; i < channel_count; ++i) {
    e.whiteness[i] = consistency_.whiteness(i).mean();
    e.whiteness_bound[i] = consistency_.whiteness(i).bound();
  }
}

void KalmanFilter::clear_innovations() {
  estimate_.innovation.fill(0.0);
  estimate_.innovation_std.fill(0.0);
  estimate_.innovation_valid = 0;
  estimate_.nis = 0.0;
  estimate_.nis_freedom = 0;
}

// Number of periods up to this frame, from which impossible values are removed; 0 also where the
// filter starts with it, -1 where it cannot be used.
int KalmanFilter::accept(Frame& frame) {
  drop_impossible(frame);
  FrictionEstimate& e = estimate_;
  e.time_ns = frame.time_ns;
  e.sequence = frame.sequence;
  e.valid = false;
  if (!unsupported_.empty()) return -1;
  clear_innovations();
  e.refused = 0;
  e.raw_valid = false;

  consider_->read(frame);
  if (correction_.any()) {
    correct_sensor_errors(frame);
  } else {
    noise_->estimate_reading_noise(frame);
  }
  const double elapsed = static_cast<double>(frame.time_ns - time_ns_) * 1.0e-9;
  const double periods = std::round(elapsed / period_s_);
  if (!started_ || std::abs(periods) > longest_gap_periods) {
    reinitialise(frame);
    time_ns_ = frame.time_ns;
    return started_ ? 0 : -1;
  }
  if (periods < 1.0) {
    e.status = EstimateStatus::out_of_step;
    return -1;
  }
  return static_cast<int>(periods);
}

void KalmanFilter::measurement_update(const Frame& frame) {
  since_start_s_ += static_cast<double>(frame.time_ns - time_ns_) * 1.0e-9;
  time_ns_ = frame.time_ns;
  apply_readings(frame);
  noise_->constrain(mean_);
  implausible_s_ = noise_->is_implausible(mean_) ? implausible_s_ + period_s_ : 0.0;
  if (!is_healthy()) {
    ++estimate_.restarts;
    clear_innovations();  // those of a diverged filter are meaningless
    reinitialise(frame);
    if (!started_) return;
  }
  fill_report(frame);
  estimate_.valid = estimate_.status == EstimateStatus::good;
}

}  // namespace stickslip::observer
