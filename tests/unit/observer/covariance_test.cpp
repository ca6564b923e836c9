// SPDX-License-Identifier: Apache-2.0
// Time and measurement update of covariance and sensitivities, compared with dense matrices.
#include "observer/covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <vector>

namespace stickslip::observer {
namespace {

using Dense = Eigen::MatrixXd;

class CovarianceOfSize : public testing::TestWithParam<int> {
 protected:
  double gauss() { return gauss_(random_); }

  Dense dense_of(const Covariance& p) const {
    Dense out(p.count(), p.count());
    for (int i = 0; i < p.count(); ++i) {
      for (int j = 0; j < p.count(); ++j) out(i, j) = p(i, j);
    }
    return out;
  }
  void fill(Covariance& p) {
    const Dense root = Dense::NullaryExpr(p.count(), p.count(), [this] { return gauss(); });
    const Dense square = root * root.transpose();
    for (int i = 0; i < p.count(); ++i) {
      for (int j = 0; j <= i; ++j) p.set(i, j, square(i, j));
    }
  }
  // Two shared sums, of which the second uses the first, and rows of a few states and sums.
  Transition transition(int count) {
    Transition f(count);
    const auto state = [&] { return static_cast<int>(random_() % static_cast<unsigned>(count)); };
    for (int sum = 0; sum < 2; ++sum) {
      f.begin_shared();
      for (int i = 0; i < 3; ++i) f.add(state(), gauss());
      if (sum == 1) f.add_shared(0, gauss());
    }
    for (int row = 0; row < count; ++row) {
      f.begin_row();
      f.add(row, 1.0);
      if (row % 3 == 0) f.add(state(), gauss());
      if (row % 2 == 0) f.add_shared(row % 4 == 0 ? 0 : 1, gauss());
    }
    return f;
  }

  std::mt19937 random_{1};
  std::normal_distribution<double> gauss_;
};

TEST_P(CovarianceOfSize, PropagationEqualsFPFt) {
  const int count = GetParam();
  Covariance p(count);
  fill(p);
  const Dense before = dense_of(p);
  const Transition f = transition(count);
  const Dense dense = f.dense();
  p.propagate(f);
  const Dense expected = dense * before * dense.transpose();
  EXPECT_LT((dense_of(p) - expected).norm(), 1.0e-12 * expected.norm());
  p.propagate(f);
  const Dense again = dense * expected * dense.transpose();
  EXPECT_LT((dense_of(p) - again).norm(), 1.0e-12 * again.norm());
}

TEST_P(CovarianceOfSize, MeasurementUpdateEqualsJosephForm) {
  const int count = GetParam();
  Covariance p(count);
  fill(p);
  for (int reading = 0; reading < count; reading += 3) {
    const Dense before = dense_of(p);
    const double noise = 0.3;
    Covariance::States column;
    Covariance::States gain;
    p.column(reading, column);
    Eigen::VectorXd k(count);
    for (int i = 0; i < count; ++i) {
      ASSERT_EQ(column[i], before(i, reading));
      k[i] = gain[i] = i % 5 == 4 ? 0.0 : column[i] / (column[reading] + noise);
    }
    p.correct(gain, column, column[reading] + noise);
    Dense rest = Dense::Identity(count, count);
    rest.col(reading) -= k;
    const Dense expected = rest * before * rest.transpose() + noise * k * k.transpose();
    EXPECT_LT((dense_of(p) - expected).norm(), 1.0e-12 * before.norm());
  }
}

// Three parameters, and more than a register holds.
TEST_P(CovarianceOfSize, SensitivitiesFollowTheTransitionAndTheGain) {
  const int count = GetParam();
  for (const int parameters : {3, 4, 9, 57}) {
    Covariance p(count, parameters);
    fill(p);
    Dense s(count, padded(parameters));
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < s.cols(); ++k) {
        s(i, k) = p.sensitivity(i, k / parameter_lanes)[k % parameter_lanes] =
            k < parameters ? gauss() : 0.0;
      }
    }
    Transition f = transition(count);
    f.set_width(p.width());
    const Dense covariance = f.dense() * dense_of(p) * f.dense().transpose();
    p.propagate(f);
    EXPECT_LT((dense_of(p) - covariance).norm(), 1.0e-12 * covariance.norm());
    s = f.dense() * s;

    std::vector<ParameterLanes> error(static_cast<std::size_t>(p.groups()));
    Eigen::VectorXd e(s.cols());
    for (int k = 0; k < s.cols(); ++k) {
      e[k] = error[static_cast<std::size_t>(k / parameter_lanes)][k % parameter_lanes] = gauss();
    }
    Covariance::States column, gain;
    p.column(0, column);
    const double variance = column[0] + 0.3 + e.squaredNorm();
    p.optimal_gain(column, error, variance, gain);
    const Eigen::VectorXd expected = (covariance.col(0) + s * e) / variance;
    Eigen::VectorXd k(count);
    for (int i = 0; i < count; ++i) k[i] = gain[i];
    EXPECT_LT((k - expected).norm(), 1.0e-12 * expected.norm());
    p.correct(gain, column, column[0] + 0.3, error);
    s -= k * e.transpose();
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < s.cols(); ++j) {
        EXPECT_NEAR(p.sensitivity(i, j / parameter_lanes)[j % parameter_lanes], s(i, j),
                    1.0e-12 * s.norm());
      }
    }
    Dense rest = Dense::Identity(count, count);
    rest.col(0) -= k;
    const Dense corrected = rest * covariance * rest.transpose() + 0.3 * k * k.transpose();
    EXPECT_LT((dense_of(p) - corrected).norm(), 1.0e-12 * covariance.norm());
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, CovarianceOfSize, testing::Values(1, 4, 7, 16, 29, 30, 43, 44));

}  // namespace
}  // namespace stickslip::observer
