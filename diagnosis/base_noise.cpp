#include "diagnosis/base_noise.h"

#include <Eigen/Cholesky>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

// Takes out of the readings of a window what the base's noise would most probably have added to
// them: its knots, given the residuals.
void take_base_out(Readings& readings, const Task& task, std::size_t w, BaseResponse response) {
  const Experiment& e = task.experiments[task.windows[w].experiment];
  const Window& window = e.windows[task.windows[w].window];
  Eigen::VectorXd residual(response.rows());
  const auto each_row = [&](auto&& visit) {
    Eigen::Index row = 0;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      for (std::size_t c = 0; c < predicted_channels; ++c) {
        if (((e.valid[k] >> c) & 1U) != 0) visit(row++, k, c);
      }
    }
  };
  each_row([&](Eigen::Index row, std::size_t k, std::size_t c) {
    response.row(row) /= task.sigma[c];
    residual[row] = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma[c];
  });
  if (!residual.allFinite()) return;
  using Square = Eigen::Matrix<double, base_knots, base_knots>;
  const Square information = Square::Identity() + response.transpose() * response;
  const Eigen::Matrix<double, base_knots, 1> knots =
      information.llt().solve(response.transpose() * residual);
  const Eigen::VectorXd share = response * knots;
  each_row([&](Eigen::Index row, std::size_t k, std::size_t c) {
    readings[k - window.begin][c] -= share[row] * task.sigma[c];
  });
}

}  // namespace

std::vector<Readings> readings_of(const Task& task, const Hypothesis& hypothesis,
                                  std::span<const double> z,
                                  const std::vector<WindowState>& state) {
  const auto response = base_response_of(task, hypothesis, z, state);
  std::vector<Readings> readings(task.windows.size());
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const Experiment& e = task.experiments[task.windows[w].experiment];
    const Window& window = e.windows[task.windows[w].window];
    readings[w] = predict(e, window, window.end, hypothesis, z, state[w]);
    if (!response.empty()) take_base_out(readings[w], task, w, *response[w]);
  });
  return readings;
}

}  // namespace stickslip::diagnosis
