// SPDX-License-Identifier: Apache-2.0
// An effect of the user's own: a formula of a model file in place of a file in physics/effects/.
// To every other room it is an effect like those of the catalogue.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "physics/effect.h"
#include "physics/formula.h"
#include "physics/model.h"

namespace stickslip::physics {

/// The quantity that a formula yields, by the key that it stands under.
enum class FormulaQuantity {
  force,     ///< a force on the mass against +x [N], added to the others
  friction,  ///< the coefficient of friction (in N without a normal load), from the declared mu
  load,      ///< the normal load [N], from the declared N
  reading,   ///< the reading of a channel, from the one r that its declared chain yields
};

/// The key of a formula: "force"; of a reading the channel follows it.
std::string_view name_of(FormulaQuantity quantity);
Relation relation_of(FormulaQuantity quantity);

/// A state of its own, which is 0 at the beginning: its rate is a formula. It stays within
/// `within`, a formula of the parameters; empty: unbounded.
struct FormulaState {
  std::string name;
  std::string rate;
  std::string within = {};
  std::string unit = {};  ///< empty: not given
  double size = 0.0;      ///< typical magnitude, of which a diagnosis begins; 0: unknown

  friend bool operator==(const FormulaState&, const FormulaState&) = default;
};

struct FormulaParameter {
  std::string name;
  std::string unit = {};  ///< empty: not given

  friend bool operator==(const FormulaParameter&, const FormulaParameter&) = default;
};

inline constexpr int max_formula_states = 2;

/// A formula as a model file states it.
struct FormulaDeclaration {
  std::string id;
  FormulaQuantity quantity = FormulaQuantity::force;
  std::optional<Channel> channel;  ///< of a reading
  std::string text;
  std::vector<FormulaParameter> parameters;  ///< in the order of their names
  std::vector<FormulaState> states;

  friend bool operator==(const FormulaDeclaration&, const FormulaDeclaration&) = default;
};

/// The part of the model around a formula on which its units depend.
struct FormulaSurroundings {
  bool dimensionless = false;  ///< every unit is 1
  /// A normal load is declared, so that mu is a pure number; empty: unknown.
  std::optional<bool> loaded = {};
};

/// A declaration that cannot be used.
struct FormulaRejection : std::runtime_error {
  FormulaRejection(std::string key_, std::optional<std::size_t> offset_, const std::string& message)
      : std::runtime_error(message), key(std::move(key_)), offset(offset_) {}
  std::string key;  ///< path within the table: "force", "states.z.rate", "parameters.c1.unit"
  std::optional<std::size_t> offset;  ///< byte of the text at that key, from 0
};

class FormulaEffect final : public EffectOf<FormulaEffect>,
                            public std::enable_shared_from_this<FormulaEffect> {
 public:
  /// `start`: where an estimate of each parameter begins, with its prior standard deviation (0:
  /// none). Throws FormulaRejection.
  static std::shared_ptr<const FormulaEffect> make(FormulaDeclaration declaration,
                                                   const std::map<std::string, Parameter>& start,
                                                   const FormulaSurroundings& surroundings);

  const FormulaDeclaration& declaration() const { return declaration_; }
  std::shared_ptr<const FormulaEffect> own_formula() const override { return shared_from_this(); }

  const Card& card() const override { return card_; }
  bool can_be_missing_from(const Model& model) const override;
  bool acts_on(const Place& place) const override {
    return place.channel == declaration_.channel && !place.from;
  }
  std::vector<std::vector<double>> starts(const Scales& scales) const override;
  std::string statement(std::span<const double> p, const Place& /*place*/) const override;
  unsigned hooks() const override;
  int state_count() const override { return static_cast<int>(rates_.size()); }
  StateSize state_size(int index, std::span<const double> p, const Scales& scales) const override;

  template <class T>
  T force_of(const OperatingPoint<T>& at, const T* p, const T* s) const {
    return value_of_formula(*law_, at, at.load, p, s);
  }
  template <class T>
  void scale_friction_of(FrictionFactors<T>& f, const OperatingPoint<T>& at, const T* p,
                         const T* s) const {
    f.mu = value_of_formula(*law_, at, f.mu, p, s);
  }
  template <class T>
  void scale_load_of(T& load, const OperatingPoint<T>& at, const T* p, const T* s) const {
    load = value_of_formula(*law_, at, load, p, s);
  }
  template <class T>
  void distort_of(T& reading, const T* p) const {
    reading = value_of_formula(*law_, OperatingPoint<T>{}, reading, p, static_cast<T*>(nullptr));
  }
  template <class T>
  void rates_of(T* rate, const OperatingPoint<T>& at, const T* p, const T* s) const {
    for (std::size_t i = 0; i < rates_.size(); ++i) {
      rate[i] = value_of_formula(rates_[i], at, at.load, p, s);
    }
  }
  template <class T>
  void confine_of(T* s, const T* p) const {
    for (std::size_t i = 0; i < bounds_.size(); ++i) {
      if (!bounds_[i]) continue;
      const T most = value_of_formula(*bounds_[i], OperatingPoint<T>{}, p[0], p, s);
      if (s[i] > most) s[i] = most;
      if (s[i] < -most) s[i] = -most;
    }
  }

 private:
  FormulaEffect(FormulaDeclaration declaration, const std::map<std::string, Parameter>& start);
  void compile(const FormulaSurroundings& surroundings);
  void make_card();
  Formula compiled(const std::string& key, const std::string& text) const;
  /// `own`: the quantity that the formula replaces.
  template <class T>
  T value_of_formula(const Formula& formula, const OperatingPoint<T>& at, const T& own, const T* p,
                     const T* s) const;
  double law_at(std::size_t point, std::span<const double> p, double& unchanged) const;
  std::optional<std::size_t> strength() const;

  FormulaDeclaration declaration_;
  std::vector<Parameter> start_;  // in the order of the card
  std::vector<std::string> symbols_;
  std::optional<Formula> law_;
  std::vector<Formula> rates_;
  std::vector<std::optional<Formula>> bounds_;
  std::vector<bool> lengths_;  // by state: true if its unit is m
  std::string equation_, name_, sentence_;
  std::vector<ParameterCard> parameters_;
  Card card_;
};

}  // namespace stickslip::physics
