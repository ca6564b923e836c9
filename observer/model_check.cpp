#include "observer/model_check.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace stickslip::observer {

namespace {

using physics::Relation;

constexpr double block_s = 0.1;
constexpr double slow_s = 0.02;
constexpr double skip_after_start_s = 0.1;
constexpr double largest_innovation = 8.0;  // [standard deviations] of what is counted
constexpr double smallest_speed_m_s = 1.0e-3;
// A contact that sticks, or creeps, shows what a parameter is off by rather than what has changed.
constexpr double moving_speed_m_s = 0.006;
constexpr double most_sticking = 0.8;
constexpr double motion_weight = 0.2;
constexpr double skip_after_rest_s = 0.5;

constexpr double blocks_to_learn = 15.0;
constexpr double blocks_remembered = 600.0;
constexpr double worst_reference = 400.0;

constexpr double doubtful_parameter = 0.05;  // relative deviation above which it says nothing
constexpr double parameter_memory_s = 1.0;
constexpr double parameter_blocks_to_learn = 30.0;
constexpr double parameter_blocks_remembered = 600.0;
constexpr double first_weight = 0.15;  // while it is learnt

// A sum of ratios is seldom just 0; what begins is what goes beyond this.
constexpr double suspicious_evidence = 2.0;
constexpr double signature_s = 1.0;
constexpr double least_signature_s = 0.3;
constexpr double stirred_energy = 400.0;
constexpr double stirred_share = 0.1;  // of refused readings
constexpr double persistence_s = 2.0;
constexpr double parameter_patience_s = 3.0;
constexpr double loud_memory_s = 0.7;
constexpr double disturbance_s = 4.0;
constexpr double recovery_s = 30.0;
constexpr double lead_s = 20.0;
constexpr double tail_s = 5.0;

// A restart once in ten minutes is nothing, one a second is a filter that is lost.
constexpr double restart_evidence_each = 6.4;
constexpr double restart_evidence_per_s = -1.0;

// Six channels, three parameters, restarts.
constexpr double test_count = 10.0;

// In load-cell periods: where a cell rings that is looser than declared.
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

std::string_view name_of(ModelStanding standing) {
  constexpr std::array<std::string_view, 3> names = {"learning", "follows", "broken"};
  return names[static_cast<std::size_t>(standing)];
}

double energy_evidence(double ratio) {
  constexpr double freedom = 3.0;
  constexpr double inflation = 2.0;
  constexpr double growth = 4.0;
  return 0.5 * freedom * (ratio / inflation * (1.0 - 1.0 / growth) - std::log(growth));
}

double parameter_evidence(double squared_deviation) {
  constexpr double growth = 9.0;
  return 0.5 * (squared_deviation * (1.0 - 1.0 / growth) - std::log(growth));
}

double evidence_threshold(double days, double tests) {
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
  threshold_ = std::max(5.0, evidence_threshold(settings.days_between_false_alarms, test_count));
  most_per_block_ = 0.25 * threshold_;
  slow_ = 1.0 - std::exp(-period_s / slow_s);
  slow_gain_ = (2.0 - slow_) / slow_;
  frames_per_block_ = std::max(1, static_cast<int>(std::lround(block_s / period_s)));
  if (model.normal_load && model.normal_load->law == physics::NormalLoadLaw::wedge) {
    wedge_slope_ = model.normal_load->slope_per_m.value;
  }
  if (model.load_cell && model.load_cell->natural_frequency_hz.value > 0.0) {
    const double cell_period = 1.0 / (model.load_cell->natural_frequency_hz.value * period_s);
    const double longest = cell_period * ring_periods.back();
    past_stride_ = 1 + static_cast<std::size_t>(longest / (force_past - 2));
    for (std::size_t i = 0; i < ring_lags; ++i) {
      const double frames = cell_period * ring_periods[i] / static_cast<double>(past_stride_);
      if (frames < 4.0) continue;  // sampled too slowly to see it
      whole_lag_[i] = static_cast<std::size_t>(std::lround(frames));
      half_lag_[i] = static_cast<std::size_t>(std::lround(0.5 * frames));
    }
  }
  const bool load_is_a_parameter =
      model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured;
  watched_ = {Watched{.quantity = Quantity::mu,
                      .relation = Relation::friction_law,
                      .tolerance = 0.03,
                      .used = true},
              Watched{.quantity = Quantity::gamma,
                      .relation = Relation::friction_law,
                      .tolerance = 0.25,
                      .used = true},
              Watched{.quantity = Quantity::normal_load,
                      .relation = Relation::normal_load,
                      .tolerance = 0.03,
                      .used = load_is_a_parameter}};
}

void ModelCheck::Sums::add(const Sums& other) {
  if (frames == 0.0) begun_ns = other.begun_ns;
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
    restart_evidence_ += restart_evidence_each;
    restarts_ = e.restarts;
    // What follows is the filter finding its way.
    if (suspicion_.frames * period_s_ > least_signature_s) collecting_ = false;
  }
  if (!e.valid) {
    to_skip_ = static_cast<int>(std::lround(skip_after_start_s / period_s_));
    slow_part_.fill(0.0);
    past_force_.fill(0.0);
  } else if (to_skip_ > 0) {
    --to_skip_;
  } else {
    add_frame(e);
  }
  if (++frames_seen_ < frames_per_block_) return false;
  frames_seen_ = 0;
  const bool told = end_block(e);
  block_ = Sums{};
  last_ns_ = e.time_ns;
  return told;
}

void ModelCheck::add_frame(const FrictionEstimate& e) {
  Sums& s = block_;
  if (s.frames == 0.0) s.begun_ns = e.time_ns;
  s.frames += 1.0;
  if (e.refused != 0) s.refused += 1.0;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((e.innovation_valid >> i & 1U) == 0 || !(e.innovation_std[i] > 0.0)) continue;
    const double z =
        std::clamp(e.innovation[i] / e.innovation_std[i], -largest_innovation, largest_innovation);
    slow_part_[i] += slow_ * (z - slow_part_[i]);
    s.count[i] += 1.0;
    s.square[i] += square(slow_part_[i]);
  }
  const double force = slow_part_[f];
  const double velocity = slow_part_[v];
  s.velocity_force += velocity * force;
  s.displacement_velocity += slow_part_[x] * velocity;
  s.xx += square(e.displacement_m);
  s.xv += e.displacement_m * e.velocity_m_s;
  s.vv += square(e.velocity_m_s);
  s.x_innovation += e.displacement_m * velocity;
  s.v_innovation += e.velocity_m_s * velocity;
  s.speed_square += square(e.slip_velocity_m_s);
  s.sticking += e.sticking;

  if (past_stride_ == 1 || static_cast<std::size_t>(frames_seen_) % past_stride_ == 0) {
    past_at_ = (past_at_ + 1) % force_past;
    past_force_[past_at_] = force;
  }
  for (std::size_t i = 0; i < ring_lags; ++i) {
    s.whole_lag[i] += force * past_force_[(past_at_ + force_past - whole_lag_[i]) % force_past];
    s.half_lag[i] += force * past_force_[(past_at_ + force_past - half_lag_[i]) % force_past];
  }
  if (e.raw_valid) {
    slow_reading_ += slow_ * (e.raw_friction_force_n - slow_reading_);
    slower_reading_ += 2.0 * slow_ * (slow_reading_ - slower_reading_);
    const double rate = slow_reading_ - slower_reading_;
    s.rate_force += rate * force;
    s.rate_square += square(rate);
  }
}

std::size_t ModelCheck::bin_of(double speed_m_s) const {
  if (!(speed_m_s > smallest_speed_m_s)) return 0;
  const double octaves = std::log2(speed_m_s / smallest_speed_m_s);
  return std::min(bins - 1, static_cast<std::size_t>(octaves) + 1);
}

// What a wrong model leaves over grows with the motion: fourfold in energy with each octave.
double ModelCheck::expected_energy(std::size_t channel) const {
  const auto learnt = [&](std::size_t bin) {
    return references_[bin][channel].blocks >= blocks_to_learn;
  };
  if (learnt(bin_)) return std::clamp(references_[bin_][channel].level(), 1.0, worst_reference);
  for (std::size_t below = bin_; below-- > 0;) {
    if (!learnt(below)) continue;
    const double scale = std::exp2(2.0 * static_cast<double>(bin_ - below));
    return std::clamp(references_[below][channel].level() * scale, 1.0, worst_reference);
  }
  return worst_reference;
}

bool ModelCheck::end_block(const FrictionEstimate& e) {
  const double elapsed_s = frames_per_block_ * period_s_;
  const double restarts = restart_evidence_;
  restart_evidence_ =
      std::clamp(restarts + restart_evidence_per_s * elapsed_s, 0.0, 2.0 * threshold_);
  const bool enough = block_.frames >= 0.5 * frames_per_block_;
  if (enough) {
    // Over half a second: a contact that slides sticks at each reversal.
    speed_square_ += motion_weight * (block_.speed_square / block_.frames - speed_square_);
    sticking_ += motion_weight * (block_.sticking / block_.frames - sticking_);
  }
  const double speed = std::sqrt(speed_square_);
  const bool moving = enough && speed > moving_speed_m_s && sticking_ < most_sticking;
  moving_s_ = moving ? moving_s_ + elapsed_s : 0.0;
  const bool seen = moving_s_ > skip_after_rest_s;
  if (seen) {
    if (good_s_ == 0.0) good_since_ns_ = block_.begun_ns;
    good_s_ += elapsed_s;
    bin_ = bin_of(speed);
    weigh_channels();
    weigh_parameters(e, quiet_block_);
    since_quiet_s_ = quiet_block_ ? since_quiet_s_ + elapsed_s : 0.0;
  }
  // Between two slips nothing is seen, and nothing forgotten.
  const double worst = worst_evidence();
  // Where nothing can be judged yet, what begins is kept for its name.
  if (worst < suspicious_evidence && !is_stirred()) {
    forget_suspicion();
  } else {
    if (!suspicious_) {
      suspicious_ = true;
      collecting_ = true;
      suspicion_ = Sums{};
      since_onset_s_ = 0.0;
      onset_bin_ = bin_;
      verdict_.evidence = 0.0;
      suspicion_.begun_ns = e.time_ns - nanoseconds(elapsed_s);
    }
    since_onset_s_ += elapsed_s;
    onset_bin_ = std::max(onset_bin_, bin_);
    if (collecting_ && block_.frames > 0.0 && suspicion_.frames * period_s_ < signature_s) {
      const std::int64_t begun_ns = suspicion_.begun_ns;
      suspicion_.add(block_);
      suspicion_.begun_ns = begun_ns;
    }
  }
  if (verdict_.standing == ModelStanding::broken) {
    const bool well = worst <= 0.0 && since_quiet_s_ > recovery_s;
    if (!well) return false;
    verdict_.standing = ModelStanding::follows;
    return true;
  }
  if (worst >= threshold_) {
    verdict_.evidence = std::max(verdict_.evidence, worst);
    return judge(e.time_ns);
  }
  if (verdict_.standing == ModelStanding::learning && good_s_ > 2.0 * blocks_to_learn * block_s) {
    verdict_.standing = ModelStanding::follows;
    return true;
  }
  return false;
}

bool ModelCheck::is_stirred() const {
  if (block_.refused > stirred_share * block_.frames) return true;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (slow_gain_ * block_.square[i] > stirred_energy * block_.count[i]) return true;
  }
  return false;
}

// A filter begins anew where a parameter has moved too far for it: both say the same thing.
double ModelCheck::worst_evidence() const {
  double parameter = 0.0;
  for (const Watched& w : watched_) parameter = std::max(parameter, w.evidence);
  const double channel = *std::max_element(evidence_.begin(), evidence_.end());
  return std::max(channel, parameter + restart_evidence_);
}

// Page's cumulative sums.
void ModelCheck::weigh_channels() {
  quiet_block_ = true;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (block_.count[i] < 0.5 * block_.frames) continue;
    const double energy = slow_gain_ * block_.square[i] / block_.count[i];
    const double step = std::min(energy_evidence(energy / expected_energy(i)), most_per_block_);
    evidence_[i] = std::clamp(evidence_[i] + step, 0.0, 2.0 * threshold_);
    quiet_block_ = quiet_block_ && step < 0.0;
    if (step >= 0.0 || suspicious_) continue;
    Reference& known = reference(i);
    known.blocks = std::min(known.blocks + 1.0, blocks_remembered);
    known.mean += (energy - known.mean) / known.blocks;
    known.mean_square += (square(energy) - known.mean_square) / known.blocks;
  }
}

// One value in parameter_memory_s counts as one observation: estimates a block apart are the same
// news again.
void ModelCheck::weigh_parameters(const FrictionEstimate& e, bool quiet) {
  for (Watched& w : watched_) {
    if (!w.used) continue;
    const double deviation = e.standard_deviation(w.quantity);
    double value = w.quantity == Quantity::mu ? e.mu : e.gamma_per_s;
    if (w.quantity == Quantity::normal_load) {
      const double share = 1.0 + wedge_slope_ * e.displacement_m;
      value = share > 0.1 ? e.normal_load_n / share : 0.0;
    }
    const bool known = deviation > 0.0 && value > 0.0 && deviation < doubtful_parameter * value;
    if (known) {
      w.now = value;
      const bool learnt = w.blocks >= parameter_blocks_to_learn;
      const double tolerance = w.tolerance * w.reference;
      // What it wandered by counts, but not without bound: a filter may have begun far off.
      const double variance =
          square(tolerance) + square(2.0 * deviation) + std::min(w.spread, square(tolerance));
      const double squared = learnt ? square(value - w.reference) / variance : 0.0;
      const double step =
          std::min(parameter_evidence(squared) * block_s / parameter_memory_s, most_per_block_);
      if (learnt) w.evidence = std::clamp(w.evidence + step, 0.0, 2.0 * threshold_);
      if (quiet && w.evidence == 0.0) {
        w.blocks = std::min(w.blocks + 1.0, parameter_blocks_remembered);
        const double weight = learnt ? 1.0 / parameter_blocks_remembered : first_weight;
        w.reference += (w.blocks == 1.0 ? 1.0 : weight) * (value - w.reference);
        w.spread += weight * (square(value - w.reference) - w.spread);
      }
    }
  }
}

void ModelCheck::forget_suspicion() {
  suspicious_ = false;
  collecting_ = false;
  since_onset_s_ = 0.0;
}

// Something has changed. Is it still so, and what is it?
bool ModelCheck::judge(std::int64_t now_ns) {
  if (since_onset_s_ < persistence_s) return false;
  const bool loud = since_quiet_s_ < loud_memory_s || restart_evidence_ >= threshold_;
  const Watched* moved = nullptr;
  for (const Watched& w : watched_) {
    if (w.evidence + restart_evidence_ >= threshold_ && w.evidence > suspicious_evidence &&
        (moved == nullptr || w.evidence > moved->evidence)) {
      moved = &w;
    }
  }
  if (loud && moved != nullptr && since_onset_s_ < parameter_patience_s) return false;
  if (loud) return tell(now_ns, nullptr);
  if (moved != nullptr) return tell(now_ns, moved);
  if (since_onset_s_ > disturbance_s && bin_ + 1 >= onset_bin_) {
    // Somebody knocked at the rig: it is as it was before.
    evidence_.fill(0.0);
    restart_evidence_ = 0.0;
    forget_suspicion();
  }
  return false;
}

Signature ModelCheck::signature() const {
  const Sums& s = suspicion_;
  Signature out;
  out.frames = s.frames;
  if (s.frames == 0.0) return out;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (s.count[i] > 0.0) out.energy[i] = slow_gain_ * s.square[i] / s.count[i];
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

struct Name {
  Relation relation = Relation::friction_law;
  Relation alternative = Relation::friction_law;
  Channel channel = Channel::displacement;
  double probability = 0.0;
};

double logistic(double score) { return 1.0 / (1.0 + std::exp(-score)); }

// By whose innovations are disturbed, and how they hang together; docs/observer.md says why.
Name name_of_signature(const Signature& s) {
  const double motion = std::max({s.energy[x], s.energy[v], s.energy[f]});
  Name out;
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
  // Displacement and velocity contradict each other: their innovations go apart.
  const bool displacement_alone = ex - std::max(ev, ef) > 2.3 && ef < 2.3;
  const bool velocity_alone = ev - std::max(ex, ef) > 2.4;
  const bool apart = (s.displacement_velocity < -0.3 && ex > ef - 1.0) ||
                     (ex > ev - 1.0 && std::min(ex, ev) - ef > 2.5);
  if (displacement_alone || velocity_alone || apart) {
    out.relation = Relation::sensor;
    out.alternative = Relation::kinematics;
    out.channel = displacement_alone ? Channel::displacement : Channel::velocity;
    out.probability = 0.8;
    return out;
  }
  // The mass moves otherwise than spring and measured friction say, as its deflection has it.
  if (ev - ef > 0.8 && s.velocity_by_motion > 0.85) {
    out.relation = Relation::force_balance;
    out.alternative = Relation::friction_law;
    out.probability = logistic(1.0 + ev - ef - 0.8);
    return out;
  }
  // A loose cell rings, late or early: its innovations follow no rate of the reading.
  const double cell = 6.0 * (s.ringing - 0.2) + 5.0 * (s.force_rate + 0.35);
  // A friction law that is wrong moves the mass too, a force that is read wrongly does not.
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

std::string digits(double value) {
  std::string out = std::to_string(value);
  return out.substr(0, std::min(out.size(), out.find('.') + 4));
}

}  // namespace

bool ModelCheck::tell(std::int64_t now_ns, const Watched* moved) {
  ModelVerdict& out = verdict_;
  out.standing = ModelStanding::broken;
  out.since_ns = suspicion_.begun_ns;
  out.reported_ns = now_ns;
  out.from_ns = std::max(good_since_ns_, out.since_ns - nanoseconds(lead_s));
  out.to_ns = std::max(now_ns, out.since_ns + nanoseconds(tail_s));
  out.threshold = threshold_;
  out.parameter_was = 0.0;
  out.parameter_is = 0.0;
  ++out.alarms;
  const auto usual = [this](Quantity quantity) {
    for (const Watched& w : watched_) {
      if (w.quantity == quantity && w.used && w.blocks >= parameter_blocks_to_learn) {
        return w.reference;
      }
    }
    return 0.0;
  };
  out.usual_mu = usual(Quantity::mu);
  out.usual_gamma_per_s = usual(Quantity::gamma);
  out.usual_load_n = usual(Quantity::normal_load);
  if (moved != nullptr) {
    out.relation = moved->relation;
    out.alternative =
        moved->relation == Relation::friction_law ? Relation::normal_load : Relation::friction_law;
    out.channel = Channel::friction_force;
    out.parameter_was = moved->reference;
    out.parameter_is = moved->now;
    out.probability = 0.9;
    return true;
  }
  const Name name = name_of_signature(signature());
  out.relation = name.relation;
  out.alternative = name.alternative;
  out.channel = name.channel;
  out.probability = name.probability;
  return true;
}

std::string words_for(const ModelVerdict& verdict) {
  std::string out = "the rig no longer follows its model: ";
  out += name_of(verdict.relation);
  if (verdict.relation == Relation::sensor) {
    out += " (" + std::string(channel_table[index_of(verdict.channel)].stem) + ")";
  }
  out += ", probability " + digits(verdict.probability) + ", otherwise " +
         std::string(name_of(verdict.alternative));
  if (verdict.parameter_is > 0.0) {
    out += "; the estimate went from " + digits(verdict.parameter_was) + " to " +
           digits(verdict.parameter_is);
  }
  return out;
}

}  // namespace stickslip::observer
