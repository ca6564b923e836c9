#include "observer/kalman_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "observer/covariance.h"
#include "observer/layout.h"
#include "observer/noise.h"
#include "observer/prediction.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::Model;
namespace state = physics::state;

constexpr int longest_gap_periods = 10;
constexpr int most_steps = 64;
constexpr double outlier_sigmas = 8.0;
constexpr double outliers_to_restart_s = 0.05;
constexpr double nis_memory_s = 0.5;
constexpr double nis_to_restart = 12.0;  // per degree of freedom, averaged over nis_memory_s
constexpr double blind_after_s = 0.5;
constexpr double absurd_to_restart_s = 0.2;  // of parameters that no contact has
// While the drive is measured it is learnt from its own channel alone: what is wrong with the rig's
// model must not be explained away by a drive that was not there.
constexpr double drive_trusted_s = 0.1;

// A set-valued law is followed as a steep one; its transition is then widened by the filter's own
// doubt of the slip velocity.
constexpr double steep_transition_m_s = 5.0e-4;
constexpr double sticking_speed_m_s = 1.0e-3;

Model without_jumps(Model model) {
  if (model.friction.law != physics::FrictionLaw::none) {
    auto& speed = model.friction.transition_speed_m_s.value;
    speed = std::max(speed, steep_transition_m_s);
  }
  for (physics::Term& term : model.terms) {
    if (term.id != "dry_friction") continue;
    auto& speed = term.parameters["transition_speed_m_s"].value;
    speed = std::max(speed, steep_transition_m_s);
  }
  return model;
}

double square(double x) { return x * x; }

double probability_below(double limit, double mean, double deviation) {
  // Beyond eight deviations the law is 0 or 1 to the last digit.
  const double beyond = std::abs(mean) - limit;
  if (std::abs(beyond) >= 8.0 * deviation) return beyond < 0.0 ? 1.0 : 0.0;
  const double scale = 1.0 / (deviation * std::numbers::sqrt2);
  return 0.5 * (std::erf((limit - mean) * scale) + std::erf((limit + mean) * scale));
}

// No bench comes near these; squares of what lies beyond would overflow.
bool is_possible(Channel channel, double value) {
  const bool force = channel == Channel::friction_force || channel == Channel::normal_load ||
                     channel == Channel::drive_force;
  return std::abs(value) < (force ? 1.0e9 : 1.0e4);  // false for NaN
}

void drop_what_is_impossible(Frame& frame) {
  for (Channel channel : all_channels) {
    if (frame.has(channel) && !is_possible(channel, frame[channel])) frame.invalidate(channel);
  }
}

constexpr std::array mechanical_channels = {Channel::displacement, Channel::velocity,
                                            Channel::friction_force};

}  // namespace

KalmanFilter::KalmanFilter(const Model& declared, double period_s, Contact contact)
    : KalmanFilter(followed(declared), period_s, contact) {}

KalmanFilter::KalmanFilter(const Followed& followed, double period_s, Contact contact)
    : model_(without_jumps(followed.model)),
      misreadings_(followed.laws),
      rig_(model_),
      period_s_(period_s),
      layout_(layout_of(model_, rig_, unsupported_, followed.laws)),
      steps_(static_cast<int>(std::ceil(period_s / rig_.longest_step_s() - 1.0e-9))),
      covariance_(std::min(layout_.count, max_states)),
      consistency_(period_s) {
  if (unsupported_.empty() && steps_ > most_steps) {
    unsupported_ = "the sampling period of " + std::to_string(period_s) + " s needs " +
                   std::to_string(steps_) + " integration steps of this rig, the observer takes " +
                   std::to_string(most_steps) + " at most: sample faster";
  }
  if (!unsupported_.empty()) {
    estimate_.standing = Standing::unsupported;
    return;
  }
  prediction_ = prediction_for(rig_, model_, layout_, period_s_, steps_);
  noise_ =
      std::make_unique<Noise>(model_, rig_, layout_, prediction_->numbers(), period_s_, contact);
  constants_ = std::make_unique<DoubtedConstants>(model_, rig_, layout_, period_s_);
  const physics::SensorBank bank(model_, period_s_ / steps_);
  double latest_s = 0.0;
  for (const Chain& chain : layout_.chain) latest_s = std::max(latest_s, chain.delay_s);
  settle_s_ = std::clamp(bank.settling_time_s() + latest_s, 20.0 * period_s_, 2.0);
  learn_s_ = 2.0 * settle_s_;
  mean_ = Vector::Zero(layout_.count);
  for (Channel channel : all_channels) {
    if (!layout_.of(channel).used) continue;
    Eye& eye = eyes_[index_of(channel)];
    eye.in_time = eye.aged = sight_of(layout_, channel, 0.0);
  }
  name_quantities();
}

// The parts of the covariance that go out, and where they stand in the filter.
void KalmanFilter::name_quantities() {
  const auto name = [this](Quantity quantity, int index) {
    if (index < 0) return;
    estimate_.quantities[estimate_.used] = quantity;
    source_[estimate_.used] = index;
    ++estimate_.used;
  };
  name(Quantity::displacement, layout_.rig[state::x]);
  name(Quantity::velocity, layout_.rig[state::v]);
  name(Quantity::load_cell_deflection, layout_.rig[state::y]);
  name(Quantity::load_cell_velocity, layout_.rig[state::u]);
  name(Quantity::theta, layout_.theta);
  name(Quantity::mu, layout_.mu);
  name(Quantity::gamma, layout_.log_rate);
  name(Quantity::normal_load, layout_.load);
  name(Quantity::friction_force, layout_.friction);
}

double KalmanFilter::slip_variance(const Covariance& covariance) const {
  const int v = layout_.rig[state::v];
  const int u = layout_.rig[state::u];
  if (u < 0) return covariance(v, v);
  return covariance(v, v) + covariance(u, u) - 2.0 * covariance(v, u);
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
  return misreadings_.any() ? variance_[index_of(channel)] : noise_->reading_variance(channel);
}

// What is at its limit has no noise to be heard.
void KalmanFilter::hear_and_put_right(Frame& frame) {
  const auto of_readings = [this] {
    for (Channel channel : all_channels) {
      variance_[index_of(channel)] = noise_->reading_variance(channel);
    }
  };
  of_readings();
  misreadings_.leave_out_limited(frame, variance_);
  noise_->listen(frame);
  of_readings();
  misreadings_.take_back(frame, variance_);
  drop_what_is_impossible(frame);
}

// Starts, or starts anew, from what this frame says by itself.
void KalmanFilter::begin(const Frame& frame) {
  const bool seen = std::any_of(mechanical_channels.begin(), mechanical_channels.end(),
                                [&](Channel c) { return frame.has(c) && layout_.of(c).used; });
  if (!seen) {
    started_ = false;
    estimate_.standing = Standing::waiting;
    return;
  }
  if (!has_origin_) origin_ns_ = frame.time_ns;
  has_origin_ = true;
  // What a filter that is lost holds of mu may be no number.
  const bool keeps_mu = layout_.mu >= 0 && started_ && std::isfinite(mean_[layout_.mu]);
  const double old_mu = keeps_mu ? mean_[layout_.mu] : 0.0;
  noise_->start(frame, old_mu, mean_, covariance_);
  constants_->forget();
  absurd_s_ = 0.0;
  started_ = true;
  since_start_s_ = 0.0;
  since_sight_s_ = 0.0;
  nis_level_ = 1.0;
  consistency_.begin_anew();
  outliers_in_a_row_.fill(0);
}

void KalmanFilter::predict() {
  const double time_s = static_cast<double>(time_ns_ - origin_ns_) * 1.0e-9;
  const double doubt = slip_variance(covariance_);
  noise_->add_process(mean_, doubt, since_start_s_,
                      reading_variance(drive_channel(rig_.structure())), covariance_);
  constants_->push(mean_);
  prediction_->advance(mean_, time_s, doubt);
  covariance_.propagate(prediction_->transition());
  constants_->propagate(prediction_->transition());
  if (layout_.friction >= 0) noise_->add_output(mean_, covariance_);
}

Covariance KalmanFilter::process_noise() const {
  Covariance noise(layout_.count);
  noise_->add_process(mean_, slip_variance(covariance_), since_start_s_,
                      reading_variance(drive_channel(rig_.structure())), noise);
  return noise;
}

Covariance KalmanFilter::output_noise() const {
  Covariance noise(layout_.count);
  if (layout_.friction >= 0) noise_->add_output(mean_, noise);
  return noise;
}

KalmanFilter::Look KalmanFilter::look(Channel channel, const Frame& frame, const Vector& states) {
  Look out;
  const Chain& chain = layout_.of(channel);
  const double age_s =
      std::max(0, frame.age_us[index_of(channel)]) * 1.0e-6 + std::min(0.0, chain.delay_s);
  Eye& eye = eyes_[index_of(channel)];
  if (eye.age_s != age_s) {
    eye.age_s = age_s;
    eye.aged = sight_of(layout_, channel, age_s);
  }
  const Sight& sight = eye.aged;
  out.sight = &sight;
  out.variance = reading_variance(channel);
  out.foretold = sight.of(states, sight.count);
  if (age_s != 0.0) {
    const double since =
        sight.of(states, sight.moving) - eye.in_time.of(states, eye.in_time.moving);
    out.variance += square(0.5 * age_s * sight.bend_per_s * since);
  }
  return out;
}

// A slow source's reading stays in the frames, growing older, until the next one; it says something
// once.
bool KalmanFilter::is_new(Channel channel, const Frame& frame) {
  const std::size_t i = index_of(channel);
  const std::int64_t at_ns = frame.time_ns - std::int64_t{frame.age_us[i]} * 1000;
  const auto half_period_ns = static_cast<std::int64_t>(0.5e9 * period_s_);
  if (has_read_[i] && std::abs(at_ns - read_at_ns_[i]) < half_period_ns) return false;
  read_at_ns_[i] = at_ns;
  has_read_[i] = true;
  return true;
}

bool KalmanFilter::use_reading(Channel channel, const Look& look, double innovation) {
  const Sight& sight = *look.sight;
  covariance_.column(sight.at[0], column_);
  double variance = column_[sight.at[0]];
  if (sight.count > 1) {
    const auto terms = static_cast<std::size_t>(sight.count);
    for (int k = 0; k < layout_.count; ++k) column_[k] *= sight.weight[0];
    for (std::size_t j = 1; j < terms; ++j) {
      covariance_.column(sight.at[j], gain_);
      for (int k = 0; k < layout_.count; ++k) column_[k] += sight.weight[j] * gain_[k];
    }
    variance = 0.0;
    for (std::size_t j = 0; j < terms; ++j) variance += sight.weight[j] * column_[sight.at[j]];
  }
  const double expected = variance + look.variance;
  const std::size_t i = index_of(channel);
  const auto bit = static_cast<std::uint8_t>(1U << i);
  estimate_.innovation[i] = innovation;
  estimate_.innovation_std[i] = std::sqrt(expected);
  if (misreadings_.any()) {  // of the reading as it was read
    estimate_.innovation[i] /= misreadings_.stretch(channel);
    estimate_.innovation_std[i] /= misreadings_.stretch(channel);
  }
  estimate_.innovation_valid = static_cast<std::uint8_t>(estimate_.innovation_valid | bit);
  const double squared = square(innovation) / expected;
  if (since_start_s_ > learn_s_ && squared > square(outlier_sigmas)) {
    estimate_.refused = static_cast<std::uint8_t>(estimate_.refused | bit);
    ++estimate_.refusals;
    ++outliers_in_a_row_[i];
    return false;
  }
  outliers_in_a_row_[i] = 0;
  consistency_.take(i, estimate_.innovation[i] / estimate_.innovation_std[i]);
  estimate_.nis += squared;
  ++estimate_.nis_freedom;

  for (int k = 0; k < layout_.count; ++k) gain_[k] = column_[k] / expected;
  if (layout_.mu >= 0) gain_[layout_.mu] *= lesson_;
  if (layout_.log_rate >= 0 && since_start_s_ < learn_s_) gain_[layout_.log_rate] = 0.0;
  if (channel != drive_channel(rig_.structure()) && since_drive_s_ < drive_trusted_s) {
    for (int k = 0; k < 4; ++k) gain_[layout_.drive + k] = 0.0;
    const Chain& chain = layout_.of(drive_channel(rig_.structure()));
    chain.each_own_state([this](int state) { gain_[state] = 0.0; });
  }
  for (int k = 0; k < layout_.count; ++k) mean_[k] += gain_[k] * innovation;
  covariance_.correct(gain_, column_, expected);
  constants_->correct(sight, gain_);
  return true;
}

void KalmanFilter::correct(const Frame& frame) {
  bool seen = false;
  since_drive_s_ += period_s_;
  if (layout_.mu >= 0) {
    lesson_ = since_start_s_ < learn_s_ ? 0.0 : noise_->lesson(mean_, slip_variance(covariance_));
  }
  for (Channel channel : all_channels) {
    if (!frame.has(channel) || !layout_.of(channel).used || !is_new(channel, frame)) continue;
    const Look seeing = look(channel, frame, mean_);
    const double innovation = frame[channel] - seeing.foretold;
    const bool used = use_reading(channel, seeing, innovation);
    const std::size_t i = index_of(channel);
    if (channel == drive_channel(rig_.structure())) {
      since_drive_s_ = 0.0;
      noise_->learn_drive(estimate_.innovation[i] / estimate_.innovation_std[i]);
    }
    seen = seen || (used && std::find(mechanical_channels.begin(), mechanical_channels.end(),
                                      channel) != mechanical_channels.end());
  }
  since_sight_s_ = seen ? 0.0 : since_sight_s_ + period_s_;
  if (estimate_.nis_freedom > 0) {
    consistency_.take_frame(estimate_.nis, estimate_.nis_freedom);
    const double weight = std::min(1.0, period_s_ / nis_memory_s);
    nis_level_ += weight * (estimate_.nis / estimate_.nis_freedom - nis_level_);
  }
}

bool KalmanFilter::is_healthy() const {
  double sum = 0.0;
  double least = 1.0;
  for (int i = 0; i < layout_.count; ++i) {
    sum += 0.0 * mean_[i] + 0.0 * covariance_(i, i);
    least = std::min(least, covariance_(i, i));
  }
  if (sum != 0.0 || std::isnan(sum) || least < -1.0e-18) return false;
  if (absurd_s_ > absurd_to_restart_s) return false;
  if (since_start_s_ > learn_s_ && nis_level_ > nis_to_restart) return false;
  const int most = std::max(5, static_cast<int>(outliers_to_restart_s / period_s_));
  return std::none_of(outliers_in_a_row_.begin(), outliers_in_a_row_.end(),
                      [most](int count) { return count > most; });
}

// The second derivative of what the base sensor's chain delivers: as late as the reading of the
// load cell where both have the same filters, as on the paper's rig.
double KalmanFilter::base_acceleration_behind_its_chain() const {
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

void KalmanFilter::tell(const Vector& mean, const Covariance& covariance,
                        const DoubtedConstants* constants, FrictionEstimate& e) const {
  const auto& structure = rig_.structure();
  const auto& c = prediction_->numbers().c;
  e.displacement_m = mean[layout_.rig[state::x]];
  e.velocity_m_s = mean[layout_.rig[state::v]];
  const int u = layout_.rig[state::u];
  e.slip_velocity_m_s = e.velocity_m_s - (u >= 0 ? mean[u] : 0.0);
  double doubt = slip_variance(covariance);
  if (constants != nullptr) doubt += constants->slip_variance();
  e.slip_velocity_std_m_s = std::sqrt(std::max(0.0, doubt));
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
  // ln gamma is estimated; its neighbours are told about gamma.
  std::array<double, quantity_count> scale{};
  for (std::size_t i = 0; i < e.used; ++i) {
    scale[i] = e.quantities[i] == Quantity::gamma ? e.gamma_per_s : 1.0;
  }
  const auto states = std::span(source_).first(e.used);
  if (constants != nullptr) {
    constants->covariance_of(states, e.covariance);
  } else {
    for (std::size_t i = 0; i < e.used; ++i) e.covariance[i].fill(0.0);
  }
  for (std::size_t i = 0; i < e.used; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      e.covariance[i][j] = e.covariance[j][i] =
          scale[i] * scale[j] * (e.covariance[i][j] + covariance(source_[i], source_[j]));
    }
  }
}

void KalmanFilter::report(const Frame& frame) {
  FrictionEstimate& e = estimate_;
  tell(mean_, covariance_, constants_->any() ? constants_.get() : nullptr, e);
  const auto& structure = rig_.structure();
  e.raw_valid = structure.friction && frame.has(Channel::friction_force);
  e.raw_friction_force_n = 0.0;
  e.raw_friction_over_load = 0.0;
  if (e.raw_valid) {
    e.raw_friction_force_n = frame[Channel::friction_force];
    if (structure.load_cell && structure.excitation == Excitation::base) {
      e.raw_friction_force_n +=
          prediction_->numbers().c.cell_mass * base_acceleration_behind_its_chain();
    }
    if (e.normal_load_n > 0.0) e.raw_friction_over_load = e.raw_friction_force_n / e.normal_load_n;
  }
  report_consistency();
  if (since_start_s_ < settle_s_) {
    e.standing = Standing::settling;
  } else if (since_sight_s_ > blind_after_s) {
    e.standing = Standing::blind;
  } else {
    e.standing = Standing::good;
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

void KalmanFilter::forget_readings() {
  estimate_.innovation.fill(0.0);
  estimate_.innovation_std.fill(0.0);
  estimate_.innovation_valid = 0;
  estimate_.nis = 0.0;
  estimate_.nis_freedom = 0;
}

// How many periods have passed until this frame, of which absurd values are taken out; 0 too where
// the filter began with it, -1 where there is nothing to learn from it.
int KalmanFilter::arrive(Frame& frame) {
  drop_what_is_impossible(frame);
  FrictionEstimate& e = estimate_;
  e.time_ns = frame.time_ns;
  e.sequence = frame.sequence;
  e.valid = false;
  if (!unsupported_.empty()) return -1;
  forget_readings();
  e.refused = 0;
  e.raw_valid = false;

  if (misreadings_.any()) {
    hear_and_put_right(frame);
  } else {
    noise_->listen(frame);
  }
  const double elapsed = static_cast<double>(frame.time_ns - time_ns_) * 1.0e-9;
  const double periods = std::round(elapsed / period_s_);
  if (!started_ || std::abs(periods) > longest_gap_periods) {
    begin(frame);
    time_ns_ = frame.time_ns;
    return started_ ? 0 : -1;
  }
  if (periods < 1.0) {
    e.standing = Standing::out_of_step;
    return -1;
  }
  return static_cast<int>(periods);
}

void KalmanFilter::learn(const Frame& frame) {
  since_start_s_ += static_cast<double>(frame.time_ns - time_ns_) * 1.0e-9;
  time_ns_ = frame.time_ns;
  correct(frame);
  noise_->confine(mean_);
  absurd_s_ = noise_->is_absurd(mean_) ? absurd_s_ + period_s_ : 0.0;
  if (!is_healthy()) {
    ++estimate_.restarts;
    forget_readings();  // a filter that is lost says nothing about the readings
    begin(frame);
    if (!started_) return;
  }
  report(frame);
  estimate_.valid = estimate_.standing == Standing::good;
}

}  // namespace stickslip::observer
