#include "diagnosis/shooting.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

#include "diagnosis/median.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/effects/catalogue.h"
#include "physics/reading.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

namespace {

using parallel::for_each;
using physics::Dual;
using physics::max_rig_states;
using physics::RigNumbers;
using physics::RigState;
using physics::SensorBank;
using physics::SensorMemory;
namespace state = physics::state;

std::vector<int> state_indices(const physics::Rig& rig) {
  std::vector<int> list;
  for (int i = 0; i < max_rig_states; ++i) {
    if (rig.has_state(i)) list.push_back(i);
  }
  return list;
}

// A prior on a window's state, wide enough to leave the say to the data wherever the data can tell.
struct StatePrior {
  WindowState centre{};
  WindowState sigma{};
  WindowState hidden{};  // a typical size of each state that no channel shows, else 0
};

StatePrior prior_of(const Experiment& e, const Window& window, const Hypothesis& hypothesis,
                    std::span<const double> parameters) {
  const StateGuess& guess = e.guess[window.warm];
  const auto& rig = hypothesis.rig();
  StatePrior prior;
  prior.centre[state::x] = guess.displacement_m;
  prior.centre[state::v] = guess.velocity_m_s;
  prior.centre[state::y] = guess.load_cell_deflection_m;
  prior.centre[state::u] = guess.load_cell_velocity_m_s;
  const double x_scale = e.channel_std[index_of(Channel::displacement)];
  prior.sigma[state::x] = 0.05 * x_scale + 5.0 * e.noise_std[index_of(Channel::displacement)];
  prior.sigma[state::v] = 0.1 * e.largest.velocity_m_s + 1.0e-9;
  prior.sigma[state::y] = 0.3 * e.largest.load_cell_deflection_m + 1.0e-9;
  prior.sigma[state::u] = 0.5 * e.largest.load_cell_velocity_m_s + 1.0e-6;
  if (rig.has_state(state::contact)) {
    const auto n = rig.numbers<double>(parameters);
    const double level = n.c.mu * (rig.structure().loaded ? e.mean_load_n : 1.0);
    const bool force_known = (e.compared >> index_of(Channel::friction_force)) & 1U;
    double theta = guess.velocity_m_s > 0.0 ? 0.8 : -0.8;
    if (force_known && level > 0.0) theta = std::clamp(guess.friction_n / level, -1.0, 1.0);
    double unit = 1.0;
    if (rig.structure().kinetics == physics::Kinetics::bristle) {
      unit = level / std::max(n.c.contact_stiffness, 1.0e-12);
    }
    prior.centre[state::contact] = theta * unit;
    prior.sigma[state::contact] = (force_known ? 0.4 : 0.7) * unit;
    prior.hidden[state::contact] = 0.9 * unit;
  }
  const auto& paths = rig.parameter_paths();
  physics::Scales scales;
  scales.displacement_m = e.largest.displacement_m;
  int next = state::first_effect;
  for (const physics::Term& term : hypothesis.model().terms) {
    const physics::Effect& effect = *physics::find_effect(term.id);
    std::vector<double> p;
    for (const physics::ParameterCard& card : effect.card().parameters) {
      const auto at = std::find(paths.begin(), paths.end(),
                                physics::path_of(term) + "." + std::string(card.name));
      p.push_back(at == paths.end() ? card.fixed_default.value_or(0.0)
                                    : parameters[static_cast<std::size_t>(at - paths.begin())]);
    }
    for (int i = 0; i < effect.state_count(); ++i, ++next) {
      const physics::StateSize size = effect.state_size(i, p, scales);
      prior.sigma[static_cast<std::size_t>(next)] = size.sigma;
      prior.hidden[static_cast<std::size_t>(next)] = size.hidden;
      // What the gauge sees beside the mass is in the guess of where the mass is.
      if ((effect.hooks() & physics::hook::seen) == physics::hook::seen && i < 2) {
        const auto seen = static_cast<std::size_t>(i == 0 ? state::x : state::v);
        prior.sigma[seen] = std::hypot(prior.sigma[seen], size.sigma);
      }
    }
  }
  return prior;
}

// What the knots of a window add to the base's acceleration.
class BaseKnots {
 public:
  // Each knot moves its own direction by `height`.
  BaseKnots(const Experiment& e, const Window& window, double height)
      : height_(height),
        per_s_((base_knots - 1) / (static_cast<double>(window.end - window.warm) * e.period_s)) {}
  Dual at(double since_warm_s) const {
    static_assert(base_knots <= Dual::directions);
    const double position = std::min(since_warm_s * per_s_, base_knots - 1.000001);
    const auto left = static_cast<Eigen::Index>(position);
    const double share = position - static_cast<double>(left);
    Dual sum;
    sum.d[left] = Dual::slope(height_ * (1.0 - share));
    sum.d[left + 1] = Dual::slope(height_ * share);
    return sum;
  }

 private:
  double height_;
  double per_s_;
};

struct NoKnots {
  double at(double /*since_warm_s*/) const { return 0.0; }
};

// The inputs of a window as they acted, where their own channel may have recorded them late.
template <class T>
class LateInput {
 public:
  LateInput(const std::vector<physics::Input>& recorded, const RigNumbers<T>& n,
            physics::Excitation excitation, double step_s)
      : recorded_(recorded),
        of_force_(excitation == physics::Excitation::force),
        is_late_(n.reading.late),
        steps_(physics::value_of(n.input_lead_s) / step_s) {
    // Between the values the input is a straight line: derivatives by the lead are its slope.
    per_step_ =
        n.input_share * (n.input_lead_s - physics::value_of(n.input_lead_s)) * (1.0 / step_s);
  }
  physics::Input at(std::size_t step) const {
    if (!is_late_ || steps_ == 0.0) return recorded_[step];
    const double last = static_cast<double>(recorded_.size() - 1);
    const double there = std::clamp(static_cast<double>(step) + steps_, 0.0, last);
    const auto before = std::min(static_cast<std::size_t>(there), recorded_.size() - 2);
    return physics::between(recorded_[before], recorded_[before + 1],
                            there - static_cast<double>(before));
  }
  // What the input's derivative by its lead adds from `now` to `next`.
  T beside(const physics::Input& now, const physics::Input& next) const {
    if (!is_late_) return T(0.0);
    return per_step_ * (of_force_ ? next.drive_force_n - now.drive_force_n
                                  : next.base_acceleration_m_s2 - now.base_acceleration_m_s2);
  }

 private:
  const std::vector<physics::Input>& recorded_;
  bool of_force_;
  bool is_late_;
  double steps_;
  T per_step_{0.0};
};

template <class T, class Sink, class Knots = NoKnots>
void run_window(const Experiment& e, const Window& window, std::size_t end, const physics::Rig& rig,
                const SensorBank& bank, const RigNumbers<T>& n, RigState<T> s, Sink&& sink,
                const Knots& knots = {}) {
  const bool wrong = n.reading.wrong;
  std::optional<physics::ReadingFaults<T>> faults;
  physics::FaultMemory<T> fault_memory;
  const double h = e.period_s / e.substeps;
  const auto substeps = static_cast<std::size_t>(e.substeps);
  SensorMemory<T> memory;
  std::size_t at = window.warm * substeps;
  const double start_time = e.period_s * static_cast<double>(window.warm);
  const LateInput<T> late(e.input, n, rig.structure().excitation, h);
  physics::Input now = late.at(at);
  rig.complete(s, now, start_time, n);
  bank.settle(memory, rig.quantities(s, now, n));
  if (wrong) {
    faults.emplace(n.reading, bank, h);
    faults->settle(fault_memory, memory);
  }
  for (std::size_t k = window.warm; k < end; ++k) {
    if (k >= window.begin) {
      sink(k, wrong ? faults->readings(fault_memory, memory, e.period_s * static_cast<double>(k))
                    : bank.readings(memory));
    }
    if (k + 1 == end) break;
    for (std::size_t j = 0; j < substeps; ++j, ++at) {
      const double time = start_time + static_cast<double>(at - window.warm * substeps) * h;
      const physics::Input next = late.at(at + 1);
      s.unrecorded = late.beside(now, next) + knots.at(time - start_time + 0.5 * h);
      rig.step(s, now, next, time, h, n);
      now = next;
      bank.advance(memory, rig.quantities(s, now, n));
      if (wrong) faults->advance(fault_memory, memory);
    }
  }
}

// The numbers of a rig whose inputs are a recording's: read with the gain and the delay of their
// channel.
template <class T>
RigNumbers<T> numbers_on_recording(const physics::Rig& rig, std::span<const T> parameters) {
  RigNumbers<T> n = rig.numbers<T>(parameters);
  const Channel driving = rig.structure().excitation == physics::Excitation::force
                              ? Channel::drive_force
                              : Channel::base_displacement;
  const T& gain = n.reading.of[index_of(driving)].gain;
  if (physics::value_of(gain) != 1.0 || n.reading.wrong) n.input_share = 1.0 / gain;
  n.input_lead_s = n.reading.of[index_of(driving)].delay_s;
  return n;
}

template <class T>
std::array<T, predicted_channels> as_array(const physics::Readings<T>& r) {
  return {r.displacement, r.velocity, r.friction_force, r.normal_load};
}

// One window's part of the normal equations.
struct Block {
  Eigen::MatrixXd pp;  // parameters x parameters
  Eigen::MatrixXd ps;  // parameters x states
  Eigen::MatrixXd ss;  // states x states
  Eigen::VectorXd gp;
  Eigen::VectorXd gs;
  double chi2 = 0.0;
  int count = 0;
  double prior = 0.0;
};

// A window whose chi-squared is beyond ten times what noise explains counts with its logarithm.
double capped(double chi2, int count) {
  const double limit = 10.0 * std::max(1, count);
  return chi2 <= limit ? chi2 : limit * (1.0 + std::log(chi2 / limit));
}
double cap_weight(double chi2, int count) {
  const double limit = 10.0 * std::max(1, count);
  return chi2 <= limit ? 1.0 : limit / chi2;
}

class Problem {
 public:
  // The state priors are those of the parameters at the start, and stay.
  Problem(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
          bool parameters_free)
      : task_(task),
        hypothesis_(hypothesis),
        states_(state_indices(hypothesis.rig())),
        unknowns_(parameters_free ? hypothesis.unknowns().size() : 0) {
    for (const Experiment& e : task.experiments) {
      banks_.emplace_back(hypothesis.model(), e.period_s / e.substeps);
    }
    const auto parameters = hypothesis.parameters(z);
    for (std::size_t w = 0; w < task.windows.size(); ++w) {
      priors_.push_back(prior_of(experiment(w), window(w), hypothesis, parameters));
    }
    if (!task.base_response.empty()) {
      coloured_.resize(task.windows.size());
      for_each(task.windows.size(), task.threads, [&](std::size_t w) { colour(w); });
    }
  }

  std::size_t unknowns() const { return unknowns_; }
  const std::vector<int>& states() const { return states_; }

  const Window& window(std::size_t w) const {
    const WindowRef ref = task_.windows[w];
    return task_.experiments[ref.experiment].windows[ref.window];
  }
  const Experiment& experiment(std::size_t w) const {
    return task_.experiments[task_.windows[w].experiment];
  }
  std::size_t end_of(std::size_t w) const {
    const Window& each = window(w);
    const auto length = static_cast<double>(each.end - each.begin);
    return each.begin +
           std::max<std::size_t>(4, static_cast<std::size_t>(std::lround(task_.share * length)));
  }

  void prepare(std::span<const double> z) {
    parameters_ = hypothesis_.parameters(z);
    numbers_ = numbers_on_recording<double>(hypothesis_.rig(), parameters_);
    z_.assign(z.begin(), z.end());
  }

  // Chi-squared and residual count of one window, and its state prior.
  Block evaluate(std::size_t w, const WindowState& from) const {
    Block block;
    Eigen::Matrix<double, base_knots, 1> seen = Eigen::Matrix<double, base_knots, 1>::Zero();
    const bool coloured = !coloured_.empty();
    RigState<double> s;
    s.s = from;
    const Experiment& e = experiment(w);
    run_window<double>(e, window(w), end_of(w), hypothesis_.rig(),
                       banks_[task_.windows[w].experiment], numbers_, s,
                       [&](std::size_t k, const physics::Readings<double>& readings) {
                         const auto r = as_array(readings);
                         for (std::size_t c = 0; c < predicted_channels; ++c) {
                           if (((e.valid[k] >> c) & 1U) == 0) continue;
                           const double residual = (r[c] - e.reading[k][c]) / task_.sigma[c];
                           block.chi2 += residual * residual;
                           if (coloured) {
                             seen += coloured_[w].response.row(block.count).transpose() * residual;
                           }
                           ++block.count;
                         }
                       });
    if (coloured) block.chi2 -= coloured_[w].factor.matrixL().solve(seen).squaredNorm();
    if (!std::isfinite(block.chi2)) block.chi2 = 1.0e30;
    const StatePrior& prior = priors_[w];
    for (const int index : states_) {
      const auto i = static_cast<std::size_t>(index);
      const double off = (from[i] - prior.centre[i]) / prior.sigma[i];
      block.prior += off * off;
    }
    return block;
  }

  // Scaled residuals of a window and how they change with each unknown (first) and each state (in
  // units of its prior). More of these than a Dual has directions take several passes.
  struct Derivatives {
    Eigen::MatrixXd jacobian;
    Eigen::VectorXd residual;
  };
  Derivatives differentiate(std::size_t w, const WindowState& from) const {
    const auto np = static_cast<Eigen::Index>(unknowns_);
    const auto columns = np + static_cast<Eigen::Index>(states_.size());
    const Experiment& e = experiment(w);
    const std::size_t end = end_of(w);
    const StatePrior& prior = priors_[w];
    const auto rows = static_cast<Eigen::Index>((end - window(w).begin) * predicted_channels);
    Derivatives out;
    out.jacobian.setZero(rows, columns);
    out.residual.setZero(rows);
    Eigen::Index used = 0;
    for (Eigen::Index first = 0; first < std::max<Eigen::Index>(columns, 1);
         first += Dual::directions) {
      std::vector<Dual> parameters(parameters_.begin(), parameters_.end());
      RigState<Dual> s;
      for (std::size_t i = 0; i < s.s.size(); ++i) s.s[i] = Dual(from[i]);
      for (Eigen::Index j = first; j < std::min(columns, first + Dual::directions); ++j) {
        if (j < np) {
          const auto u = static_cast<std::size_t>(j);
          parameters[hypothesis_.unknowns()[u].parameter].d[j - first] =
              Dual::slope(hypothesis_.slope(u, z_[u]));
        } else {
          // States move in units of their prior, so that all columns are of like size.
          const auto i = static_cast<std::size_t>(states_[static_cast<std::size_t>(j - np)]);
          s.s[i].d[j - first] = Dual::slope(prior.sigma[i]);
        }
      }
      const auto n = numbers_on_recording<Dual>(hypothesis_.rig(), parameters);
      Eigen::Index row = 0;
      run_window<Dual>(e, window(w), end, hypothesis_.rig(), banks_[task_.windows[w].experiment], n,
                       s, [&](std::size_t k, const physics::Readings<Dual>& readings) {
                         const auto r = as_array(readings);
                         for (std::size_t c = 0; c < predicted_channels; ++c) {
                           if (((e.valid[k] >> c) & 1U) == 0) continue;
                           const double scale = 1.0 / task_.sigma[c];
                           out.residual[row] = (r[c].a - e.reading[k][c]) * scale;
                           const Eigen::Index some =
                               std::min<Eigen::Index>(Dual::directions, columns - first);
                           for (Eigen::Index j = 0; j < some; ++j) {
                             out.jacobian(row, first + j) = r[c].d[j] * scale;
                           }
                           ++row;
                         }
                       });
      used = row;
    }
    out.jacobian.conservativeResize(used, columns);
    out.residual.conservativeResize(used);
    return out;
  }

  // One window's part of the normal equations.
  Block linearise(std::size_t w, const WindowState& from) const {
    const auto np = static_cast<Eigen::Index>(unknowns_);
    const auto ns = static_cast<Eigen::Index>(states_.size());
    const StatePrior& prior = priors_[w];
    const Derivatives derivatives = differentiate(w, from);
    const Eigen::MatrixXd& j = derivatives.jacobian;
    const Eigen::VectorXd& r = derivatives.residual;
    const Eigen::Index used = r.size();
    Block block;
    block.count = static_cast<int>(used);
    block.chi2 = r.squaredNorm();
    if (!std::isfinite(block.chi2) || !j.allFinite()) {
      // The model blew up in this window: it says nothing about where to go.
      block.chi2 = 1.0e30;
      block.pp.setZero(np, np);
      block.ps.setZero(np, ns);
      block.ss.setIdentity(ns, ns);
      block.gp.setZero(np);
      block.gs.setZero(ns);
      return block;
    }
    Eigen::MatrixXd jtj = j.transpose() * j;
    Eigen::VectorXd jtr = j.transpose() * r;
    if (!coloured_.empty()) {
      // The inverse of 1 + G G', by Woodbury's formula.
      const Coloured& c = coloured_[w];
      const auto g = c.response.topRows(used);
      const Eigen::VectorXd gr = c.factor.matrixL().solve(g.transpose() * r);
      const Eigen::MatrixXd gj = c.factor.matrixL().solve(g.transpose() * j);
      block.chi2 -= gr.squaredNorm();
      jtj -= gj.transpose() * gj;
      jtr -= gj.transpose() * gr;
    }
    const double weight = cap_weight(block.chi2, block.count);
    jtj *= weight;
    jtr *= weight;
    block.pp = jtj.topLeftCorner(np, np);
    block.ps = jtj.topRightCorner(np, ns);
    block.ss = jtj.bottomRightCorner(ns, ns);
    block.gp = jtr.head(np);
    block.gs = jtr.tail(ns);
    for (Eigen::Index i = 0; i < ns; ++i) {
      const auto index = static_cast<std::size_t>(states_[static_cast<std::size_t>(i)]);
      const double off = (from[index] - prior.centre[index]) / prior.sigma[index];
      block.prior += off * off;
      block.ss(i, i) += 1.0;
      block.gs[i] += off;
    }
    return block;
  }

  // States in units of their prior.
  WindowState moved(std::size_t w, const WindowState& from, const Eigen::VectorXd& step) const {
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

  // Starts that differ from the first guess in one state that no channel shows.
  std::vector<WindowState> other_starts(std::size_t w) const {
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

  // Whether the window before this one in the task ends where this one begins.
  bool follows_on(std::size_t w) const {
    return task_.windows[w - 1].experiment == task_.windows[w].experiment &&
           window(w - 1).end == window(w).begin && window(w - 1).warm <= window(w).warm;
  }

  // Where the window before, which began at `from`, is when this one begins to settle.
  WindowState carried_on(std::size_t w, const WindowState& from) const {
    const Experiment& e = experiment(w);
    const physics::Rig& rig = hypothesis_.rig();
    const double h = e.period_s / e.substeps;
    const auto substeps = static_cast<std::size_t>(e.substeps);
    const LateInput<double> late(e.input, numbers_, rig.structure().excitation, h);
    RigState<double> s;
    s.s = from;
    const std::size_t first = window(w - 1).warm * substeps;
    rig.complete(s, late.at(first), e.period_s * static_cast<double>(window(w - 1).warm), numbers_);
    for (std::size_t at = first; at < window(w).warm * substeps; ++at) {
      rig.step(s, late.at(at), late.at(at + 1), h * static_cast<double>(at), h, numbers_);
    }
    return s.s;
  }

  // By how much a knot of the base's acceleration, one standard deviation high, changes the
  // readings of a window.
  BaseResponse base_response(std::size_t w, const WindowState& from) const {
    const Experiment& e = experiment(w);
    const Window& each = window(w);
    BaseResponse response(static_cast<Eigen::Index>((each.end - each.begin) * predicted_channels),
                          base_knots);
    const std::vector<Dual> parameters(parameters_.begin(), parameters_.end());
    RigState<Dual> s;
    for (std::size_t i = 0; i < s.s.size(); ++i) s.s[i] = Dual(from[i]);
    const auto n = numbers_on_recording<Dual>(hypothesis_.rig(), std::span<const Dual>(parameters));
    Eigen::Index row = 0;
    run_window<Dual>(
        e, each, each.end, hypothesis_.rig(), banks_[task_.windows[w].experiment], n, s,
        [&](std::size_t k, const physics::Readings<Dual>& readings) {
          const auto r = as_array(readings);
          for (std::size_t c = 0; c < predicted_channels; ++c) {
            if (((e.valid[k] >> c) & 1U) == 0) continue;
            response.row(row++) = r[c].d.head<base_knots>().cast<double>().transpose().matrix();
          }
        },
        BaseKnots(e, each, e.base_doubt_m_s2));
    response.conservativeResize(row, base_knots);
    if (!response.allFinite()) response.setZero();
    return response;
  }

  bool base_is_doubted() const { return !coloured_.empty(); }
  // What its knots do to the scaled residuals of a window.
  Eigen::MatrixXd scaled_base_response(std::size_t w) const {
    return coloured_[w].response.topRows(coloured_[w].rows);
  }

  double parameter_prior(std::span<const double> z) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < unknowns_; ++i) {
      const Unknown& unknown = hypothesis_.unknowns()[i];
      if (unknown.prior_sigma > 0.0) sum += std::pow(z[i] / unknown.prior_sigma, 2);
    }
    return sum;
  }

 private:
  // The noise of the base in one window, in units of the readings' noise.
  struct Coloured {
    BaseResponse response;
    Eigen::Index rows = 0;                                             // of it, scaled
    Eigen::LLT<Eigen::Matrix<double, base_knots, base_knots>> factor;  // of 1 + G' G
  };

  void colour(std::size_t w) {
    const Experiment& e = experiment(w);
    Coloured& out = coloured_[w];
    out.response = *task_.base_response[w];
    Eigen::Index row = 0;
    for (std::size_t k = window(w).begin; k < end_of(w); ++k) {
      for (std::size_t c = 0; c < predicted_channels; ++c) {
        if (((e.valid[k] >> c) & 1U) != 0) out.response.row(row++) /= task_.sigma[c];
      }
    }
    out.rows = row;
    const auto used = out.response.topRows(row);
    out.factor.compute(Eigen::Matrix<double, base_knots, base_knots>::Identity() +
                       used.transpose() * used);
  }

  const Task& task_;
  const Hypothesis& hypothesis_;
  std::vector<Coloured> coloured_;
  std::vector<int> states_;
  std::size_t unknowns_;
  std::vector<SensorBank> banks_;
  std::vector<StatePrior> priors_;
  std::vector<double> parameters_;
  std::vector<double> z_;
  RigNumbers<double> numbers_;
};

double cost_of(const Block& block) { return capped(block.chi2, block.count) + block.prior; }

double total_cost(const std::vector<Block>& blocks) {
  double cost = 0.0;
  for (const Block& block : blocks) cost += cost_of(block);
  return cost;
}

// The state of one window alone, the parameters as they are: each window has its own damping, so
// that one that cannot be followed holds up no other.
Block fit_state(const Problem& problem, std::size_t w, WindowState& state,
                const FitOptions& options) {
  Block block = problem.linearise(w, state);
  double cost = cost_of(block);
  double damping = 1.0e-3;
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    bool improved = false;
    double gain = 0.0;
    for (int attempt = 0; attempt < 8 && !improved; ++attempt) {
      Eigen::MatrixXd ss = block.ss;
      ss.diagonal() *= 1.0 + damping;
      const WindowState trial = problem.moved(w, state, -ss.ldlt().solve(block.gs));
      const Block there = problem.evaluate(w, trial);
      const double trial_cost = cost_of(there);
      if (trial_cost < cost) {
        gain = cost - trial_cost;
        improved = true;
        state = trial;
        cost = trial_cost;
        damping = std::max(1.0e-9, damping * 0.2);
      } else {
        damping *= 8.0;
      }
    }
    if (!improved) break;
    block = problem.linearise(w, state);
    if (gain < options.tolerance * cost) break;
  }
  return block;
}

// Tries a window's state from another start; whether it came out clearly better and was kept.
bool try_from(const Problem& problem, std::size_t w, const WindowState& start, WindowState& state,
              Block& block) {
  FitOptions few;
  few.iterations = 6;
  FitOptions more;
  more.iterations = 16;
  WindowState there = start;
  Block trial = fit_state(problem, w, there, few);
  if (cost_of(trial) < cost_of(block)) trial = fit_state(problem, w, there, more);
  if (cost_of(trial) >= 0.8 * cost_of(block)) return false;
  block = trial;
  state = there;
  return true;
}

double excess_of(const Block& block) { return block.chi2 / std::max(1, block.count); }

// How much worse than others a window is followed that is tried again.
constexpr double much_worse = 3.0;

// A window that is followed much worse than most may have started on the wrong side of a slip: its
// cost has several valleys, and descent does not leave the one it begins in. Such windows are tried
// again from other values of the states that no channel shows, and the best is kept. Returns
// whether any came out better.
bool rescue_outliers(const Problem& problem, int threads, std::vector<WindowState>& states,
                     std::vector<Block>& blocks) {
  if (blocks.empty()) return false;
  std::vector<double> followed;
  for (const Block& block : blocks) followed.push_back(excess_of(block));
  const double usual = median(std::move(followed));
  std::atomic<bool> any{false};
  for_each(blocks.size(), threads, [&](std::size_t w) {
    if (excess_of(blocks[w]) <= much_worse * usual) return;
    for (const WindowState& start : problem.other_starts(w)) {
      if (try_from(problem, w, start, states[w], blocks[w])) any = true;
    }
  });
  return any;
}

// A window that is followed much worse than the one before it is tried from where that one ends:
// it has found what no channel shows. Good states walk on from window to window, a round each.
bool carry_on(const Problem& problem, int threads, std::vector<WindowState>& states,
              std::vector<Block>& blocks) {
  constexpr int rounds = 4;
  bool any = false;
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::optional<WindowState>> start(blocks.size());
    for_each(blocks.size(), threads, [&](std::size_t w) {
      if (w == 0 || !problem.follows_on(w)) return;
      if (excess_of(blocks[w]) <= much_worse * excess_of(blocks[w - 1])) return;
      start[w] = problem.carried_on(w, states[w - 1]);
    });
    std::atomic<bool> better{false};
    for_each(blocks.size(), threads, [&](std::size_t w) {
      if (start[w] && try_from(problem, w, *start[w], states[w], blocks[w])) better = true;
    });
    if (!better) break;
    any = true;
  }
  return any;
}

// Both ways out of a wrong valley.
bool rescue(const Problem& problem, int threads, std::vector<WindowState>& states,
            std::vector<Block>& blocks) {
  const bool outliers = rescue_outliers(problem, threads, states, blocks);
  return carry_on(problem, threads, states, blocks) || outliers;
}

}  // namespace

double Fit::chi2_per_sample() const {
  double sum = 0.0;
  double freedom = 0.0;
  for (std::size_t w = 0; w < chi2.size(); ++w) {
    sum += chi2[w];
    freedom += std::max(1, count[w] - states_per_window);
  }
  return freedom > 0.0 ? sum / freedom : 0.0;
}

std::vector<WindowState> guessed_states(const Task& task, const Hypothesis& hypothesis) {
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  const auto parameters = hypothesis.parameters(z);
  std::vector<WindowState> states;
  states.reserve(task.windows.size());
  for (const WindowRef ref : task.windows) {
    const Experiment& e = task.experiments[ref.experiment];
    states.push_back(prior_of(e, e.windows[ref.window], hypothesis, parameters).centre);
  }
  return states;
}

std::vector<WindowState> carried(const std::vector<WindowState>& from, const Task& task,
                                 const Hypothesis& old_hypothesis, const Hypothesis& hypothesis) {
  std::vector<WindowState> states = guessed_states(task, hypothesis);
  const bool same_contact =
      old_hypothesis.rig().structure().kinetics == hypothesis.rig().structure().kinetics;
  for (std::size_t w = 0; w < states.size(); ++w) {
    for (int i = 0; i < physics::max_rig_states; ++i) {
      if (!old_hypothesis.rig().has_state(i)) continue;
      if (i == physics::state::contact && !same_contact) continue;
      states[w][static_cast<std::size_t>(i)] = from[w][static_cast<std::size_t>(i)];
    }
  }
  return states;
}

std::vector<std::shared_ptr<const BaseResponse>> base_response_of(
    const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
    const std::vector<WindowState>& states) {
  std::vector<std::shared_ptr<const BaseResponse>> out;
  if (std::none_of(task.experiments.begin(), task.experiments.end(),
                   [](const Experiment& e) { return e.base_doubt_m_s2 > 0.0; })) {
    return out;
  }
  Task plain = task;
  plain.base_response.clear();
  Problem problem(plain, hypothesis, z, false);
  problem.prepare(z);
  out.resize(task.windows.size());
  for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    out[w] = std::make_shared<const BaseResponse>(problem.base_response(w, states[w]));
  });
  return out;
}

std::vector<WindowJacobian> jacobians_of(const Task& task, const Hypothesis& hypothesis,
                                         std::span<const double> z,
                                         const std::vector<WindowState>& states) {
  Problem problem(task, hypothesis, z, true);
  problem.prepare(z);
  const auto np = static_cast<Eigen::Index>(problem.unknowns());
  std::vector<WindowJacobian> out(task.windows.size());
  for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const auto derivatives = problem.differentiate(w, states[w]);
    const Eigen::Index states_and_more = derivatives.jacobian.cols() - np;
    Eigen::MatrixXd knots(derivatives.residual.size(), 0);
    if (problem.base_is_doubted()) knots = problem.scaled_base_response(w);
    out[w].residual = derivatives.residual;
    out[w].parameters = derivatives.jacobian.leftCols(np);
    out[w].free.resize(derivatives.residual.size(), states_and_more + knots.cols());
    out[w].free << derivatives.jacobian.rightCols(states_and_more), knots;
  });
  return out;
}

Eigen::VectorXd residuals_of(const Task& task, std::size_t window, const Hypothesis& hypothesis,
                             std::span<const double> z, const WindowState& state) {
  const Experiment& e = task.experiments[task.windows[window].experiment];
  const Window& each = e.windows[task.windows[window].window];
  const auto readings = predict(e, each, each.end, hypothesis, z, state);
  Eigen::VectorXd residual(static_cast<Eigen::Index>((each.end - each.begin) * predicted_channels));
  Eigen::Index row = 0;
  for (std::size_t k = each.begin; k < each.end; ++k) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (((e.valid[k] >> c) & 1U) == 0) continue;
      residual[row++] = (readings[k - each.begin][c] - e.reading[k][c]) / task.sigma[c];
    }
  }
  residual.conservativeResize(row);
  return residual;
}

Fit fit(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
        std::vector<WindowState> states, const FitOptions& options) {
  Problem problem(task, hypothesis, z, options.parameters_free);
  const std::size_t windows = task.windows.size();
  const auto np = static_cast<Eigen::Index>(problem.unknowns());
  const auto ns = static_cast<Eigen::Index>(problem.states().size());
  std::vector<Block> blocks(windows);
  const auto linearise_all = [&] {
    problem.prepare(z);
    for_each(windows, task.threads,
             [&](std::size_t w) { blocks[w] = problem.linearise(w, states[w]); });
  };

  if (!options.parameters_free) {
    problem.prepare(z);
    for_each(windows, task.threads, [&](std::size_t w) {
      blocks[w] = fit_state(problem, w, states[w], options);
      if (task.window_done) task.window_done();
    });
    if (options.rescue) rescue(problem, task.threads, states, blocks);
    Fit result;
    result.z = std::move(z);
    result.state = std::move(states);
    result.cost = total_cost(blocks);
    result.states_per_window = static_cast<int>(ns);
    for (const Block& block : blocks) {
      result.chi2.push_back(block.chi2);
      result.count.push_back(block.count);
    }
    return result;
  }

  linearise_all();
  double cost = total_cost(blocks) + problem.parameter_prior(z);
  double damping = 1.0e-3;
  Fit result;
  const auto descend = [&](int iterations) {
    for (int iteration = 0; iteration < iterations; ++iteration) {
      ++result.iterations;
      // Damped normal equations, window states eliminated.
      bool improved = false;
      bool finished = false;
      for (int attempt = 0; attempt < 8 && !improved && !finished; ++attempt) {
        Eigen::MatrixXd reduced = Eigen::MatrixXd::Zero(np, np);
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(np);
        std::vector<Eigen::LDLT<Eigen::MatrixXd>> factor(windows);
        for (std::size_t w = 0; w < windows; ++w) {
          const Block& block = blocks[w];
          Eigen::MatrixXd ss = block.ss;
          ss.diagonal() *= 1.0 + damping;
          factor[w].compute(ss);
          if (np == 0) continue;
          reduced += block.pp;
          reduced.diagonal() += damping * block.pp.diagonal();
          const Eigen::MatrixXd solved = factor[w].solve(block.ps.transpose());
          reduced -= block.ps * solved;
          gradient += block.gp - block.ps * factor[w].solve(block.gs);
        }
        for (Eigen::Index i = 0; i < np; ++i) {
          const auto u = static_cast<std::size_t>(i);
          const double sigma = hypothesis.unknowns()[u].prior_sigma;
          if (sigma > 0.0) {
            reduced(i, i) += (1.0 + damping) / (sigma * sigma);
            gradient[i] += z[u] / (sigma * sigma);
          }
          reduced(i, i) += 1.0e-12 * (1.0 + std::abs(reduced(i, i)));
        }
        Eigen::VectorXd step = Eigen::VectorXd::Zero(np);
        if (np > 0) step = -reduced.ldlt().solve(gradient);
        if (!step.allFinite()) {
          damping *= 10.0;
          continue;
        }
        std::vector<double> trial_z = z;
        for (Eigen::Index i = 0; i < np; ++i) {
          const auto u = static_cast<std::size_t>(i);
          // A logarithm that moves by more than a factor of e^2 at once has left its linear range.
          const bool logarithmic = hypothesis.unknowns()[u].logarithmic;
          trial_z[u] += logarithmic ? std::clamp(step[i], -2.0, 2.0) : step[i];
        }
        std::vector<WindowState> trial_states(windows);
        for (std::size_t w = 0; w < windows; ++w) {
          Eigen::VectorXd right = -blocks[w].gs;
          if (np > 0) right -= blocks[w].ps.transpose() * step;
          const Eigen::VectorXd own = ns > 0 ? Eigen::VectorXd(factor[w].solve(right))
                                             : Eigen::VectorXd(Eigen::VectorXd::Zero(0));
          trial_states[w] = problem.moved(w, states[w], own);
        }
        std::vector<Block> trial(windows);
        problem.prepare(trial_z);
        for_each(windows, task.threads,
                 [&](std::size_t w) { trial[w] = problem.evaluate(w, trial_states[w]); });
        const double trial_cost = total_cost(trial) + problem.parameter_prior(trial_z);
        if (trial_cost < cost) {
          finished = cost - trial_cost < options.tolerance * cost;
          improved = true;
          z = std::move(trial_z);
          states = std::move(trial_states);
          cost = trial_cost;
          damping = std::max(1.0e-9, damping * 0.2);
          const bool last = finished || iteration + 1 == iterations;
          if (last && !options.covariance) {
            blocks = std::move(trial);  // costs are all that anybody will ask for
          } else {
            linearise_all();
          }
        } else {
          damping *= 8.0;
          if (trial_cost - cost < 1.0e-9 * cost) finished = true;
        }
      }
      if (!improved || finished) break;
    }
  };
  descend(options.iterations);
  problem.prepare(z);
  if (options.rescue && rescue(problem, task.threads, states, blocks)) {
    cost = total_cost(blocks) + problem.parameter_prior(z);
    damping = 1.0e-3;
    if (!options.covariance) linearise_all();
    descend(options.iterations);
    problem.prepare(z);
  }

  result.z = std::move(z);
  result.state = std::move(states);
  result.cost = cost;
  result.states_per_window = static_cast<int>(ns);
  for (const Block& block : blocks) {
    result.chi2.push_back(block.chi2);
    result.count.push_back(block.count);
  }
  if (np > 0 && options.covariance) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(np, np);
    for (const Block& block : blocks) {
      information += block.pp - block.ps * block.ss.ldlt().solve(block.ps.transpose());
    }
    for (Eigen::Index i = 0; i < np; ++i) {
      const double sigma = hypothesis.unknowns()[static_cast<std::size_t>(i)].prior_sigma;
      if (sigma > 0.0) information(i, i) += 1.0 / (sigma * sigma);
      information(i, i) += 1.0e-12 * (1.0 + std::abs(information(i, i)));
    }
    result.covariance = information.ldlt().solve(Eigen::MatrixXd::Identity(np, np));
  }
  return result;
}

Fit fit_states(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
               FitOptions options) {
  options.parameters_free = false;
  const std::vector<double> values(z.begin(), z.end());
  Task coloured = task;
  coloured.base_response.clear();
  Fit fitted = fit(coloured, hypothesis, values, guessed_states(coloured, hypothesis), options);
  coloured.base_response = base_response_of(coloured, hypothesis, z, fitted.state);
  if (coloured.base_response.empty()) return fitted;
  return fit(coloured, hypothesis, values, std::move(fitted.state), options);
}

std::vector<std::array<double, predicted_channels>> predict(const Experiment& experiment,
                                                            const Window& window, std::size_t end,
                                                            const Hypothesis& hypothesis,
                                                            std::span<const double> z,
                                                            const WindowState& state) {
  const SensorBank bank(hypothesis.model(), experiment.period_s / experiment.substeps);
  const auto parameters = hypothesis.parameters(z);
  const auto n = numbers_on_recording<double>(hypothesis.rig(), parameters);
  RigState<double> s;
  s.s = state;
  std::vector<std::array<double, predicted_channels>> readings;
  readings.reserve(end - window.begin);
  run_window<double>(
      experiment, window, end, hypothesis.rig(), bank, n, s,
      [&](std::size_t, const physics::Readings<double>& r) { readings.push_back(as_array(r)); });
  return readings;
}

}  // namespace stickslip::diagnosis
