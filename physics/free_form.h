// SPDX-License-Identifier: Apache-2.0
// Free-form effects: a force, a friction factor or a load factor as a piecewise linear function of
// one quantity, with eight knots over the range that the recording visits and constant beyond it.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "physics/effect.h"

namespace stickslip::physics {

/// The abscissa of a free-form effect.
enum class FreeFormOver { displacement, velocity, time, load };
/// The quantity that it changes.
enum class FreeFormOf { force, friction, load };

/// The description of one free-form effect; texts have static storage.
struct FreeFormCard {
  std::string_view id;
  FreeFormOf of = FreeFormOf::force;
  FreeFormOver over = FreeFormOver::displacement;
  std::string_view name;
  std::string_view sentence;
  std::string_view equation;
  std::string_view experiment;
};

class FreeForm final : public EffectOf<FreeForm> {
 public:
  explicit FreeForm(const FreeFormCard& card);

  const Card& card() const override { return card_; }
  bool can_be_missing_from(const Model& model) const override;
  std::vector<std::vector<double>> starts(const Scales& scales) const override;
  std::string statement(std::span<const double> p, const Place& /*place*/) const override;
  unsigned hooks() const override;

  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    return height(abscissa(at), p);
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* /*s*/) const {
    const T factor = 1.0 + height(abscissa(at), p);
    f.mu = f.mu * (factor > 0.0 ? factor : T(0.0));
  }
  template <class T>
  void scale_load_of(T& load, const OperatingPoint<T>& at, const T* p, const T* /*s*/) const {
    load = load * (1.0 + height(abscissa(at), p));
  }

 private:
  static constexpr int knots = 8;

  /// Linear interpolation between the knots around `u`.
  template <class T>
  static T height(const T& u, const T* p) {
    const double low = value_of(p[knots]);
    const double high = value_of(p[knots + 1]);
    const T position = (u - low) * ((knots - 1) / std::max(high - low, 1.0e-12));
    const double at = value_of(position);
    if (!(at > 0.0)) return p[0];
    if (!(at < knots - 1.0)) return p[knots - 1];
    const auto left = static_cast<int>(at);
    const T share = position - static_cast<double>(left);
    return p[left] + (p[left + 1] - p[left]) * share;
  }

  template <class T>
  T abscissa(const OperatingPoint<T>& at) const {
    switch (over_) {
      case FreeFormOver::displacement:
        return at.x;
      case FreeFormOver::velocity:
        return of_ == FreeFormOf::force ? at.v : at.slip;
      case FreeFormOver::time:
        return T(at.time_s);
      case FreeFormOver::load:
        return at.load;
    }
    return at.x;
  }

  FreeFormOf of_;
  FreeFormOver over_;
  Card card_;
};

}  // namespace stickslip::physics
