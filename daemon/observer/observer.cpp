#include "daemon/observer/observer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "daemon/observer/covariance.h"
#include "daemon/observer/layout.h"
#include "daemon/observer/noise.h"
#include "daemon/observer/prediction.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::Model;
using physics::Rig;
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
  if (deviation <= 0.0) return std::abs(mean) < limit ? 1.0 : 0.0;
  const double scale = 1.0 / (deviation * std::numbers::sqrt2);
  return 0.5 * (std::erf((limit - mean) * scale) + std::erf((limit + mean) * scale));
}

// No bench comes near these; squares of what lies beyond would overflow.
bool is_possible(Channel channel, double value) {
  const bool force = channel == Channel::friction_force || channel == Channel::normal_load ||
                     channel == Channel::drive_force;
  return std::abs(value) < (force ? 1.0e9 : 1.0e4);  // false for NaN
}

constexpr std::array mechanical_channels = {Channel::displacement, Channel::velocity,
                                            Channel::friction_force};

}  // namespace

std::string_view words_for(Standing standing) {
  switch (standing) {
    case Standing::good:
      return "good";
    case Standing::waiting:
      return "waiting for a frame with displacement, velocity or friction force";
    case Standing::settling:
      return "settling: started less than the sensor chains' memory ago";
    case Standing::blind:
      return "blind: no channel of the mass or of the friction force for too long";
    case Standing::out_of_step:
      return "the frame's time did not advance";
    case Standing::unsupported:
      return "the observer cannot follow this model";
  }
  return "";
}

double FrictionEstimate::standard_deviation(Quantity quantity) const {
  for (std::size_t i = 0; i < used; ++i) {
    if (quantities[i] == quantity) return std::sqrt(std::max(0.0, covariance[i][i]));
  }
  return 0.0;
}

struct FrictionObserver::Filter {
  Filter(const Model& declared, double period)
      : model(without_jumps(declared)),
        rig(model),
        period_s(period),
        layout(layout_of(model, rig, unsupported)),
        steps(static_cast<int>(std::ceil(period / rig.longest_step_s() - 1.0e-9))),
        covariance(std::min(layout.count, max_states)) {
    if (unsupported.empty() && steps > most_steps) {
      unsupported = "the sampling period of " + std::to_string(period) + " s needs " +
                    std::to_string(steps) + " integration steps of this rig, the observer takes " +
                    std::to_string(most_steps) + " at most: sample faster";
    }
    if (!unsupported.empty()) {
      estimate.standing = Standing::unsupported;
      return;
    }
    prediction = prediction_for(rig, model, layout, period, steps);
    noise.emplace_back(model, rig, layout, prediction->numbers(), period);
    const physics::SensorBank bank(model, period / steps);
    settle_s = std::clamp(bank.settling_time_s(), 20.0 * period, 2.0);
    learn_s = 2.0 * settle_s;
    mean = Vector::Zero(layout.count);
    name_quantities();
  }

  void name_quantities();
  void begin(const Frame& frame);
  void predict();
  void correct(const Frame& frame);
  bool use_reading(Channel channel, double innovation, double reading_variance);
  bool is_healthy() const;
  void report(const Frame& frame);
  double base_acceleration_behind_its_chain() const;
  double slip_variance() const;
  double normal_load() const;

  // Declared before the layout, which says into it why there is none.
  std::string unsupported;
  Model model;
  Rig rig;
  double period_s;
  Layout layout;
  int steps;
  Covariance covariance;
  // Made only for a supported model; of the noise there is one.
  std::unique_ptr<Prediction> prediction;
  std::vector<Noise> noise;
  double settle_s = 0.0;
  double learn_s = 0.0;  ///< mu and gamma are learnt from then on

  Vector mean;
  Covariance::States gain, column;
  std::array<int, quantity_count> source{};  ///< of reported quantities

  bool started = false;
  std::int64_t origin_ns = 0;  ///< time 0 of the model
  bool has_origin = false;
  std::int64_t time_ns = 0;
  double since_start_s = 0.0;
  double since_sight_s = 0.0;
  double nis_level = 1.0;
  double since_drive_s = 1.0e9;
  double lesson = 1.0;  ///< share of the gain on mu
  double absurd_s = 0.0;
  std::array<int, channel_count> outliers_in_a_row{};
  FrictionEstimate estimate;
};

// The parts of the covariance that go out, and where they stand in the filter.
void FrictionObserver::Filter::name_quantities() {
  const auto name = [this](Quantity quantity, int index) {
    if (index < 0) return;
    estimate.quantities[estimate.used] = quantity;
    source[estimate.used] = index;
    ++estimate.used;
  };
  name(Quantity::displacement, layout.rig[state::x]);
  name(Quantity::velocity, layout.rig[state::v]);
  name(Quantity::load_cell_deflection, layout.rig[state::y]);
  name(Quantity::load_cell_velocity, layout.rig[state::u]);
  name(Quantity::theta, layout.theta);
  name(Quantity::mu, layout.mu);
  name(Quantity::gamma, layout.log_rate);
  name(Quantity::normal_load, layout.load);
  name(Quantity::friction_force, layout.friction);
}

double FrictionObserver::Filter::slip_variance() const {
  const int v = layout.rig[state::v];
  const int u = layout.rig[state::u];
  if (u < 0) return covariance(v, v);
  return covariance(v, v) + covariance(u, u) - 2.0 * covariance(v, u);
}

double FrictionObserver::Filter::normal_load() const {
  const auto& structure = rig.structure();
  if (!structure.loaded) return 1.0;
  const auto& c = prediction->numbers().c;
  const double load = layout.load >= 0 ? mean[layout.load] : c.load;
  if (structure.load_law != physics::NormalLoadLaw::wedge) return std::max(0.0, load);
  return std::max(0.0, load * (1.0 + c.load_slope * mean[layout.rig[state::x]]));
}

// Starts, or starts anew, from what this frame says by itself.
void FrictionObserver::Filter::begin(const Frame& frame) {
  const bool seen = std::any_of(mechanical_channels.begin(), mechanical_channels.end(),
                                [&](Channel c) { return frame.has(c) && layout.of(c).used; });
  if (!seen) {
    started = false;
    estimate.standing = Standing::waiting;
    return;
  }
  if (!has_origin) origin_ns = frame.time_ns;
  has_origin = true;
  // What a filter that is lost holds of mu may be no number.
  const bool keeps_mu = layout.mu >= 0 && started && std::isfinite(mean[layout.mu]);
  const double old_mu = keeps_mu ? mean[layout.mu] : 0.0;
  noise.front().start(frame, old_mu, mean, covariance);
  absurd_s = 0.0;
  started = true;
  since_start_s = 0.0;
  since_sight_s = 0.0;
  nis_level = 1.0;
  outliers_in_a_row.fill(0);
}

void FrictionObserver::Filter::predict() {
  const double time_s = static_cast<double>(time_ns - origin_ns) * 1.0e-9;
  const double doubt = slip_variance();
  noise.front().add_process(mean, doubt, since_start_s, covariance);
  prediction->advance(mean, time_s, doubt);
  covariance.propagate(prediction->transition());
  if (layout.friction >= 0) noise.front().add_output(mean, covariance);
}

bool FrictionObserver::Filter::use_reading(Channel channel, double innovation,
                                           double reading_variance) {
  const int j = layout.of(channel).reading;
  const double expected = covariance(j, j) + reading_variance;
  const std::size_t i = index_of(channel);
  const auto bit = static_cast<std::uint8_t>(1U << i);
  estimate.innovation[i] = innovation;
  estimate.innovation_std[i] = std::sqrt(expected);
  estimate.innovation_valid = static_cast<std::uint8_t>(estimate.innovation_valid | bit);
  const double squared = square(innovation) / expected;
  if (since_start_s > 2.0 * settle_s && squared > square(outlier_sigmas)) {
    estimate.refused = static_cast<std::uint8_t>(estimate.refused | bit);
    ++estimate.refusals;
    ++outliers_in_a_row[i];
    return false;
  }
  outliers_in_a_row[i] = 0;
  estimate.nis += squared;
  ++estimate.nis_freedom;

  covariance.column(j, column);
  for (int k = 0; k < layout.count; ++k) gain[k] = column[k] / expected;
  if (layout.mu >= 0) gain[layout.mu] *= lesson;
  if (layout.log_rate >= 0 && since_start_s < learn_s) gain[layout.log_rate] = 0.0;
  if (channel != drive_channel(rig.structure()) && since_drive_s < drive_trusted_s) {
    for (int k = 0; k < 4; ++k) gain[layout.drive + k] = 0.0;
    const Chain& chain = layout.of(drive_channel(rig.structure()));
    for (int k = 0; k < chain.count; ++k) gain[chain.first + k] = 0.0;
  }
  for (int k = 0; k < layout.count; ++k) mean[k] += gain[k] * innovation;
  covariance.correct(gain, column, expected);
  return true;
}

void FrictionObserver::Filter::correct(const Frame& frame) {
  bool seen = false;
  since_drive_s += period_s;
  if (layout.mu >= 0) {
    lesson = since_start_s < learn_s ? 0.0 : noise.front().lesson(mean, slip_variance());
  }
  for (Channel channel : all_channels) {
    if (!frame.has(channel) || !layout.of(channel).used) continue;
    const double variance = noise.front().reading_variance(channel);
    const double innovation = frame[channel] - mean[layout.of(channel).reading];
    const bool used = use_reading(channel, innovation, variance);
    const std::size_t i = index_of(channel);
    if (channel == drive_channel(rig.structure())) {
      since_drive_s = 0.0;
      noise.front().learn_drive(innovation / estimate.innovation_std[i]);
    }
    seen = seen || (used && std::find(mechanical_channels.begin(), mechanical_channels.end(),
                                      channel) != mechanical_channels.end());
  }
  since_sight_s = seen ? 0.0 : since_sight_s + period_s;
  if (estimate.nis_freedom > 0) {
    const double weight = std::min(1.0, period_s / nis_memory_s);
    nis_level += weight * (estimate.nis / estimate.nis_freedom - nis_level);
  }
}

bool FrictionObserver::Filter::is_healthy() const {
  double sum = 0.0;
  double least = 1.0;
  for (int i = 0; i < layout.count; ++i) {
    sum += 0.0 * mean[i] + 0.0 * covariance(i, i);
    least = std::min(least, covariance(i, i));
  }
  if (sum != 0.0 || std::isnan(sum) || least < -1.0e-18) return false;
  if (absurd_s > absurd_to_restart_s) return false;
  if (since_start_s > 2.0 * settle_s && nis_level > nis_to_restart) return false;
  const int most = std::max(5, static_cast<int>(outliers_to_restart_s / period_s));
  return std::none_of(outliers_in_a_row.begin(), outliers_in_a_row.end(),
                      [most](int count) { return count > most; });
}

// The second derivative of what the base sensor's chain delivers: as late as the reading of the
// load cell where both have the same filters, as on the paper's rig.
double FrictionObserver::Filter::base_acceleration_behind_its_chain() const {
  const Chain& chain = layout.of(Channel::base_displacement);
  if (chain.sections.empty() || !chain.sections.back().second_order) {
    return mean[layout.drive + 2];
  }
  const Section& last = chain.sections.back();
  double input = mean[layout.drive];
  if (chain.sections.size() > 1) {
    const Section& before = chain.sections[chain.sections.size() - 2];
    input = mean[chain.reading - (before.second_order ? 2 : 1)];
  }
  return square(last.omega) * (input - mean[chain.reading]) -
         last.damping * mean[chain.reading + 1];
}

void FrictionObserver::Filter::report(const Frame& frame) {
  const auto& structure = rig.structure();
  const auto& c = prediction->numbers().c;
  FrictionEstimate& e = estimate;
  e.displacement_m = mean[layout.rig[state::x]];
  e.velocity_m_s = mean[layout.rig[state::v]];
  const int u = layout.rig[state::u];
  e.slip_velocity_m_s = e.velocity_m_s - (u >= 0 ? mean[u] : 0.0);
  e.slip_velocity_std_m_s = std::sqrt(std::max(0.0, slip_variance()));
  e.normal_load_n = normal_load();
  if (structure.friction) {
    e.theta = mean[layout.theta];
    e.mu = mean[layout.mu];
    e.friction_force_n = mean[layout.friction];
    if (structure.kinetics == physics::Kinetics::relaxing) {
      e.gamma_per_s = layout.log_rate >= 0 ? std::exp(mean[layout.log_rate]) : c.rate;
    }
    e.sticking = probability_below(std::max(c.transition_speed, sticking_speed_m_s),
                                   e.slip_velocity_m_s, e.slip_velocity_std_m_s);
  }

  e.raw_valid = structure.friction && frame.has(Channel::friction_force);
  e.raw_friction_force_n = 0.0;
  e.raw_friction_over_load = 0.0;
  if (e.raw_valid) {
    e.raw_friction_force_n = frame[Channel::friction_force];
    if (structure.load_cell && structure.excitation == Excitation::base) {
      e.raw_friction_force_n += c.cell_mass * base_acceleration_behind_its_chain();
    }
    if (e.normal_load_n > 0.0) e.raw_friction_over_load = e.raw_friction_force_n / e.normal_load_n;
  }

  // ln gamma is estimated; its neighbours are told about gamma.
  std::array<double, quantity_count> scale{};
  for (std::size_t i = 0; i < e.used; ++i) {
    scale[i] = e.quantities[i] == Quantity::gamma ? e.gamma_per_s : 1.0;
  }
  for (std::size_t i = 0; i < e.used; ++i) {
    for (std::size_t j = 0; j < e.used; ++j) {
      e.covariance[i][j] = scale[i] * scale[j] * covariance(source[i], source[j]);
    }
  }

  if (since_start_s < settle_s) {
    e.standing = Standing::settling;
  } else if (since_sight_s > blind_after_s) {
    e.standing = Standing::blind;
  } else {
    e.standing = Standing::good;
  }
}

FrictionObserver::FrictionObserver(const physics::Model& model, double period_s) {
  if (!(period_s > 0.0) || !std::isfinite(period_s)) {
    throw std::invalid_argument("observer: the sampling period must be more than 0");
  }
  filter_ = std::make_unique<Filter>(model, period_s);
}

FrictionObserver::~FrictionObserver() = default;
FrictionObserver::FrictionObserver(FrictionObserver&&) noexcept = default;
FrictionObserver& FrictionObserver::operator=(FrictionObserver&&) noexcept = default;

const std::string& FrictionObserver::unsupported() const { return filter_->unsupported; }

const FrictionEstimate& FrictionObserver::latest() const { return filter_->estimate; }

const FrictionEstimate& FrictionObserver::update(const Frame& given) {
  Filter& f = *filter_;
  Frame frame = given;
  for (Channel channel : all_channels) {
    if (frame.has(channel) && !is_possible(channel, frame[channel])) frame.invalidate(channel);
  }
  FrictionEstimate& e = f.estimate;
  e.time_ns = frame.time_ns;
  e.sequence = frame.sequence;
  e.valid = false;
  if (!f.unsupported.empty()) return e;
  const auto nothing_learnt = [&e] {
    e.innovation.fill(0.0);
    e.innovation_std.fill(0.0);
    e.innovation_valid = 0;
    e.nis = 0.0;
    e.nis_freedom = 0;
  };
  nothing_learnt();
  e.refused = 0;
  e.raw_valid = false;

  f.noise.front().listen(frame);
  const double elapsed = static_cast<double>(frame.time_ns - f.time_ns) * 1.0e-9;
  const double periods = std::round(elapsed / f.period_s);
  if (!f.started || std::abs(periods) > longest_gap_periods) {
    f.begin(frame);
  } else if (periods < 1.0) {
    e.standing = Standing::out_of_step;
    return e;
  } else {
    for (int k = 0; k < static_cast<int>(periods); ++k) f.predict();
    f.since_start_s += elapsed;
  }
  f.time_ns = frame.time_ns;
  if (!f.started) return e;

  f.correct(frame);
  f.noise.front().confine(f.mean);
  f.absurd_s = f.noise.front().is_absurd(f.mean) ? f.absurd_s + f.period_s : 0.0;
  if (!f.is_healthy()) {
    ++e.restarts;
    nothing_learnt();  // a filter that is lost says nothing about the readings
    f.begin(frame);
    if (!f.started) return e;
  }
  f.report(frame);
  e.valid = e.standing == Standing::good;
  return e;
}

}  // namespace stickslip::observer
