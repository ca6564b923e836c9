// SPDX-License-Identifier: Apache-2.0
// Formulas that a person writes: parsed once into a short program, which is evaluated for plain
// numbers and for numbers with derivatives, without allocation
// (docs/decisions/formulas-by-pegtl.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::physics {

/// A formula that cannot be used, with the place of the reason.
class FormulaError : public std::runtime_error {
 public:
  /// `offset`: byte of the formula, from 0.
  FormulaError(std::size_t offset, const std::string& message)
      : std::runtime_error(message), offset_(offset) {}
  std::size_t offset() const { return offset_; }

 private:
  std::size_t offset_;
};

enum class Operator : std::uint8_t {
  constant,
  negate,
  add,
  subtract,
  multiply,
  divide,
  power,
  add_number,    ///< left + number
  times_number,  ///< left number
  over_number,   ///< left / number
  number_minus,  ///< number - left
  number_over,   ///< number / left
  whole_power,   ///< left ^ number, a whole number from 2 to 16
  number_power,  ///< left ^ number
  abs,
  sign,
  exp,
  log,
  sqrt,
  sin,
  cos,
  tan,
  tanh,
  min,
  max,
};

/// A program of at most max_formula_operations, each on results before it. Immutable.
class Formula {
 public:
  /// One operation. Operands are slots: symbols first, then the results in their order.
  struct Operation {
    Operator op = Operator::constant;
    std::uint8_t left = 0;
    std::uint8_t right = 0;
    double number = 0.0;
    std::size_t offset = 0;  ///< where it stands in the text

    bool same_as(const Operation& o) const {
      return op == o.op && left == o.left && right == o.right && number == o.number;
    }
  };

  /// `symbols`: names that may stand in the text, at most max_formula_symbols. Throws FormulaError.
  Formula(std::string_view text, std::span<const std::string> symbols);

  /// The value; `symbols` in the order of the constructor's, those that are not used() may be null.
  /// Outside the domain of a function it is not finite. Defined for double and Dual.
  template <class T>
  T value(const T* const* symbols) const;

  bool uses(std::size_t symbol) const;
  std::size_t symbol_count() const { return symbol_count_; }
  std::span<const Operation> operations() const { return operations_; }
  /// Slot of the formula's value.
  std::size_t result() const { return result_; }

 private:
  std::size_t symbol_count_ = 0;
  std::size_t result_ = 0;
  std::vector<std::uint8_t> used_;
  std::vector<Operation> operations_;
};

inline constexpr std::size_t max_formula_symbols = 32;
inline constexpr std::size_t max_formula_operations = 96;
inline constexpr std::size_t max_formula_length = 1000;

/// Names of the functions, for messages and documents.
std::string formula_functions();
/// True for the name of a function, which no symbol can have.
bool is_formula_function(std::string_view name);

}  // namespace stickslip::physics
