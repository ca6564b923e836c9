#include "diagnosis/base_noise.h"

#include <Eigen/Cholesky>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

// Subtracts the response to the most probable knots of the base's noise, given the residuals.
void remove_base_noise(Readings& readings, const Task& task, std::size_t w, BaseResponse response) {
  const Experiment& e = task.experiment(w);
  const Window& window = task.window(w);
  Eigen::VectorXd residual(response.rows());
  Eigen::Index row = 0;
  for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
    response.row(row) /= task.sigma[c];
    residual[row++] = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma[c];
  });
  if (!residual.allFinite()) return;
  using Square = Eigen::Matrix<double, base_knots, base_knots>;
  const Square information = Square::Identity() + response.transpose() * response;
  const Eigen::Matrix<double, base_knots, 1> knots =
      information.llt().solve(response.transpose() * residual);
  const Eigen::VectorXd explained = response * knots;
  row = 0;
  for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
    readings[k - window.begin][c] -= explained[row++] * task.sigma[c];
  });
}

}  // namespace

std::vector<Readings> corrected_readings(const Task& task, const FittedHypothesis& fitted) {
  const Hypothesis& hypothesis = *fitted.hypothesis;
  const auto& state = *fitted.state;
  const auto response = base_responses(task, hypothesis, fitted.z, state);
  std::vector<Readings> readings(task.windows.size());
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const Window& window = task.window(w);
    readings[w] = predict(task.experiment(w), window, window.end, hypothesis, fitted.z, state[w]);
    if (!response.empty()) remove_base_noise(readings[w], task, w, *response[w]);
  });
  return readings;
}

}  // namespace stickslip::diagnosis
