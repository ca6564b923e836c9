#include "diagnosis/detection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

constexpr double alike = 0.98;
constexpr int most_evaluations = 7;
constexpr double near_enough = 0.1;  // of a logarithm

// What a recording sees of a change of the readings once everything that a fit is free to choose
// has taken its share of it.
class Imitation {
 public:
  Imitation(const Hypothesis& hypothesis, std::vector<WindowJacobian> windows)
      : windows_(std::move(windows)) {
    const auto np = static_cast<Eigen::Index>(hypothesis.unknowns().size());
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(np, np);
    for (const WindowJacobian& w : windows_) {
      Eigen::MatrixXd own = w.free.transpose() * w.free;
      own.diagonal().array() += 1.0;  // free columns are in units of their priors
      own_.emplace_back(own);
      cross_.push_back(w.free.transpose() * w.parameters);
      information += w.parameters.transpose() * w.parameters -
                     cross_.back().transpose() * own_.back().solve(cross_.back());
    }
    for (Eigen::Index i = 0; i < np; ++i) {
      const double sigma = hypothesis.unknowns()[static_cast<std::size_t>(i)].prior_sigma;
      information(i, i) += sigma > 0.0 ? 1.0 / (sigma * sigma) : 0.0;
      information(i, i) += 1.0e-12 * (1.0 + information(i, i));
    }
    common_.compute(information);
  }

  std::size_t windows() const { return windows_.size(); }
  const Eigen::VectorXd& residual(std::size_t w) const { return windows_[w].residual; }
  std::vector<Eigen::VectorXd> residuals() const {
    std::vector<Eigen::VectorXd> all;
    for (const WindowJacobian& w : windows_) all.push_back(w.residual);
    return all;
  }

  // Two changes of all windows' readings, multiplied: the square is what is left of chi-squared.
  double product(const std::vector<Eigen::VectorXd>& a,
                 const std::vector<Eigen::VectorXd>& b) const {
    double sum = 0.0;
    Eigen::VectorXd ga = Eigen::VectorXd::Zero(common_.rows());
    Eigen::VectorXd gb = ga;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const WindowJacobian& j = windows_[w];
      const Eigen::VectorXd own_a = j.free.transpose() * a[w];
      const Eigen::VectorXd solved = own_[w].solve(j.free.transpose() * b[w]);
      sum += a[w].dot(b[w]) - own_a.dot(solved);
      ga += j.parameters.transpose() * a[w] - cross_[w].transpose() * own_[w].solve(own_a);
      gb += j.parameters.transpose() * b[w] - cross_[w].transpose() * solved;
    }
    return sum - ga.dot(common_.solve(gb));
  }

 private:
  std::vector<WindowJacobian> windows_;
  std::vector<Eigen::LLT<Eigen::MatrixXd>> own_;
  std::vector<Eigen::MatrixXd> cross_;
  Eigen::LDLT<Eigen::MatrixXd> common_;
};

bool is_judged_by_size(const Hypothesis& base, const Hypothesis& with) {
  const auto& a = base.rig().structure();
  const auto& b = with.rig().structure();
  return a.kinetics == b.kinetics && a.resonant == b.resonant;
}

struct Found {
  DetectionLimit limit;
  std::vector<Eigen::VectorXd> change;
};

}  // namespace

Detection detection_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                       const std::vector<Suspect>& suspects,
                       const std::function<physics::Scales(const physics::Place&)>& scales,
                       double share) {
  const Imitation imitation(hypothesis, jacobians_of(task, hypothesis, fitted.z, fitted.state));
  double samples = 0.0;
  for (std::size_t w = 0; w < imitation.windows(); ++w) {
    samples += static_cast<double>(imitation.residual(w).size());
  }
  const double wanted = 0.5 * std::log(share * samples);
  const std::vector<Eigen::VectorXd> residuals = imitation.residuals();

  // How the readings change with that much of the effect.
  const auto change_of = [&](const Hypothesis& with) {
    std::vector<double> z = fitted.z;
    z.resize(with.unknowns().size(), 0.0);
    const std::vector<WindowState> state = carried(fitted.state, task, hypothesis, with);
    std::vector<Eigen::VectorXd> change;
    for (std::size_t w = 0; w < task.windows.size(); ++w) {
      change.push_back(residuals_of(task, w, with, z, state[w]) - imitation.residual(w));
    }
    return change;
  };

  std::vector<std::optional<Found>> found(suspects.size());
  parallel::for_each(suspects.size(), task.threads, [&](std::size_t i) {
    const physics::Effect& effect = *suspects[i].effect;
    const physics::Card& card = effect.card();
    if (!card.strength) return;
    const physics::Scales sizes = scales(suspects[i].place);
    const physics::ParameterCard& parameter = card.parameters[*card.strength];
    const std::vector<double> fixed = effect.fixed(sizes);
    std::size_t position = 0;  // among the parameters that a start gives
    for (std::size_t k = 0; k < *card.strength; ++k) {
      if (!card.parameters[k].fixed_default) ++position;
    }
    for (std::vector<double> start : effect.starts(sizes)) {
      const std::size_t at = start.size() == card.parameters.size() ? *card.strength : position;
      double amount = std::abs(start[at] - parameter.neutral);
      if (!(amount > 0.0)) amount = 1.0e-3 * (parameter.high - parameter.neutral);
      double last_log_amount = 0.0;
      double last_log_change = 0.0;
      for (int evaluation = 0; evaluation < most_evaluations; ++evaluation) {
        start[at] = parameter.neutral + amount;
        const Hypothesis with =
            hypothesis.with(effect, suspects[i].place, start, fixed, Detail::coarse);
        if (!is_judged_by_size(hypothesis, with)) return;
        std::vector<Eigen::VectorXd> change = change_of(with);
        const double square = imitation.product(change, change);
        const double log_amount = std::log(amount);
        const double log_change =
            std::isfinite(square) ? 0.5 * std::log(std::max(square, 1.0e-30)) : 20.0;
        if (std::abs(log_change - wanted) < near_enough) {
          const double pull = imitation.product(residuals, change);
          const double gain =
              std::max(found[i] ? found[i]->limit.gain : 0.0, pull * pull / (square * samples));
          if (!found[i] || amount < std::abs(found[i]->limit.value - parameter.neutral)) {
            found[i] = Found{{suspects[i], start[at]}, std::move(change)};
          }
          found[i]->limit.gain = gain;
          break;
        }
        // A straight line through the logarithms: most effects are in proportion to their size.
        double slope = 1.0;
        if (evaluation > 0 && log_amount != last_log_amount) {
          slope =
              std::clamp((log_change - last_log_change) / (log_amount - last_log_amount), 0.5, 3.0);
        }
        last_log_amount = log_amount;
        last_log_change = log_change;
        amount = std::exp(log_amount + std::clamp((wanted - log_change) / slope, -12.0, 12.0));
        if (parameter.neutral + amount > parameter.high) break;
      }
    }
  });

  Detection out;
  std::vector<const Found*> kept;
  for (const auto& each : found) {
    if (!each) continue;
    kept.push_back(&*each);
    out.limits.push_back(each->limit);
  }
  const std::size_t pairs = kept.size() * kept.size();
  std::vector<double> product(pairs, 0.0);
  parallel::for_each(kept.size(), task.threads, [&](std::size_t a) {
    for (std::size_t b = 0; b <= a; ++b) {
      product[a * kept.size() + b] = imitation.product(kept[a]->change, kept[b]->change);
    }
  });
  for (std::size_t a = 0; a < kept.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const double norm = product[a * kept.size() + a] * product[b * kept.size() + b];
      const double cosine =
          norm > 0.0 ? std::abs(product[a * kept.size() + b]) / std::sqrt(norm) : 0.0;
      if (cosine >= alike) out.lookalikes.push_back({b, a, std::min(cosine, 1.0)});
    }
  }
  std::stable_sort(out.lookalikes.begin(), out.lookalikes.end(),
                   [](const Lookalikes& a, const Lookalikes& b) { return a.cosine > b.cosine; });
  return out;
}

}  // namespace stickslip::diagnosis
