// SPDX-License-Identifier: Apache-2.0
// Dual numbers: forward-mode automatic differentiation, so that every equation is written once and
// yields exact Jacobians.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace stickslip::physics {

/// a + sum_i d[i] eps_i with eps_i eps_j = 0: a value and its derivatives in `directions`
/// directions. Values are double and do not depend on the derivatives, which are single precision:
/// sufficient for the steps of a fit, in two thirds of the time.
struct Dual {
  static constexpr int directions = 16;
  using Slope = float;
  using Derivatives = Eigen::Array<Slope, directions, 1>;

  double a = 0.0;
  Derivatives d = Derivatives::Zero();

  Dual() = default;
  Dual(double value) : a(value) {}  // NOLINT(google-explicit-constructor): a constant is a Dual
  Dual(double value, const Derivatives& derivatives) : a(value), d(derivatives) {}
  static Slope slope(double value) { return static_cast<Slope>(value); }

  Dual& operator+=(const Dual& o) {
    a += o.a;
    d += o.d;
    return *this;
  }
  Dual& operator-=(const Dual& o) {
    a -= o.a;
    d -= o.d;
    return *this;
  }
  Dual& operator*=(const Dual& o) {
    d = d * slope(o.a) + o.d * slope(a);
    a *= o.a;
    return *this;
  }
  Dual& operator*=(double s) {
    a *= s;
    d *= slope(s);
    return *this;
  }
};

inline Dual operator-(const Dual& x) { return {-x.a, -x.d}; }
inline Dual operator+(const Dual& x, const Dual& y) { return {x.a + y.a, x.d + y.d}; }
inline Dual operator+(const Dual& x, double y) { return {x.a + y, x.d}; }
inline Dual operator+(double x, const Dual& y) { return {x + y.a, y.d}; }
inline Dual operator-(const Dual& x, const Dual& y) { return {x.a - y.a, x.d - y.d}; }
inline Dual operator-(const Dual& x, double y) { return {x.a - y, x.d}; }
inline Dual operator-(double x, const Dual& y) { return {x - y.a, -y.d}; }
inline Dual operator*(const Dual& x, const Dual& y) {
  return {x.a * y.a, x.d * Dual::slope(y.a) + y.d * Dual::slope(x.a)};
}
inline Dual operator*(const Dual& x, double y) { return {x.a * y, x.d * Dual::slope(y)}; }
inline Dual operator*(double x, const Dual& y) { return {x * y.a, y.d * Dual::slope(x)}; }
inline Dual operator/(const Dual& x, const Dual& y) {
  const double inverse = 1.0 / y.a;
  const double quotient = x.a * inverse;
  return {quotient, (x.d - y.d * Dual::slope(quotient)) * Dual::slope(inverse)};
}
inline Dual operator/(const Dual& x, double y) { return x * (1.0 / y); }
inline Dual operator/(double x, const Dual& y) { return Dual(x) / y; }

inline bool operator<(const Dual& x, const Dual& y) { return x.a < y.a; }
inline bool operator>(const Dual& x, const Dual& y) { return x.a > y.a; }
inline bool operator<(const Dual& x, double y) { return x.a < y; }
inline bool operator>(const Dual& x, double y) { return x.a > y; }

inline Dual sqrt(const Dual& x) {
  const double root = std::sqrt(x.a);
  return {root, x.d * Dual::slope(0.5 / root)};
}
inline Dual exp(const Dual& x) {
  const double e = std::exp(x.a);
  return {e, x.d * Dual::slope(e)};
}
inline Dual log(const Dual& x) { return {std::log(x.a), x.d * Dual::slope(1.0 / x.a)}; }
inline Dual sin(const Dual& x) { return {std::sin(x.a), x.d * Dual::slope(std::cos(x.a))}; }
inline Dual cos(const Dual& x) { return {std::cos(x.a), x.d * Dual::slope(-std::sin(x.a))}; }
inline Dual tanh(const Dual& x) {
  const double t = std::tanh(x.a);
  return {t, x.d * Dual::slope(1.0 - t * t)};
}
inline Dual abs(const Dual& x) { return x.a < 0.0 ? -x : x; }
inline Dual pow(const Dual& x, const Dual& y) { return exp(y * log(x)); }

/// The plain value of a number, with or without derivatives.
inline double value_of(double x) { return x; }
inline double value_of(const Dual& x) { return x.a; }

}  // namespace stickslip::physics
