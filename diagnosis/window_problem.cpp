// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/window_problem.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

using physics::BoundTerm;
using physics::Dual;
using physics::RigState;
namespace state = physics::state;

namespace {

// Mean square of the residuals, over the noise variance, above which a window is an outlier: its
// cost then grows only with the logarithm.
constexpr double outlier_mean_square = 10.0;
// Chi-squared of a window in which the model diverged.
constexpr double diverged_chi2 = 1.0e30;

double robust_loss(double chi2, int count) {
  const double limit = outlier_mean_square * std::max(1, count);
  return chi2 <= limit ? chi2 : limit * (1.0 + std::log(chi2 / limit));
}

std::vector<int> state_indices(const physics::Rig& rig) {
  std::vector<int> list;
  for (int i = 0; i < physics::max_rig_states; ++i) {
    if (rig.has_state(i)) list.push_back(i);
  }
  return list;
}

int most_drive_knots(std::span<const Experiment> experiments) {
  int most = 0;
  for (const Experiment& e : experiments) {
    if (e.drive_noise > 0.0) most = std::max(most, e.drive_knots);
  }
  return most;
}

// The guess at the window's first sample by a channel that is late: what it reads later.
StateGuess guess_by(const physics::ReadingLaw<double>& late, const Experiment& e,
                    const Window& window) {
  const auto first = static_cast<double>(window.warm);
  const double at =
      std::clamp(first + late.delay_s / e.period_s, 0.0, static_cast<double>(window.end - 1));
  const auto before = static_cast<std::size_t>(at);
  const double part = at - static_cast<double>(before);
  const StateGuess& a = e.guess[before];
  const StateGuess& b = e.guess[std::min(before + 1, e.guess.size() - 1)];
  const auto between = [&](double StateGuess::*quantity) {
    return std::lerp(a.*quantity, b.*quantity, part);
  };
  return {between(&StateGuess::displacement_m), between(&StateGuess::velocity_m_s),
          between(&StateGuess::load_cell_deflection_m),
          between(&StateGuess::load_cell_velocity_m_s), between(&StateGuess::friction_n)};
}

// The guesses are readings: under a hypothesis whose gauge has an offset, another gain or a delay
// the mass is elsewhere, and costs nothing there.
void set_mechanical_prior(StatePrior& prior, const Experiment& e, const StateGuess& by_gauge,
                          const StateGuess& by_cell, const physics::ReadingLaw<double>& gauge) {
  prior.centre[state::x] = (by_gauge.displacement_m - gauge.offset) / gauge.gain;
  prior.centre[state::v] = by_gauge.velocity_m_s / gauge.gain;
  prior.centre[state::y] = by_cell.load_cell_deflection_m;
  prior.centre[state::u] = by_cell.load_cell_velocity_m_s;
  const double x_scale = e.channel_std[index_of(Channel::displacement)];
  prior.sigma[state::x] = 0.05 * x_scale + 5.0 * e.noise_std[index_of(Channel::displacement)];
  prior.sigma[state::v] = 0.1 * e.largest.velocity_m_s + 1.0e-9;
  prior.sigma[state::y] = 0.3 * e.largest.load_cell_deflection_m + 1.0e-9;
  prior.sigma[state::u] = 0.5 * e.largest.load_cell_velocity_m_s + 1.0e-6;
}

void set_contact_prior(StatePrior& prior, const Experiment& e, double velocity_m_s,
                       double friction_n, const physics::Rig& rig,
                       const physics::RigNumbers<double>& n) {
  const double level = n.c.mu * (rig.structure().loaded ? e.mean_load_n : 1.0);
  const bool force_known = (e.compared >> index_of(Channel::friction_force)) & 1U;
  double theta = velocity_m_s > 0.0 ? 0.8 : -0.8;
  if (force_known && level > 0.0) theta = std::clamp(friction_n / level, -1.0, 1.0);
  if (rig.structure().kinetics == physics::Kinetics::ageing) {
    // The logarithm of the age: that of steady sliding, or somewhat older.
    const double speed = std::abs(velocity_m_s) + 0.01 * e.largest.velocity_m_s + 1.0e-9;
    prior.centre[state::contact] = std::log(std::max(n.c.reference_speed, 1.0e-12) / speed);
    prior.sigma[state::contact] = 2.0;
    return;
  }
  double unit = 1.0;
  if (rig.structure().kinetics == physics::Kinetics::bristle) {
    unit = level / std::max(n.c.contact_stiffness, 1.0e-12);
  }
  prior.centre[state::contact] = theta * unit;
  prior.sigma[state::contact] = (force_known ? 0.4 : 0.7) * unit;
  prior.hidden[state::contact] = 0.9 * unit;
}

void set_effect_prior(StatePrior& prior, const BoundTerm& term, std::span<const double> parameters,
                      const physics::Scales& scales) {
  const std::vector<double> p = values_of(term, parameters);
  for (int i = 0; i < term.effect->state_count(); ++i) {
    const auto next = static_cast<std::size_t>(term.first_state) + static_cast<std::size_t>(i);
    const physics::StateSize size = term.effect->state_size(i, p, scales);
    prior.sigma[next] = size.sigma;
    prior.hidden[next] = size.hidden;
    // The guess of the mass's motion contains what the gauge measures besides it.
    if ((term.hooks & physics::hook::measured_motion) == physics::hook::measured_motion && i < 2) {
      const auto seen = static_cast<std::size_t>(i == 0 ? state::x : state::v);
      prior.sigma[seen] = std::hypot(prior.sigma[seen], size.sigma);
    }
  }
}

}  // namespace

double robust_weight(double chi2, int count) {
  const double limit = outlier_mean_square * std::max(1, count);
  return chi2 <= limit ? 1.0 : limit / chi2;
}

StatePrior state_prior(const Experiment& e, const Window& window, const Hypothesis& hypothesis,
                       std::span<const double> parameters) {
  const auto& rig = hypothesis.rig();
  StatePrior prior;
  const auto n = rig.numbers<double>(parameters);
  const physics::ReadingLaw<double>& gauge = n.reading.of[index_of(Channel::displacement)];
  const StateGuess by_gauge = guess_by(gauge, e, window);
  const StateGuess by_cell = guess_by(n.reading.of[index_of(Channel::friction_force)], e, window);
  set_mechanical_prior(prior, e, by_gauge, by_cell, gauge);
  if (rig.has_state(state::contact)) {
    set_contact_prior(prior, e, by_gauge.velocity_m_s, by_cell.friction_n, rig, n);
  }
  physics::Scales scales;
  scales.displacement_m = e.largest.displacement_m;
  if (rig.structure().loaded) scales.mean_load_n = e.mean_load_n;
  for (const BoundTerm& term : rig.terms()) set_effect_prior(prior, term, parameters, scales);
  std::fill(prior.sigma.begin() + physics::max_rig_states, prior.sigma.end(), 1.0);
  return prior;
}

double NormalBlock::cost() const { return robust_loss(chi2, count) + prior; }

double NormalBlock::mean_square() const { return chi2 / std::max(1, count); }

WindowProblem::WindowProblem(const Task& task, const Hypothesis& hypothesis,
                             std::span<const double> z, bool parameters_free)
    : task_(task),
      hypothesis_(hypothesis),
      states_(state_indices(hypothesis.rig())),
      rig_states_(states_.size()),
      unknowns_(parameters_free ? hypothesis.unknowns().size() : 0) {
  for (int k = 0; k < most_drive_knots(task.experiments); ++k) {
    states_.push_back(physics::max_rig_states + k);
  }
  for (std::size_t i = 0; i < hypothesis.recordings(); ++i) columns_.push_back(columns_of(i));
  set_numbers(z);
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const Experiment& e = task.experiment(w);
    priors_.push_back(state_prior(e, task.window(w), hypothesis, parameters_[e.recording]));
  }
}

// An unknown of another recording has no column: a window costs no more than in a single recording.
WindowProblem::Columns WindowProblem::columns_of(std::size_t recording) const {
  Columns out;
  for (std::size_t u = 0; u < unknowns_; ++u) {
    if (!hypothesis_.acts(u, recording)) continue;
    const std::string& path =
        hypothesis_.rig().parameter_paths()[hypothesis_.unknowns()[u].parameter];
    const auto instrument = physics::instrument_parameter(path);
    if (instrument && index_of(instrument->channel) < predicted_channels &&
        hypothesis_.predicts(instrument->channel)) {
      out.instruments.push_back(
          {static_cast<Eigen::Index>(u), index_of(instrument->channel), instrument->quantity});
    } else {
      out.parameters.push_back(static_cast<Eigen::Index>(u));
    }
  }
  return out;
}

void WindowProblem::set_numbers(std::span<const double> z) {
  parameters_.clear();
  numbers_.clear();
  for (std::size_t i = 0; i < hypothesis_.recordings(); ++i) {
    parameters_.push_back(hypothesis_.parameters(z, i));
    numbers_.push_back(numbers_on_recording<double>(hypothesis_.rig(), parameters_.back()));
  }
  z_.assign(z.begin(), z.end());
  banks_.clear();
  coarse_banks_.clear();
  for (const Experiment& e : task_.experiments) {
    const auto bank = [&](Steps steps) {
      return sensor_bank(hypothesis_.model(), numbers_[e.recording].reading,
                         e.period_s / e.steps_per_sample(steps));
    };
    banks_.push_back(bank(task_.steps));
    coarse_banks_.push_back(bank(Steps::coarse));
    coarse_banks_.back().allow_changes();
  }
}

std::size_t WindowProblem::end_of(std::size_t w) const {
  const Window& window = task_.window(w);
  const auto length = static_cast<double>(window.end - window.begin);
  return window.begin +
         std::max<std::size_t>(4, static_cast<std::size_t>(std::lround(task_.share * length)));
}

WindowRun WindowProblem::run_of(std::size_t w, Steps steps) const {
  return {task_.experiment(w), task_.window(w), end_of(w), steps};
}

void WindowProblem::prepare(std::span<const double> z) {
  if (task_.stop.stop_requested()) throw Interrupted();
  set_numbers(z);
}

// Distance of a state from its prior's centre, in units of the prior.
double WindowProblem::state_offset(std::size_t w, int state, const WindowState& at) const {
  const StatePrior& prior = priors_[w];
  const auto i = static_cast<std::size_t>(state);
  return (at[i] - prior.centre[i]) / prior.sigma[i];
}

// Knots of the drive's error count as residuals: they are measured to be 0 within its noise.
void WindowProblem::add_priors(std::size_t w, const WindowState& at, NormalBlock& block) const {
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const double off = state_offset(w, states_[i], at);
    (i < rig_states_ ? block.prior : block.chi2) += off * off;
  }
}

namespace {

// Innovations of the residuals of a window, each channel in the order of its samples.
class WhitenedChannels {
 public:
  WhitenedChannels(const Experiment& e, const NoiseColours& colours) : e_(e) {
    for (std::size_t c = 0; c < predicted_channels; ++c) filter_[c] = Whitening(colours[c]);
  }
  double innovation(std::size_t sample, std::size_t c, double residual) {
    return filter_[c].next(e_.elapsed_s(sample)).innovation(residual, slow_[c]);
  }

 private:
  const Experiment& e_;
  std::array<Whitening, predicted_channels> filter_;
  std::array<double, predicted_channels> slow_{};
};

// The same of residuals in rows, and of their derivatives.
void whiten_rows(const Experiment& e, const Window& window, std::size_t end,
                 const NoiseColours& colours, WindowProblem::Jacobian& jacobian,
                 Eigen::VectorXd& residual) {
  for (std::size_t channel = 0; channel < predicted_channels; ++channel) {
    if (colours[channel].is_white()) continue;
    Whitening filter(colours[channel]);
    double slow = 0.0;
    Eigen::RowVectorXd slow_row = Eigen::RowVectorXd::Zero(jacobian.cols());
    Eigen::Index row = 0;
    for_each_compared(e, window.begin, end, [&](std::size_t k, std::size_t c) {
      const Eigen::Index at = row++;
      if (c != channel) return;
      const Whitening::Step step = filter.next(e.elapsed_s(k));
      residual[at] = step.innovation(residual[at], slow);
      const Eigen::RowVectorXd derivative = jacobian.row(at);
      jacobian.row(at) = step.innovation(derivative, slow_row);
    });
  }
}

}  // namespace

namespace {

// Calls sink(sample, channel, innovation) for every compared reading of a run, those of one channel
// in order.
template <class Sink>
void run_innovations(const WindowRun& run, const Task& task, const physics::Rig& rig,
                     const physics::SensorBank& bank, const physics::RigNumbers<double>& n,
                     const WindowState& from, Sink&& sink) {
  const Experiment& e = run.e;
  WhitenedChannels channels(e, task.colour);
  run_window(run, rig, bank, n, from, [&](std::size_t k, std::size_t c, double reading, double) {
    if (!e.is_compared(k, c)) return;
    const double residual = (reading - e.reading[k][c]) / task.sigma_of(e, c);
    sink(k, c, channels.innovation(k, c, residual));
  });
}

}  // namespace

NormalBlock WindowProblem::evaluate(std::size_t w, const WindowState& from) const {
  NormalBlock block;
  run_innovations(run_of(w, task_.steps), task_, hypothesis_.rig(),
                  banks_[task_.windows[w].experiment], numbers_[task_.experiment(w).recording],
                  from, [&](std::size_t, std::size_t, double innovation) {
                    block.chi2 += innovation * innovation;
                    ++block.count;
                  });
  add_priors(w, from, block);
  if (!std::isfinite(block.chi2)) block.chi2 = diverged_chi2;
  return block;
}

// Parameters, then states and knots. States move in units of their prior, so that all columns are
// of like size.
Directions WindowProblem::directions(std::size_t w) const {
  Directions out;
  const std::size_t recording = task_.experiment(w).recording;
  for (const Eigen::Index column : columns_[recording].parameters) {
    const auto u = static_cast<std::size_t>(column);
    out.parameters.push_back(
        {hypothesis_.unknowns()[u].parameter, hypothesis_.slope(u, z_, recording)});
  }
  for (std::size_t i = 0; i < rig_states_; ++i) {
    const auto index = static_cast<std::size_t>(states_[i]);
    out.states.push_back({index, priors_[w].sigma[index]});
  }
  out.knots = states_.size() - rig_states_;
  return out;
}

namespace {

// Row of each reading of a window in its residuals, sample by sample; -1: not compared.
class Rows {
 public:
  Rows(const Experiment& e, std::size_t begin, std::size_t end) : begin_(begin) {
    row_.resize(end - begin);
    for (auto& each : row_) each.fill(-1);
    for_each_compared(e, begin, end,
                      [&](std::size_t k, std::size_t c) { row_[k - begin][c] = count_++; });
  }
  Eigen::Index of(std::size_t k, std::size_t c) const { return row_[k - begin_][c]; }
  Eigen::Index count() const { return count_; }

 private:
  std::size_t begin_;
  Eigen::Index count_ = 0;
  std::vector<std::array<Eigen::Index, predicted_channels>> row_;
};

}  // namespace

// Gain, offset and delay of a channel move its readings in known ways: no integration with
// derivatives is needed for them.
void WindowProblem::differentiate_instruments(const Experiment& e, std::size_t c, double reading,
                                              double rate, Eigen::Index row,
                                              Jacobian& jacobian) const {
  const physics::ReadingLaw<double>& law = numbers_[e.recording].reading.of[c];
  for (const InstrumentColumn& each : columns_[e.recording].instruments) {
    if (each.channel != c) continue;
    const double by_parameter = each.quantity == physics::InstrumentQuantity::gain
                                    ? (reading - law.offset) / law.gain
                                : each.quantity == physics::InstrumentQuantity::offset ? 1.0
                                                                                       : -rate;
    const auto u = static_cast<std::size_t>(each.column);
    jacobian(row, each.column) =
        by_parameter * hypothesis_.slope(u, z_, e.recording) / task_.sigma_of(e, c);
  }
}

// Steps are as long as derivatives allow; the residuals are those of the task's own steps, which
// are run by themselves only where they are others.
WindowProblem::Derivatives WindowProblem::differentiate(std::size_t w,
                                                        const WindowState& from) const {
  const auto columns = static_cast<Eigen::Index>(unknowns_ + states_.size());
  const Experiment& e = task_.experiment(w);
  const auto& parameter_columns = columns_[e.recording].parameters;
  const auto parameters = static_cast<Eigen::Index>(parameter_columns.size());
  const WindowRun coarse = run_of(w, Steps::coarse);
  const Rows rows(e, coarse.window.begin, coarse.end);
  Derivatives out;
  out.jacobian.setZero(rows.count(), columns);
  out.residual.setZero(rows.count());
  const Directions all = directions(w);
  const auto column_of = [&](Eigen::Index direction) {
    return direction < parameters ? parameter_columns[static_cast<std::size_t>(direction)]
                                  : static_cast<Eigen::Index>(unknowns_) + direction - parameters;
  };
  const auto take_reading = [&](std::size_t k, std::size_t c, double reading, double rate) {
    const Eigen::Index row = rows.of(k, c);
    if (row < 0) return;
    out.residual[row] = (reading - e.reading[k][c]) / task_.sigma_of(e, c);
    differentiate_instruments(e, c, reading, rate, row, out.jacobian);
  };
  const WindowRun own = run_of(w, task_.steps);
  const bool same_steps = own.stride() == coarse.stride();
  const auto take = [&](std::size_t block, std::size_t k, std::size_t c, const Dual& reading,
                        double rate) {
    const Eigen::Index row = rows.of(k, c);
    if (row < 0) return;
    const double scale = 1.0 / task_.sigma_of(e, c);
    const auto first = static_cast<Eigen::Index>(block) * Dual::directions;
    const auto some =
        std::min<Eigen::Index>(Dual::directions, static_cast<Eigen::Index>(all.size()) - first);
    for (Eigen::Index j = 0; j < some; ++j) {
      out.jacobian(row, column_of(first + j)) = reading.d[j] * scale;
    }
    if (block == 0 && same_steps) take_reading(k, c, reading.a, rate);
  };
  const std::size_t experiment = task_.windows[w].experiment;
  run_window_derived(coarse, hypothesis_.rig(), coarse_banks_[experiment], parameters_[e.recording],
                     all, from, take);
  if (!same_steps) {
    run_window(own, hypothesis_.rig(), banks_[experiment], numbers_[e.recording], from,
               take_reading);
  }
  whiten_rows(e, coarse.window, coarse.end, task_.colour, out.jacobian, out.residual);
  return out;
}

Eigen::VectorXd WindowProblem::residual(std::size_t w, const WindowState& from) const {
  const WindowRun run = run_of(w, task_.steps);
  const Rows rows(run.e, run.window.begin, run.end);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rows.count());
  run_innovations(
      run, task_, hypothesis_.rig(), banks_[task_.windows[w].experiment], numbers_[run.e.recording],
      from,
      [&](std::size_t k, std::size_t c, double innovation) { out[rows.of(k, c)] = innovation; });
  return out;
}

Eigen::VectorXd WindowProblem::offsets(std::size_t w, const WindowState& from) const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(states_.size()));
  for (std::size_t i = 0; i < states_.size(); ++i) {
    out[static_cast<Eigen::Index>(i)] = state_offset(w, states_[i], from);
  }
  return out;
}

// Block of a window in which the model diverged: it carries no information.
NormalBlock WindowProblem::diverged(int count) const {
  const auto np = static_cast<Eigen::Index>(unknowns_);
  const auto ns = static_cast<Eigen::Index>(states_.size());
  NormalBlock block;
  block.count = count;
  block.chi2 = diverged_chi2;
  block.pp.setZero(np, np);
  block.ps.setZero(np, ns);
  block.ss.setIdentity(ns, ns);
  block.gp.setZero(np);
  block.gs.setZero(ns);
  return block;
}

NormalBlock WindowProblem::linearise(std::size_t w, const WindowState& from) const {
  const auto np = static_cast<Eigen::Index>(unknowns_);
  const auto ns = static_cast<Eigen::Index>(states_.size());
  const Derivatives derivatives = differentiate(w, from);
  const Jacobian& j = derivatives.jacobian;
  const Eigen::VectorXd& r = derivatives.residual;
  const Eigen::Index used = r.size();
  NormalBlock block;
  block.count = static_cast<int>(used);
  block.chi2 = r.squaredNorm();
  if (!std::isfinite(block.chi2) || !j.allFinite()) return diverged(block.count);
  add_priors(w, from, block);
  Eigen::MatrixXd jtj = j.transpose() * j;
  Eigen::VectorXd jtr = j.transpose() * r;
  const double weight = robust_weight(block.chi2, block.count);
  jtj *= weight;
  jtr *= weight;
  block.pp = jtj.topLeftCorner(np, np);
  block.ps = jtj.topRightCorner(np, ns);
  block.ss = jtj.bottomRightCorner(ns, ns);
  block.gp = jtr.head(np);
  block.gs = jtr.tail(ns);
  for (Eigen::Index i = 0; i < ns; ++i) {
    const double off = state_offset(w, states_[static_cast<std::size_t>(i)], from);
    const double prior_weight = static_cast<std::size_t>(i) < rig_states_ ? 1.0 : weight;
    block.ss(i, i) += prior_weight;
    block.gs[i] += prior_weight * off;
  }
  return block;
}

WindowState WindowProblem::moved(std::size_t w, const WindowState& from,
                                 const Eigen::VectorXd& step) const {
  const StatePrior& prior = priors_[w];
  WindowState to = from;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const auto index = static_cast<std::size_t>(states_[i]);
    to[index] += prior.sigma[index] * step[static_cast<Eigen::Index>(i)];
  }
  if (hypothesis_.rig().has_state(state::contact) &&
      hypothesis_.rig().structure().kinetics == physics::Kinetics::relaxing) {
    to[state::contact] = std::clamp(to[state::contact], -2.0, 2.0);
  }
  return to;
}

std::vector<WindowState> WindowProblem::alternative_starts(std::size_t w) const {
  const StatePrior& prior = priors_[w];
  std::vector<WindowState> starts;
  for (const int index : states_) {
    const auto i = static_cast<std::size_t>(index);
    if (!(prior.hidden[i] > 0.0)) continue;
    for (const double sign : {1.0, -1.0}) {
      starts.push_back(prior.centre);
      starts.back()[i] = sign * prior.hidden[i];
    }
  }
  return starts;
}

bool WindowProblem::follows_on(std::size_t w) const {
  return task_.windows[w - 1].experiment == task_.windows[w].experiment &&
         task_.window(w - 1).end == task_.window(w).begin &&
         task_.window(w - 1).warm <= task_.window(w).warm;
}

WindowState WindowProblem::propagated(std::size_t w, const WindowState& from) const {
  const Experiment& e = task_.experiment(w);
  const physics::Rig& rig = hypothesis_.rig();
  const WindowRun run = run_of(w - 1, task_.steps);
  const double h = run.step_s();
  const auto& numbers = numbers_[e.recording];
  const CorrectedInput<double> input(run, numbers, rig.structure().excitation);
  RigState<double> s;
  std::copy_n(from.begin(), s.s.size(), s.s.begin());
  double time_s = e.elapsed_s(run.window.warm);
  std::size_t at = run.first_input();
  const std::size_t last = run_of(w, task_.steps).first_input();
  rig.complete(s, input.at(at), time_s, numbers);
  for (; at < last; at += run.stride(), time_s += h) {
    rig.step(s, input.at(at), input.at(at + run.stride()), time_s, h, numbers);
  }
  WindowState reached{};
  std::copy(s.s.begin(), s.s.end(), reached.begin());
  return reached;
}

double WindowProblem::parameter_prior(std::span<const double> z) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < unknowns_; ++i) {
    const Unknown& unknown = hypothesis_.unknowns()[i];
    if (unknown.prior_sigma > 0.0) sum += std::pow(z[i] / unknown.prior_sigma, 2);
  }
  return sum;
}

}  // namespace stickslip::diagnosis
