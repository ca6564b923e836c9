// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/shooting.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

#include "diagnosis/parallel/for_each.h"
#include "diagnosis/window_problem.h"
#include "diagnosis/window_simulation.h"

namespace stickslip::diagnosis {

namespace {

using parallel::for_each;

constexpr double first_damping = 1.0e-3;
constexpr double min_damping = 1.0e-9;
constexpr double ridge_damping = 1.0e-3;  // factor of the damping where it alone ends a descent
constexpr int damping_attempts = 8;
constexpr int shortenings = 4;  // of a step along a ridge
// Largest ratio of mean squares up to which a window is not started elsewhere.
constexpr double most_ratio = 3.0;
// Share of the windows up to which those that do not follow their linearisation are few.
constexpr double few_windows = 0.15;
// Decrease of a window's cost from which another start of it is kept: ten nats, in another minimum.
constexpr double better_start_gain = 20.0;

// Largest change of a window's cost that still follows the predicted one: half a nat, and half of
// the prediction, beyond it.
double tolerated_change(double predicted) { return predicted + 1.0 + 0.5 * std::abs(predicted); }

double total_cost(const std::vector<NormalBlock>& blocks) {
  double cost = 0.0;
  for (const NormalBlock& block : blocks) cost += block.cost();
  return cost;
}

constexpr double normal_975 = 1.959964;
// Relative; solves where nothing depends on an unknown.
constexpr double least_information = 1.0e-12;

// 97.5 % quantile of Student's t: Abramowitz and Stegun 26.7.5, exact for 1 and 2 degrees.
double student_975(int degrees) {
  if (degrees == 1) return 12.7062;
  if (degrees == 2) return 4.30265;
  const double z = normal_975;
  const double n = degrees;
  const double z2 = z * z;
  return z * (1.0 + (z2 + 1.0) / (4.0 * n) + ((5.0 * z2 + 16.0) * z2 + 3.0) / (96.0 * n * n) +
              (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / (384.0 * n * n * n));
}

// Fits the state of one window, the parameters held. Each window has its own damping, so that one
// that the model cannot follow does not slow down the others.
NormalBlock fit_window_state(const WindowProblem& problem, std::size_t w, WindowState& state,
                             const FitOptions& options) {
  NormalBlock block = problem.linearise(w, state);
  double cost = block.cost();
  double damping = first_damping;
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    bool improved = false;
    double gain = 0.0;
    for (int attempt = 0; attempt < damping_attempts && !improved; ++attempt) {
      Eigen::MatrixXd ss = block.ss;
      ss.diagonal() *= 1.0 + damping;
      const WindowState trial = problem.moved(w, state, -ss.ldlt().solve(block.gs));
      const double trial_cost = problem.evaluate(w, trial).cost();
      if (trial_cost < cost) {
        gain = cost - trial_cost;
        improved = true;
        state = trial;
        cost = trial_cost;
        damping = std::max(min_damping, damping * 0.2);
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

// Fits a window's state from another start; true if the result is clearly better and was kept.
bool improved_from(const WindowProblem& problem, std::size_t w, const WindowState& start,
                   WindowState& state, NormalBlock& block) {
  FitOptions brief;
  brief.iterations = 6;
  FitOptions full;
  full.iterations = 16;
  WindowState candidate = start;
  NormalBlock trial = fit_window_state(problem, w, candidate, brief);
  if (trial.cost() < block.cost()) trial = fit_window_state(problem, w, candidate, full);
  if (trial.cost() >= block.cost() - better_start_gain) return false;
  block = trial;
  state = candidate;
  return true;
}

// Mean squares of the windows of a fit, and the ratio of two of them beyond their spread.
struct Spread {
  double typical = 0.0;
  double outlying_ratio = most_ratio;
};

// A few windows that fit a little worse than all others already move the parameters far. Beyond
// the spread: above Tukey's inner fence, of logarithms.
Spread spread_of(const std::vector<NormalBlock>& blocks) {
  std::vector<double> logs;
  logs.reserve(blocks.size());
  for (const NormalBlock& block : blocks) {
    logs.push_back(std::log(std::max(block.mean_square(), 1.0e-300)));
  }
  std::sort(logs.begin(), logs.end());
  const double middle = logs[logs.size() / 2];
  const double low = logs[logs.size() / 4];
  const double high = logs[3 * logs.size() / 4];
  const double fence = high + 1.5 * (high - low) - middle;
  return {std::exp(middle), std::min(std::exp(fence), most_ratio)};
}

// A window that fits worse than most may have started on the wrong side of a slip, in a local
// minimum. It is fitted again from other values of the states that no channel shows. Returns true
// if any window improved.
bool retry_outliers(const WindowProblem& problem, int threads, const Spread& spread,
                    std::vector<WindowState>& states, std::vector<NormalBlock>& blocks) {
  std::atomic<bool> any{false};
  for_each(blocks.size(), threads, [&](std::size_t w) {
    if (blocks[w].mean_square() <= spread.outlying_ratio * spread.typical) return;
    for (const WindowState& start : problem.alternative_starts(w)) {
      if (improved_from(problem, w, start, states[w], blocks[w])) any = true;
    }
  });
  return any;
}

// A window that fits worse than the one before it is fitted again from the end of that one, which
// has found the hidden states. Good states propagate by one window per round.
bool propagate_states(const WindowProblem& problem, int threads, const Spread& spread,
                      std::vector<WindowState>& states, std::vector<NormalBlock>& blocks) {
  constexpr int rounds = 4;
  bool any = false;
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::optional<WindowState>> start(blocks.size());
    for_each(blocks.size(), threads, [&](std::size_t w) {
      if (w == 0 || !problem.follows_on(w)) return;
      const double before = blocks[w - 1].mean_square();
      if (blocks[w].mean_square() <= spread.outlying_ratio * before) return;
      start[w] = problem.propagated(w, states[w - 1]);
    });
    std::atomic<bool> better{false};
    for_each(blocks.size(), threads, [&](std::size_t w) {
      if (start[w] && improved_from(problem, w, *start[w], states[w], blocks[w])) better = true;
    });
    if (!better) break;
    any = true;
  }
  return any;
}

bool restart_windows(const WindowProblem& problem, int threads, std::vector<WindowState>& states,
                     std::vector<NormalBlock>& blocks) {
  if (blocks.empty()) return false;
  const Spread spread = spread_of(blocks);
  const bool outliers = retry_outliers(problem, threads, spread, states, blocks);
  return propagate_states(problem, threads, spread, states, blocks) || outliers;
}

double state_cost_of(const NormalBlock& block, std::size_t states) {
  if (block.ss.rows() == 0) return static_cast<double>(states);
  // In units of the priors: without a reading the information is the identity.
  const Eigen::VectorXd pivots = block.ss.ldlt().vectorD();
  return 0.5 * pivots.array().max(1.0e-300).log().sum() + block.prior;
}

Fit summary_of(const std::vector<NormalBlock>& blocks, std::vector<double> z,
               std::vector<WindowState> states, std::size_t states_per_window) {
  Fit result;
  result.z = std::move(z);
  result.state = std::move(states);
  result.states_per_window = static_cast<int>(states_per_window);
  for (const NormalBlock& block : blocks) {
    result.chi2.push_back(block.chi2);
    result.count.push_back(block.count);
    result.state_cost.push_back(state_cost_of(block, states_per_window));
  }
  return result;
}

// Fits the states of all windows, the parameters held.
std::vector<NormalBlock> fit_each_window(const WindowProblem& problem, const Task& task,
                                         std::vector<WindowState>& states,
                                         const FitOptions& options) {
  std::vector<NormalBlock> blocks(task.windows.size());
  for_each(blocks.size(), task.threads, [&](std::size_t w) {
    blocks[w] = fit_window_state(problem, w, states[w], options);
    if (task.window_done) task.window_done();
  });
  if (options.multistart) restart_windows(problem, task.threads, states, blocks);
  return blocks;
}

// Replaces states by those of a fit from the first guesses where these fit better: parameters that
// were still far off lead windows into minima on the wrong side of a slip, for which the parameters
// then compensate.
void start_anew(const Task& task, const Hypothesis& hypothesis, const std::vector<double>& z,
                std::vector<WindowState>& states) {
  WindowProblem problem(task, hypothesis, z, false);
  problem.prepare(z);
  std::vector<WindowState> anew = initial_states(task, hypothesis);
  const std::vector<NormalBlock> blocks = fit_each_window(problem, task, anew, {});
  for_each(states.size(), task.threads, [&](std::size_t w) {
    if (blocks[w].cost() < problem.evaluate(w, states[w]).cost()) states[w] = anew[w];
  });
}

// Joint descent of parameters and window states from a start.
class JointFit {
 public:
  JointFit(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
           std::vector<WindowState> states, const FitOptions& options)
      : task_(task),
        hypothesis_(hypothesis),
        options_(options),
        problem_(task, hypothesis, z, true),
        np_(static_cast<Eigen::Index>(problem_.unknowns())),
        z_(std::move(z)),
        states_(std::move(states)),
        blocks_(task.windows.size()) {}

  Fit run() && {
    if (options_.multistart && options_.start_anew) start_anew(task_, hypothesis_, z_, states_);
    linearise();
    cost_ = total_cost(blocks_) + problem_.parameter_prior(z_);
    descend();
    if (options_.multistart && restart_windows(problem_, task_.threads, states_, blocks_)) {
      cost_ = total_cost(blocks_) + problem_.parameter_prior(z_);
      damping_ = first_damping;
      if (!options_.covariance) linearise();
      descend();
    }
    Fit result = summary_of(blocks_, std::move(z_), std::move(states_), problem_.states());
    result.cost = cost_;
    result.iterations = iterations_;
    if (np_ > 0 && options_.covariance) set_covariances(result);
    return result;
  }

 private:
  // Damped normal equations of the parameters, window states eliminated.
  struct Reduced {
    Eigen::MatrixXd information;
    Eigen::VectorXd gradient;
    std::vector<Eigen::LDLT<Eigen::MatrixXd>> factor;  // of the states, by window
  };
  struct Step {
    Eigen::VectorXd parameters;
    std::vector<Eigen::VectorXd> own;  // of the states, by window
    double slope = 0.0;                // of the cost along it

    void operator*=(double share) {
      parameters *= share;
      for (Eigen::VectorXd& each : own) each *= share;
      slope *= share;
    }
  };
  struct Trial {
    std::vector<double> z;
    std::vector<WindowState> states;
    std::vector<NormalBlock> blocks;
    double cost = 0.0;
    bool linearised = false;  // blocks have derivatives
  };

  void linearise() {
    problem_.prepare(z_);
    for_each(blocks_.size(), task_.threads,
             [&](std::size_t w) { blocks_[w] = problem_.linearise(w, states_[w]); });
  }

  void descend() {
    for (int iteration = 0; iteration < options_.iterations; ++iteration) {
      ++iterations_;
      if (!step(iteration + 1 == options_.iterations)) break;
    }
    if (options_.covariance) {
      for (int i = 0; i < options_.iterations && step_along_ridge(); ++i) {
      }
    }
    problem_.prepare(z_);
  }

  // One iteration; false if the descent is at its end.
  bool step(bool last) {
    for (int attempt = 0; attempt < damping_attempts; ++attempt) {
      const Reduced reduced = reduced_equations(damping_);
      const Step step = step_of(reduced);
      if (!step.parameters.allFinite()) {
        damping_ *= 10.0;
        continue;
      }
      // A first trial is accepted where the last one was: derivatives are then needed at once.
      const bool at_once = attempt == 0 && first_accepted_ && (!last || options_.covariance);
      Trial trial = trial_at(step, at_once);
      if (trial.cost < cost_) {
        first_accepted_ = attempt == 0;
        return accept(std::move(trial), last);
      }
      damping_ *= 8.0;
      if (trial.cost - cost_ < 1.0e-9 * cost_) return false;
    }
    return false;
  }

  // Numbers of which only a product shows in the readings compensate each other along a curve,
  // where damping all but stops a descent: it goes on by steps that are shortened instead, each to
  // the minimum of the parabola by the cost at both ends of the last one and the slope. True if one
  // gains enough.
  bool step_along_ridge() {
    ++iterations_;
    Step step = step_of(reduced_equations(min_damping));
    if (!step.parameters.allFinite() || !(-0.5 * step.slope > enough_gain())) return false;
    for (int attempt = 0; attempt < shortenings; ++attempt) {
      Trial trial = trial_at(step, false);
      if (cost_ - trial.cost > enough_gain()) {
        accept(std::move(trial), false);
        return true;
      }
      const double beyond = trial.cost - cost_ - step.slope;
      const double share = std::isfinite(beyond) ? -0.5 * step.slope / beyond : 0.0;
      step *= std::clamp(share, 0.1, 0.5);
    }
    return false;
  }

  Step step_of(const Reduced& reduced) const {
    Step out;
    out.parameters = Eigen::VectorXd::Zero(np_);
    if (np_ > 0) out.parameters = -reduced.information.ldlt().solve(reduced.gradient);
    for (Eigen::Index i = 0; i < np_; ++i) {
      // A step of a logarithm by more than a factor of e^2 leaves its linear range.
      const Unknown& unknown = hypothesis_.unknowns()[static_cast<std::size_t>(i)];
      if (unknown.logarithmic) out.parameters[i] = std::clamp(out.parameters[i], -2.0, 2.0);
      if (unknown.prior_sigma > 0.0) {
        out.slope += 2.0 * out.parameters[i] * z_[static_cast<std::size_t>(i)] /
                     (unknown.prior_sigma * unknown.prior_sigma);
      }
    }
    for (std::size_t w = 0; w < blocks_.size(); ++w) {
      const NormalBlock& block = blocks_[w];
      Eigen::VectorXd right = -block.gs;
      if (np_ > 0) right -= block.ps.transpose() * out.parameters;
      out.own.emplace_back(right.size() > 0 ? Eigen::VectorXd(reduced.factor[w].solve(right))
                                            : right);
      out.slope += 2.0 * block.gs.dot(out.own.back());
      if (np_ > 0) out.slope += 2.0 * block.gp.dot(out.parameters);
    }
    return out;
  }

  // Gain of an undamped step of the parameters in a linear problem. Damping alone makes
  // small steps along a ridge, where well-determined parameters compensate each other.
  double newton_decrement() const {
    const Reduced reduced = reduced_equations(0.0);
    return 0.5 * reduced.gradient.dot(reduced.information.ldlt().solve(reduced.gradient));
  }

  Reduced reduced_equations(double damping) const {
    Reduced out{Eigen::MatrixXd::Zero(np_, np_), Eigen::VectorXd::Zero(np_), {}};
    out.factor.resize(blocks_.size());
    for (std::size_t w = 0; w < blocks_.size(); ++w) {
      const NormalBlock& block = blocks_[w];
      Eigen::MatrixXd ss = block.ss;
      ss.diagonal() *= 1.0 + damping;
      out.factor[w].compute(ss);
      if (np_ == 0) continue;
      out.information += block.pp;
      out.information.diagonal() += damping * block.pp.diagonal();
      const Eigen::MatrixXd solved = out.factor[w].solve(block.ps.transpose());
      out.information -= block.ps * solved;
      out.gradient += block.gp - block.ps * out.factor[w].solve(block.gs);
    }
    for (Eigen::Index i = 0; i < np_; ++i) {
      const auto u = static_cast<std::size_t>(i);
      const double sigma = hypothesis_.unknowns()[u].prior_sigma;
      if (sigma > 0.0) {
        out.information(i, i) += (1.0 + damping) / (sigma * sigma);
        out.gradient[i] += z_[u] / (sigma * sigma);
      }
      out.information(i, i) += least_information * (1.0 + std::abs(out.information(i, i)));
    }
    return out;
  }

  // Change of a window's cost by a step, by its linearisation.
  static double predicted_change(const NormalBlock& block, const Eigen::VectorXd& delta,
                                 const Eigen::VectorXd& own) {
    double change = 2.0 * block.gs.dot(own) + own.dot(block.ss * own);
    if (delta.size() > 0) {
      change += 2.0 * block.gp.dot(delta) + delta.dot(block.pp * delta);
      change += 2.0 * delta.dot(block.ps * own);
    }
    return change;
  }

  // Fits the states of windows that do not follow their linearisation to the new parameters. Where
  // that is not a few windows, the step is too long.
  void follow(Trial& trial, const std::vector<double>& predicted) const {
    std::vector<std::size_t> astray;
    for (std::size_t w = 0; w < blocks_.size(); ++w) {
      const double change = trial.blocks[w].cost() - blocks_[w].cost();
      if (change > tolerated_change(predicted[w])) astray.push_back(w);
    }
    if (static_cast<double>(astray.size()) > few_windows * static_cast<double>(blocks_.size())) {
      return;
    }
    for_each(astray.size(), task_.threads, [&](std::size_t i) { fit_own(astray[i], trial); });
  }

  void fit_own(std::size_t w, Trial& trial) const {
    FitOptions options;
    options.iterations = options_.own_steps;
    WindowState state = states_[w];
    if (trial.blocks[w].cost() < problem_.evaluate(w, state).cost()) state = trial.states[w];
    NormalBlock block = fit_window_state(problem_, w, state, options);
    if (!(block.cost() < trial.blocks[w].cost())) return;
    trial.blocks[w] = std::move(block);
    trial.states[w] = state;
  }

  Trial trial_at(const Step& step, bool with_derivatives) {
    const std::size_t windows = blocks_.size();
    Trial trial{z_, std::vector<WindowState>(windows), std::vector<NormalBlock>(windows)};
    for (std::size_t u = 0; u < trial.z.size(); ++u) {
      trial.z[u] += step.parameters[static_cast<Eigen::Index>(u)];
    }
    std::vector<double> predicted(windows);
    for (std::size_t w = 0; w < windows; ++w) {
      trial.states[w] = problem_.moved(w, states_[w], step.own[w]);
      predicted[w] = predicted_change(blocks_[w], step.parameters, step.own[w]);
    }
    problem_.prepare(trial.z);
    for_each(windows, task_.threads, [&](std::size_t w) {
      trial.blocks[w] = with_derivatives ? problem_.linearise(w, trial.states[w])
                                         : problem_.evaluate(w, trial.states[w]);
    });
    if (problem_.free_in_window() > 0 && options_.own_steps > 0) follow(trial, predicted);
    trial.linearised = with_derivatives;
    trial.cost = total_cost(trial.blocks) + problem_.parameter_prior(trial.z);
    return trial;
  }

  // Gain of an iteration below which the descent is at its end.
  double enough_gain() const {
    double residuals = 0.0;
    for (const NormalBlock& block : blocks_) residuals += block.count;
    return std::max(options_.tolerance * cost_, options_.excess_tolerance * (cost_ - residuals));
  }

  // Returns true unless the fit has converged. A small gain ends it, unless only an earlier damping
  // made it small: where longer steps were refused just now, the model is not linear that far.
  bool accept(Trial trial, bool last) {
    const double enough = enough_gain();
    bool converged = cost_ - trial.cost < enough;
    z_ = std::move(trial.z);
    states_ = std::move(trial.states);
    cost_ = trial.cost;
    damping_ = std::max(min_damping, damping_ * 0.2);
    blocks_ = std::move(trial.blocks);
    // At the end derivatives are only needed for a covariance.
    if (!(converged || last) || options_.covariance) {
      if (!trial.linearised) linearise();
      if (converged && first_accepted_ && damping_ > min_damping) {
        converged = !(newton_decrement() > enough);
        damping_ = std::max(min_damping, damping_ * ridge_damping);
      }
    }
    return !converged;
  }

  // The windows that a jackknife leaves out together: neighbours, which share what the model lacks.
  std::vector<std::vector<std::size_t>> blocks_of_windows() const {
    std::vector<std::vector<std::size_t>> out;
    for (std::size_t w = 0; w < blocks_.size(); ++w) {
      if (w == 0 || !problem_.follows_on(w)) out.emplace_back();
      out.back().push_back(w);
    }
    return out;
  }

  void set_covariances(Fit& out) const {
    Eigen::VectorXd prior = Eigen::VectorXd::Zero(np_);
    for (Eigen::Index i = 0; i < np_; ++i) {
      const double sigma = hypothesis_.unknowns()[static_cast<std::size_t>(i)].prior_sigma;
      if (sigma > 0.0) prior[i] = 1.0 / (sigma * sigma);
    }
    const auto blocks = blocks_of_windows();
    std::vector<Eigen::MatrixXd> information(blocks.size(), Eigen::MatrixXd::Zero(np_, np_));
    std::vector<Eigen::VectorXd> gradient(blocks.size(), Eigen::VectorXd::Zero(np_));
    Eigen::MatrixXd whole = prior.asDiagonal();
    for (std::size_t g = 0; g < blocks.size(); ++g) {
      for (const std::size_t w : blocks[g]) {
        const NormalBlock& block = blocks_[w];
        const Eigen::LDLT<Eigen::MatrixXd> states(block.ss);
        information[g] += block.pp - block.ps * states.solve(block.ps.transpose());
        gradient[g] += block.gp - block.ps * states.solve(block.gs);
      }
      whole += information[g];
    }
    whole.diagonal() += least_information * (1.0 + whole.diagonal().array().abs()).matrix();
    out.covariance = whole.ldlt().solve(Eigen::MatrixXd::Identity(np_, np_));
    const Eigen::LLT<Eigen::MatrixXd> root(whole);
    if (root.info() != Eigen::Success) return;  // rounding: the curvature is all that is known
    out.blocks = static_cast<int>(blocks.size());
    out.jackknife = out.covariance * prior.asDiagonal() * out.covariance;
    const double count = static_cast<double>(blocks.size());
    for (std::size_t g = 0; g < blocks.size(); ++g) {
      const Eigen::VectorXd change = change_without(information[g], gradient[g], root);
      if (change.allFinite()) out.jackknife += (1.0 - 1.0 / count) * change * change.transpose();
    }
  }

  // How the parameters change where a block of windows is left out, of which `information` and
  // `gradient` are; `root` is of the information of all. Where this block knows nearly all of
  // a direction, the others show no scatter of it, and there is no such change.
  static Eigen::VectorXd change_without(const Eigen::MatrixXd& information,
                                        const Eigen::VectorXd& gradient,
                                        const Eigen::LLT<Eigen::MatrixXd>& root) {
    constexpr double nearly_all = 0.9;
    const auto lower = root.matrixL();
    const Eigen::MatrixXd half = lower.solve(information);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> share(lower.solve(half.transpose()));
    Eigen::VectorXd along = share.eigenvectors().transpose() * lower.solve(gradient);
    for (Eigen::Index i = 0; i < along.size(); ++i) {
      const double known = share.eigenvalues()[i];
      along[i] = known < nearly_all ? along[i] / (1.0 - known) : 0.0;
    }
    return lower.transpose().solve(share.eigenvectors() * along);
  }

  const Task& task_;
  const Hypothesis& hypothesis_;
  const FitOptions& options_;
  WindowProblem problem_;
  Eigen::Index np_;
  std::vector<double> z_;
  std::vector<WindowState> states_;
  std::vector<NormalBlock> blocks_;
  double cost_ = 0.0;
  double damping_ = first_damping;
  bool first_accepted_ = true;  // of the trials of the last iteration
  int iterations_ = 0;
};

Fit fit_states_only(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
                    std::vector<WindowState> states, const FitOptions& options) {
  WindowProblem problem(task, hypothesis, z, false);
  problem.prepare(z);
  const std::vector<NormalBlock> blocks = fit_each_window(problem, task, states, options);
  Fit result = summary_of(blocks, std::move(z), std::move(states), problem.states());
  result.cost = total_cost(blocks);
  return result;
}

}  // namespace

FitOptions brief_fit(int iterations) {
  FitOptions options;
  options.iterations = iterations;
  options.tolerance = 1.0e-2;
  options.own_steps = 0;
  options.multistart = false;
  options.covariance = false;
  return options;
}

double Fit::chi2_per_sample() const {
  double sum = 0.0;
  double freedom = 0.0;
  for (std::size_t w = 0; w < chi2.size(); ++w) {
    sum += chi2[w];
    freedom += std::max(1, count[w] - states_per_window);
  }
  return freedom > 0.0 ? sum / freedom : 0.0;
}

double Fit::half_width_95(std::size_t unknown) const {
  const auto i = static_cast<Eigen::Index>(unknown);
  if (i >= covariance.rows()) return 0.0;
  const double inflation = std::max(1.0, chi2_per_sample());
  const double of_curvature = normal_975 * std::sqrt(std::max(0.0, inflation * covariance(i, i)));
  if (blocks < 2) return of_curvature;
  const double of_blocks = student_975(blocks - 1) * std::sqrt(std::max(0.0, jackknife(i, i)));
  return std::max(of_curvature, of_blocks);
}

bool Fit::is_determined(std::size_t unknown) const {
  const auto i = static_cast<Eigen::Index>(unknown);
  return i >= covariance.rows() || covariance(i, i) < 0.5 / least_information;
}

std::vector<WindowState> initial_states(const Task& task, const Hypothesis& hypothesis) {
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  std::vector<std::vector<double>> parameters;
  for (std::size_t i = 0; i < hypothesis.recordings(); ++i) {
    parameters.push_back(hypothesis.parameters(z, i));
  }
  std::vector<WindowState> states;
  states.reserve(task.windows.size());
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const Experiment& e = task.experiment(w);
    states.push_back(state_prior(e, task.window(w), hypothesis, parameters[e.recording]).centre);
  }
  return states;
}

std::vector<WindowState> warm_start_states(const std::vector<WindowState>& from, const Task& task,
                                           const Hypothesis& old_hypothesis,
                                           const Hypothesis& hypothesis) {
  std::vector<WindowState> states = initial_states(task, hypothesis);
  const bool same_contact =
      old_hypothesis.rig().structure().kinetics == hypothesis.rig().structure().kinetics;
  for (std::size_t w = 0; w < states.size(); ++w) {
    for (int i = 0; i < physics::max_rig_states; ++i) {
      if (!old_hypothesis.rig().has_state(i)) continue;
      if (i == physics::state::contact && !same_contact) continue;
      states[w][static_cast<std::size_t>(i)] = from[w][static_cast<std::size_t>(i)];
    }
    std::copy(from[w].begin() + physics::max_rig_states, from[w].end(),
              states[w].begin() + physics::max_rig_states);
  }
  return states;
}

std::vector<WindowJacobian> jacobians_of(const Task& task, const Hypothesis& hypothesis,
                                         std::span<const double> z,
                                         const std::vector<WindowState>& states) {
  WindowProblem problem(task, hypothesis, z, true);
  problem.prepare(z);
  const auto np = static_cast<Eigen::Index>(problem.unknowns());
  std::vector<WindowJacobian> out(task.windows.size());
  for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const auto derivatives = problem.differentiate(w, states[w]);
    out[w].residual = derivatives.residual;
    out[w].offset = problem.offsets(w, states[w]);
    out[w].parameters = derivatives.jacobian.leftCols(np);
    out[w].free = derivatives.jacobian.rightCols(derivatives.jacobian.cols() - np);
  });
  return out;
}

Eigen::VectorXd residuals_of(const Task& task, std::size_t window, const Hypothesis& hypothesis,
                             std::span<const double> z, const WindowState& state) {
  Task one = task;
  one.windows = {task.windows[window]};
  return WindowProblem(one, hypothesis, z, false).residual(0, state);
}

Fit fit(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
        std::vector<WindowState> states, const FitOptions& options) {
  if (!options.parameters_free) {
    return fit_states_only(task, hypothesis, std::move(z), std::move(states), options);
  }
  return JointFit(task, hypothesis, std::move(z), std::move(states), options).run();
}

Fit fit_states(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
               FitOptions options) {
  options.parameters_free = false;
  return fit(task, hypothesis, {z.begin(), z.end()}, initial_states(task, hypothesis), options);
}

Readings predict(const Experiment& experiment, const Window& window, std::size_t end,
                 const Hypothesis& hypothesis, std::span<const double> z, const WindowState& state,
                 Steps steps) {
  const WindowRun run{experiment, window, end, steps};
  const auto parameters = hypothesis.parameters(z, experiment.recording);
  const auto n = numbers_on_recording<double>(hypothesis.rig(), parameters);
  const physics::SensorBank bank = sensor_bank(hypothesis.model(), n.reading, run.step_s());
  Readings readings(end - window.begin);
  run_window(run, hypothesis.rig(), bank, n, state,
             [&](std::size_t k, std::size_t c, double reading, double) {
               readings[k - window.begin][c] = reading;
             });
  return readings;
}

}  // namespace stickslip::diagnosis
