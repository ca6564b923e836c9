#include "observer/model_check.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "physics/number_text.h"

namespace stickslip::observer {

namespace {

using physics::Relation;

constexpr double block_s = 0.1;
constexpr double low_pass_s = 0.02;
constexpr double skip_after_start_s = 0.1;
constexpr double largest_innovation = 8.0;  // [standard deviations]; larger ones are clamped
constexpr double smallest_speed_m_s = 1.0e-3;
// A contact that sticks or creeps shows the error of a parameter rather than a change.
constexpr double moving_speed_m_s = 0.006;
constexpr double max_sticking = 0.8;
constexpr double motion_weight = 0.2;
constexpr double skip_after_rest_s = 0.5;

constexpr double reference_blocks = 15.0;  // needed for a reference
constexpr double max_reference_blocks = 600.0;
constexpr double largest_reference = 400.0;

constexpr double largest_parameter_std =
    0.05;  // relative; parameters with a larger one are ignored
constexpr double parameter_memory_s = 1.0;
constexpr double parameter_reference_blocks = 30.0;
constexpr double max_parameter_reference_blocks = 600.0;
constexpr double first_weight = 0.15;  // until the reference is known

// A CUSUM of a healthy rig is rarely 0; a change is possible above this value.
constexpr double smallest_change_cusum = 2.0;
constexpr double signature_s = 1.0;
constexpr double shortest_signature_s = 0.3;
constexpr double disturbed_energy = 400.0;
constexpr double disturbed_share = 0.1;  // of frames with rejected readings
constexpr double persistence_s = 2.0;
constexpr double parameter_delay_s = 3.0;
constexpr double disturbance_memory_s = 0.7;
constexpr double longest_disturbance_s = 4.0;
constexpr double recovery_s = 30.0;
constexpr double lead_s = 20.0;
constexpr double tail_s = 5.0;

// A restart in ten minutes is insignificant, one a second means divergence.
constexpr double log_ratio_per_restart = 6.4;
constexpr double restart_decay_per_s = -1.0;

// Six channels, three parameters, restarts.
constexpr double test_count = 10.0;

// In periods of the load cell: ringing of a cell that is softer than declared.
constexpr std::array ring_periods = {1.25, 1.45, 1.65};

constexpr std::size_t x = index_of(Channel::displacement);
constexpr std::size_t v = index_of(Channel::velocity);
constexpr std::size_t f = index_of(Channel::friction_force);

double square(double value) { return value * value; }

double correlation(double product, double a, double b) {
  return a > 0.0 && b > 0.0 ? product / std::sqrt(a * b) : 0.0;
}

std::int64_t nanoseconds(double s) { return std::llround(s * 1.0e9); }

}  // namespace

std::string_view name_of(ModelStatus status) {
  constexpr std::array<std::string_view, 3> names = {"learning", "follows", "broken"};
  return names[static_cast<std::size_t>(status)];
}

double energy_log_ratio(double ratio) {
  constexpr double freedom = 3.0;
  constexpr double inflation = 2.0;
  constexpr double growth = 4.0;
  return 0.5 * freedom * (ratio / inflation * (1.0 - 1.0 / growth) - std::log(growth));
}

double parameter_log_ratio(double squared_deviation) {
  constexpr double growth = 9.0;
  return 0.5 * (squared_deviation * (1.0 - 1.0 / growth) - std::log(growth));
}

double cusum_threshold(double days, double tests) {
  return std::log(days * 86400.0 / block_s * tests);
}

ModelCheck::ModelCheck(const physics::Model& model, double period_s,
                       const ModelCheckSettings& settings)
    : period_s_(period_s) {
  if (!(period_s > 0.0) || !std::isfinite(period_s)) {
    throw std::invalid_argument("model check: the sampling period must be more than 0");
  }
  if (!(settings.days_between_false_alarms > 0.0) ||
      !std::isfinite(settings.days_between_false_alarms)) {
    throw std::invalid_argument("model check: the days between false alarms must be more than 0");
  }
  threshold_ = std::max(5.0, cusum_threshold(settings.days_between_false_alarms, test_count));
  max_per_block_ = 0.25 * threshold_;
  low_pass_ = 1.0 - std::exp(-period_s / low_pass_s);
  low_pass_gain_ = (2.0 - low_pass_) / low_pass_;
  frames_per_block_ = std::max(1, static_cast<int>(std::lround(block_s / period_s)));
  if (model.normal_load && model.normal_load->law == physics::NormalLoadLaw::wedge) {
    wedge_slope_ = model.normal_load->slope_per_m.value;
  }
  if (model.load_cell && model.load_cell->natural_frequency_hz.value > 0.0) {
    const double cell_period = 1.0 / (model.load_cell->natural_frequency_hz.value * period_s);
    const double longest = cell_period * ring_periods.back();
    history_stride_ = 1 + static_cast<std::size_t>(longest / (force_history - 2));
    for (std::size_t i = 0; i < ring_lags; ++i) {
      const double frames = cell_period * ring_periods[i] / static_cast<double>(history_stride_);
      if (frames < 4.0) continue;  // not resolved at this sampling rate
      whole_lag_[i] = static_cast<std::size_t>(std::lround(frames));
      half_lag_[i] = static_cast<std::size_t>(std::lround(0.5 * frames));
    }
  }
  const bool load_is_a_parameter =
      model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured;
  parameters_ = {MonitoredParameter{.quantity = Quantity::mu,
                                    .relation = Relation::friction_law,
                                    .tolerance = 0.03,
                                    .used = true},
                 MonitoredParameter{.quantity = Quantity::gamma,
                                    .relation = Relation::friction_law,
                                    .tolerance = 0.25,
                                    .used = true},
                 MonitoredParameter{.quantity = Quantity::normal_load,
                                    .relation = Relation::normal_load,
                                    .tolerance = 0.03,
                                    .used = load_is_a_parameter}};
}

void ModelCheck::Sums::add(const Sums& other) {
  if (frames == 0.0) begin_ns = other.begin_ns;
  frames += other.frames;
  for (std::size_t i = 0; i < channel_count; ++i) {
    count[i] += other.count[i];
    square[i] += other.square[i];
  }
  velocity_force += other.velocity_force;
  displacement_velocity += other.displacement_velocity;
  xx += other.xx;
  xv += other.xv;
  vv += other.vv;
  x_innovation += other.x_innovation;
  v_innovation += other.v_innovation;
  for (std::size_t i = 0; i < ring_lags; ++i) {
    whole_lag[i] += other.whole_lag[i];
    half_lag[i] += other.half_lag[i];
  }
  rate_force += other.rate_force;
  rate_square += other.rate_square;
  speed_square += other.speed_square;
  sticking += other.sticking;
  refused += other.refused;
}

double ModelCheck::Reference::level() const {
  return mean + 2.0 * std::sqrt(std::max(0.0, mean_square - square(mean)));
}

bool ModelCheck::update(const FrictionEstimate& e) {
  const bool restarted = e.restarts != restarts_;
  if (restarted) {
    restart_cusum_ += log_ratio_per_restart;
    restarts_ = e.restarts;
    // The innovations that follow are those of the convergence.
    if (change_.frames * period_s_ > shortest_signature_s) collecting_ = false;
  }
  if (!e.valid) {
    to_skip_ = static_cast<int>(std::lround(skip_after_start_s / period_s_));
    low_pass_innovation_.fill(0.0);
    force_history_.fill(0.0);
  } else if (to_skip_ > 0) {
    --to_skip_;
  } else {
    add_frame(e);
  }
  if (++block_frames_ < frames_per_block_) return false;
  block_frames_ = 0;
  const bool changed = end_block(e);
  block_ = Sums{};
  return changed;
}

void ModelCheck::add_frame(const FrictionEstimate& e) {
  Sums& s = block_;
  if (s.frames == 0.0) s.begin_ns = e.time_ns;
  s.frames += 1.0;
  if (e.refused != 0) s.refused += 1.0;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((e.innovation_valid >> i & 1U) == 0 || !(e.innovation_std[i] > 0.0)) continue;
    const double z =
        std::clamp(e.innovation[i] / e.innovation_std[i], -largest_innovation, largest_innovation);
    low_pass_innovation_[i] += low_pass_ * (z - low_pass_innovation_[i]);
    s.count[i] += 1.0;
    s.square[i] += square(low_pass_innovation_[i]);
  }
  const double force = low_pass_innovation_[f];
  const double velocity = low_pass_innovation_[v];
  s.velocity_force += velocity * force;
  s.displacement_velocity += low_pass_innovation_[x] * velocity;
  s.xx += square(e.displacement_m);
  s.xv += e.displacement_m * e.velocity_m_s;
  s.vv += square(e.velocity_m_s);
  s.x_innovation += e.displacement_m * velocity;
  s.v_innovation += e.velocity_m_s * velocity;
  s.speed_square += square(e.slip_velocity_m_s);
  s.sticking += e.sticking;
  add_force_frame(e);
}

void ModelCheck::add_force_frame(const FrictionEstimate& e) {
  Sums& s = block_;
  const double force = low_pass_innovation_[f];
  if (history_stride_ == 1 || static_cast<std::size_t>(block_frames_) % history_stride_ == 0) {
    history_at_ = (history_at_ + 1) % force_history;
    force_history_[history_at_] = force;
  }
  for (std::size_t i = 0; i < ring_lags; ++i) {
    s.whole_lag[i] +=
        force * force_history_[(history_at_ + force_history - whole_lag_[i]) % force_history];
    s.half_lag[i] +=
        force * force_history_[(history_at_ + force_history - half_lag_[i]) % force_history];
  }
  if (e.raw_valid) {
    filtered_force_ += low_pass_ * (e.raw_friction_force_n - filtered_force_);
    slow_force_ += 2.0 * low_pass_ * (filtered_force_ - slow_force_);
    const double rate = filtered_force_ - slow_force_;
    s.rate_force += rate * force;
    s.rate_square += square(rate);
  }
}

std::size_t ModelCheck::bin_of(double speed_m_s) const {
  if (!(speed_m_s > smallest_speed_m_s)) return 0;
  const double octaves = std::log2(speed_m_s / smallest_speed_m_s);
  return std::min(bins - 1, static_cast<std::size_t>(octaves) + 1);
}

// The innovations of a wrong model grow with the motion: fourfold in energy per octave of speed.
double ModelCheck::expected_energy(std::size_t channel) const {
  const auto known = [&](std::size_t bin) {
    return references_[bin][channel].blocks >= reference_blocks;
  };
  if (known(bin_)) return std::clamp(references_[bin_][channel].level(), 1.0, largest_reference);
  for (std::size_t below = bin_; below-- > 0;) {
    if (!known(below)) continue;
    const double scale = std::exp2(2.0 * static_cast<double>(bin_ - below));
    return std::clamp(references_[below][channel].level() * scale, 1.0, largest_reference);
  }
  return largest_reference;
}

// Speed and sticking are averaged over half a second: a sliding contact sticks at each reversal.
bool ModelCheck::is_moving(double elapsed_s) {
  const bool enough = block_.frames >= 0.5 * frames_per_block_;
  if (enough) {
    speed_square_ += motion_weight * (block_.speed_square / block_.frames - speed_square_);
    sticking_ += motion_weight * (block_.sticking / block_.frames - sticking_);
  }
  const bool moving =
      enough && std::sqrt(speed_square_) > moving_speed_m_s && sticking_ < max_sticking;
  moving_s_ = moving ? moving_s_ + elapsed_s : 0.0;
  return moving_s_ > skip_after_rest_s;
}

void ModelCheck::update_tests(const FrictionEstimate& e, double elapsed_s) {
  if (tested_s_ == 0.0) tested_since_ns_ = block_.begin_ns;
  tested_s_ += elapsed_s;
  bin_ = bin_of(std::sqrt(speed_square_));
  update_channel_tests();
  update_parameter_tests(e, nominal_block_);
  since_disturbed_s_ = nominal_block_ ? since_disturbed_s_ + elapsed_s : 0.0;
}

void ModelCheck::track_change(std::int64_t now_ns, double elapsed_s) {
  if (!change_possible_) {
    change_possible_ = true;
    collecting_ = true;
    change_ = Sums{};
    since_change_s_ = 0.0;
    change_bin_ = bin_;
    verdict_.cusum = 0.0;
    change_.begin_ns = now_ns - nanoseconds(elapsed_s);
  }
  since_change_s_ += elapsed_s;
  change_bin_ = std::max(change_bin_, bin_);
  if (collecting_ && block_.frames > 0.0 && change_.frames * period_s_ < signature_s) {
    const std::int64_t begin_ns = change_.begin_ns;
    change_.add(block_);
    change_.begin_ns = begin_ns;
  }
}

bool ModelCheck::end_block(const FrictionEstimate& e) {
  const double elapsed_s = frames_per_block_ * period_s_;
  restart_cusum_ =
      std::clamp(restart_cusum_ + restart_decay_per_s * elapsed_s, 0.0, 2.0 * threshold_);
  // While the contact sticks nothing is tested, and no sum is reset.
  if (is_moving(elapsed_s)) update_tests(e, elapsed_s);
  const double largest = largest_cusum();
  // A disturbed block is kept for its signature even where it cannot be tested yet.
  if (largest < smallest_change_cusum && !is_disturbed()) {
    discard_change();
  } else {
    track_change(e.time_ns, elapsed_s);
  }
  if (verdict_.status == ModelStatus::broken) {
    const bool recovered = largest <= 0.0 && since_disturbed_s_ > recovery_s;
    if (!recovered) return false;
    verdict_.status = ModelStatus::follows;
    return true;
  }
  if (largest >= threshold_) {
    verdict_.cusum = std::max(verdict_.cusum, largest);
    return decide(e.time_ns);
  }
  if (verdict_.status == ModelStatus::learning && tested_s_ > 2.0 * reference_blocks * block_s) {
    verdict_.status = ModelStatus::follows;
    return true;
  }
  return false;
}

bool ModelCheck::is_disturbed() const {
  if (block_.refused > disturbed_share * block_.frames) return true;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (low_pass_gain_ * block_.square[i] > disturbed_energy * block_.count[i]) return true;
  }
  return false;
}

// A large change of a parameter makes the filter restart: both are evidence of the same change.
double ModelCheck::largest_cusum() const {
  double parameter = 0.0;
  for (const MonitoredParameter& p : parameters_) parameter = std::max(parameter, p.cusum);
  const double channel = *std::max_element(cusum_.begin(), cusum_.end());
  return std::max(channel, parameter + restart_cusum_);
}

// Page's cumulative sums.
void ModelCheck::update_channel_tests() {
  nominal_block_ = true;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (block_.count[i] < 0.5 * block_.frames) continue;
    const double energy = low_pass_gain_ * block_.square[i] / block_.count[i];
    const double step = std::min(energy_log_ratio(energy / expected_energy(i)), max_per_block_);
    cusum_[i] = std::clamp(cusum_[i] + step, 0.0, 2.0 * threshold_);
    nominal_block_ = nominal_block_ && step < 0.0;
    if (step >= 0.0 || change_possible_) continue;
    Reference& known = reference(i);
    known.blocks = std::min(known.blocks + 1.0, max_reference_blocks);
    known.mean += (energy - known.mean) / known.blocks;
    known.mean_square += (square(energy) - known.mean_square) / known.blocks;
  }
}

void ModelCheck::update_parameter_tests(const FrictionEstimate& e, bool nominal) {
  for (MonitoredParameter& p : parameters_) {
    if (!p.used) continue;
    const double deviation = e.standard_deviation(p.quantity);
    double value = p.quantity == Quantity::mu ? e.mu : e.gamma_per_s;
    if (p.quantity == Quantity::normal_load) {
      const double share = 1.0 + wedge_slope_ * e.displacement_m;
      value = share > 0.1 ? e.normal_load_n / share : 0.0;
    }
    const bool known = deviation > 0.0 && value > 0.0 && deviation < largest_parameter_std * value;
    if (known) update_parameter_test(p, value, deviation, nominal);
  }
}

// Estimates of consecutive blocks are correlated: one value per parameter_memory_s counts as one
// observation.
void ModelCheck::update_parameter_test(MonitoredParameter& p, double value, double deviation,
                                       bool nominal) {
  p.now = value;
  const bool has_reference = p.blocks >= parameter_reference_blocks;
  const double tolerance = p.tolerance * p.reference;
  // Past variation counts up to a limit: the filter may have started far from the true value.
  const double variance =
      square(tolerance) + square(2.0 * deviation) + std::min(p.spread, square(tolerance));
  const double squared = has_reference ? square(value - p.reference) / variance : 0.0;
  const double step =
      std::min(parameter_log_ratio(squared) * block_s / parameter_memory_s, max_per_block_);
  if (has_reference) p.cusum = std::clamp(p.cusum + step, 0.0, 2.0 * threshold_);
  if (!nominal || p.cusum != 0.0) return;
  p.blocks = std::min(p.blocks + 1.0, max_parameter_reference_blocks);
  const double weight = has_reference ? 1.0 / max_parameter_reference_blocks : first_weight;
  p.reference += (p.blocks == 1.0 ? 1.0 : weight) * (value - p.reference);
  p.spread += weight * (square(value - p.reference) - p.spread);
}

void ModelCheck::discard_change() {
  change_possible_ = false;
  collecting_ = false;
  since_change_s_ = 0.0;
}

const ModelCheck::MonitoredParameter* ModelCheck::changed_parameter() const {
  const MonitoredParameter* changed = nullptr;
  for (const MonitoredParameter& p : parameters_) {
    if (p.cusum + restart_cusum_ >= threshold_ && p.cusum > smallest_change_cusum &&
        (changed == nullptr || p.cusum > changed->cusum)) {
      changed = &p;
    }
  }
  return changed;
}

// A sum is above the threshold: alarm, wait, or transient disturbance. True for an alarm.
bool ModelCheck::decide(std::int64_t now_ns) {
  if (since_change_s_ < persistence_s) return false;
  const bool disturbed = since_disturbed_s_ < disturbance_memory_s || restart_cusum_ >= threshold_;
  const MonitoredParameter* changed = changed_parameter();
  if (disturbed && changed != nullptr && since_change_s_ < parameter_delay_s) return false;
  if (disturbed || changed != nullptr) {
    raise_alarm(now_ns, disturbed ? nullptr : changed);
    return true;
  }
  if (since_change_s_ > longest_disturbance_s && bin_ + 1 >= change_bin_) {
    // Transient, for example a knock: the rig is as before.
    cusum_.fill(0.0);
    restart_cusum_ = 0.0;
    discard_change();
  }
  return false;
}

Signature ModelCheck::signature() const {
  const Sums& s = change_;
  Signature out;
  out.frames = s.frames;
  if (s.frames == 0.0) return out;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (s.count[i] > 0.0) out.energy[i] = low_pass_gain_ * s.square[i] / s.count[i];
  }
  out.velocity_force = correlation(s.velocity_force, s.square[v], s.square[f]);
  out.displacement_velocity = correlation(s.displacement_velocity, s.square[x], s.square[v]);
  const double determinant = s.xx * s.vv - square(s.xv);
  if (determinant > 1.0e-9 * s.xx * s.vv && s.square[v] > 0.0) {
    const double on_x = (s.x_innovation * s.vv - s.v_innovation * s.xv) / determinant;
    const double on_v = (s.v_innovation * s.xx - s.x_innovation * s.xv) / determinant;
    out.velocity_by_motion = (on_x * s.x_innovation + on_v * s.v_innovation) / s.square[v];
  }
  if (s.square[f] > 0.0) {
    for (std::size_t i = 0; i < ring_lags; ++i) {
      if (whole_lag_[i] == 0) continue;
      out.ringing = std::max(out.ringing, 0.5 * (s.whole_lag[i] - s.half_lag[i]) / s.square[f]);
    }
    out.force_rate = correlation(s.rate_force, s.rate_square, s.square[f]);
  }
  out.refused = s.refused / s.frames;
  return out;
}

namespace {

struct Classification {
  Relation relation = Relation::friction_law;
  Relation alternative = Relation::friction_law;
  Channel channel = Channel::displacement;
  double probability = 0.0;
};

double logistic(double score) { return 1.0 / (1.0 + std::exp(-score)); }

// From the channels whose innovations have grown, and their correlations; see docs/observer.md.
Classification classify(const Signature& s) {
  const double motion = std::max({s.energy[x], s.energy[v], s.energy[f]});
  Classification out;
  for (const Channel channel :
       {Channel::normal_load, Channel::base_displacement, Channel::drive_force}) {
    const double energy = s.energy[index_of(channel)];
    if (energy <= 3.0 * motion) continue;
    const bool load = channel == Channel::normal_load;
    out.relation = load ? Relation::normal_load : Relation::sensor;
    out.alternative = load ? Relation::sensor : Relation::force_balance;
    out.channel = channel;
    out.probability = logistic(std::log(energy / std::max(motion, 1.0)));
    return out;
  }
  const double ex = std::log(std::max(s.energy[x], 0.1));
  const double ev = std::log(std::max(s.energy[v], 0.1));
  const double ef = std::log(std::max(s.energy[f], 0.1));
  // Displacement and velocity contradict each other: their innovations have opposite signs.
  const bool only_displacement = ex - std::max(ev, ef) > 2.3 && ef < 2.3;
  const bool only_velocity = ev - std::max(ex, ef) > 2.4;
  const bool opposed = (s.displacement_velocity < -0.3 && ex > ef - 1.0) ||
                       (ex > ev - 1.0 && std::min(ex, ev) - ef > 2.5);
  if (only_displacement || only_velocity || opposed) {
    out.relation = Relation::sensor;
    out.alternative = Relation::kinematics;
    out.channel = only_displacement ? Channel::displacement : Channel::velocity;
    out.probability = 0.8;
    return out;
  }
  // The acceleration contradicts spring and measured friction, in proportion to deflection and
  // velocity.
  if (ev - ef > 0.8 && s.velocity_by_motion > 0.85) {
    out.relation = Relation::force_balance;
    out.alternative = Relation::friction_law;
    out.probability = logistic(1.0 + ev - ef - 0.8);
    return out;
  }
  // A loose cell rings: its innovations are not proportional to the rate of the reading, as those
  // of a delay are.
  const double cell = 6.0 * (s.ringing - 0.2) + 5.0 * (s.force_rate + 0.35);
  // A wrong friction law affects the mass too, an error of the force sensor does not.
  const double contact = ev - ef + 1.5 - 6.0 * (s.velocity_force + 0.55);
  out.channel = Channel::friction_force;
  const Relation other = contact > 0.0 ? Relation::friction_law : Relation::sensor;
  if (cell > 0.0 && s.ringing > 0.0) {
    out.relation = Relation::load_cell;
    out.alternative = other;
    out.probability = logistic(cell);
    return out;
  }
  out.relation = other;
  out.alternative = contact > 0.0 ? Relation::sensor : Relation::friction_law;
  if (-cell < std::abs(contact) && s.ringing > 0.0) out.alternative = Relation::load_cell;
  out.probability = logistic(std::abs(contact));
  return out;
}

}  // namespace

double ModelCheck::known_reference(Quantity quantity) const {
  for (const MonitoredParameter& p : parameters_) {
    if (p.quantity == quantity && p.used && p.blocks >= parameter_reference_blocks) {
      return p.reference;
    }
  }
  return 0.0;
}

void ModelCheck::raise_alarm(std::int64_t now_ns, const MonitoredParameter* changed) {
  ModelVerdict& out = verdict_;
  out.status = ModelStatus::broken;
  out.since_ns = change_.begin_ns;
  out.reported_ns = now_ns;
  out.from_ns = std::max(tested_since_ns_, out.since_ns - nanoseconds(lead_s));
  out.to_ns = std::max(now_ns, out.since_ns + nanoseconds(tail_s));
  out.threshold = threshold_;
  out.parameter_was = 0.0;
  out.parameter_is = 0.0;
  ++out.alarms;
  out.reference_mu = known_reference(Quantity::mu);
  out.reference_gamma_per_s = known_reference(Quantity::gamma);
  out.reference_load_n = known_reference(Quantity::normal_load);
  if (changed != nullptr) {
    out.relation = changed->relation;
    out.alternative = changed->relation == Relation::friction_law ? Relation::normal_load
                                                                  : Relation::friction_law;
    out.channel = Channel::friction_force;
    out.parameter_was = changed->reference;
    out.parameter_is = changed->now;
    out.probability = 0.9;
    return;
  }
  const Classification found = classify(signature());
  out.relation = found.relation;
  out.alternative = found.alternative;
  out.channel = found.channel;
  out.probability = found.probability;
}

std::string words_for(const ModelVerdict& verdict) {
  using physics::number_text;
  std::string out = "the rig no longer follows its model: ";
  out += name_of(verdict.relation);
  if (verdict.relation == Relation::sensor) {
    out += " (" + std::string(channel_table[index_of(verdict.channel)].stem) + ")";
  }
  out += ", probability " + number_text(verdict.probability) + ", otherwise " +
         std::string(name_of(verdict.alternative));
  if (verdict.parameter_is > 0.0) {
    out += "; the estimate changed from " + number_text(verdict.parameter_was) + " to " +
           number_text(verdict.parameter_is);
  }
  return out;
}

}  // namespace stickslip::observer
