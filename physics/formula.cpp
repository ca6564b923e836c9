// SPDX-License-Identifier: Apache-2.0
#include "physics/formula.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <new>
#include <numbers>
#include <optional>
#include <tao/pegtl.hpp>

#include "physics/dual.h"
#include "physics/number_text.h"
#include "physics/spelling.h"

namespace stickslip::physics {

namespace {

constexpr std::size_t deepest = 64;  // parentheses within parentheses
constexpr double largest_whole_power = 16.0;
constexpr std::size_t max_slots = max_formula_symbols + max_formula_operations;

struct Function {
  std::string_view name;
  Operator op;
  std::size_t arguments = 1;
};

constexpr std::array functions = {
    Function{"abs", Operator::abs},    Function{"sign", Operator::sign},
    Function{"exp", Operator::exp},    Function{"log", Operator::log},
    Function{"sqrt", Operator::sqrt},  Function{"sin", Operator::sin},
    Function{"cos", Operator::cos},    Function{"tan", Operator::tan},
    Function{"tanh", Operator::tanh},  Function{"min", Operator::min, 2},
    Function{"max", Operator::max, 2}, Function{"pow", Operator::power, 2},
};

const Function* find_function(std::string_view name) {
  const auto* const found = std::find_if(functions.begin(), functions.end(),
                                         [name](const Function& f) { return f.name == name; });
  return found == functions.end() ? nullptr : found;
}

// ---- Arithmetic, for double and Dual -------------------------------------------------------

double whole_power(double x, int n) {
  double out = x;
  for (int i = 1; i < n; ++i) out *= x;
  return out;
}
Dual whole_power(const Dual& x, int n) {
  const double below = whole_power(x.a, n - 1);
  return {below * x.a, x.d * Dual::slope(n * below)};
}

// The slope of a power or a root is infinite at 0; a fit goes on with 0 there.
double finite_or_zero(double slope) { return std::isfinite(slope) ? slope : 0.0; }

double number_power(double x, double y) { return std::pow(x, y); }
Dual number_power(const Dual& x, double y) {
  return {std::pow(x.a, y), x.d * Dual::slope(finite_or_zero(y * std::pow(x.a, y - 1.0)))};
}

double power_of(double x, double y) { return std::pow(x, y); }
Dual power_of(const Dual& x, const Dual& y) {
  const double value = std::pow(x.a, y.a);
  const double by_x = finite_or_zero(y.a * std::pow(x.a, y.a - 1.0));
  const double by_y = x.a > 0.0 ? value * std::log(x.a) : 0.0;
  return {value, x.d * Dual::slope(by_x) + y.d * Dual::slope(by_y)};
}

double root_of(double x) { return std::sqrt(x); }
Dual root_of(const Dual& x) {
  const double root = std::sqrt(x.a);
  return {root, x.d * Dual::slope(finite_or_zero(0.5 / root))};
}

double tangent_of(double x) { return std::tan(x); }
Dual tangent_of(const Dual& x) {
  const double t = std::tan(x.a);
  return {t, x.d * Dual::slope(1.0 + t * t)};
}

template <class T>
T sign_of(const T& x) {
  const double value = value_of(x);
  return T(value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0));
}

// `a`, `b`: the operands, where the operation has them.
template <class T>
T result_of(const Formula::Operation& o, const T* a, const T* b) {
  using std::abs;
  using std::cos;
  using std::exp;
  using std::log;
  using std::sin;
  using std::tanh;
  switch (o.op) {
    case Operator::constant:
      return T(o.number);
    case Operator::negate:
      return -*a;
    case Operator::add:
      return *a + *b;
    case Operator::subtract:
      return *a - *b;
    case Operator::multiply:
      return *a * *b;
    case Operator::divide:
      return *a / *b;
    case Operator::power:
      return power_of(*a, *b);
    case Operator::add_number:
      return *a + o.number;
    case Operator::times_number:
      return *a * o.number;
    case Operator::over_number:
      return *a / o.number;
    case Operator::number_minus:
      return o.number - *a;
    case Operator::number_over:
      return o.number / *a;
    case Operator::whole_power:
      return whole_power(*a, static_cast<int>(o.number));
    case Operator::number_power:
      return number_power(*a, o.number);
    case Operator::abs:
      return abs(*a);
    case Operator::sign:
      return sign_of(*a);
    case Operator::exp:
      return exp(*a);
    case Operator::log:
      return log(*a);
    case Operator::sqrt:
      return root_of(*a);
    case Operator::sin:
      return sin(*a);
    case Operator::cos:
      return cos(*a);
    case Operator::tan:
      return tangent_of(*a);
    case Operator::tanh:
      return tanh(*a);
    case Operator::min:
      return *b < *a ? *b : *a;
    case Operator::max:
      return *b > *a ? *b : *a;
  }
  return T(0.0);
}

// ---- From the text to a program ----------------------------------------------------------------

// An operand: a number, or the slot of a symbol or a result.
struct Operand {
  std::optional<double> number;
  std::uint8_t slot = 0;
};

struct Reference {
  std::string name;
  std::size_t offset = 0;
  std::optional<std::size_t> operands_before;  // of a function: operands beneath its arguments
};

class Builder {
 public:
  explicit Builder(std::span<const std::string> symbols) : symbols_(symbols) {}

  void number(std::string_view text, std::size_t offset) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) {
      throw FormulaError(offset, "the number " + std::string(text) + " is out of range");
    }
    operands_.push_back({value, 0});
  }

  void enter(std::size_t offset) {
    if (++depth_ > deepest) {
      throw FormulaError(offset,
                         "more than " + std::to_string(deepest) + " parentheses within each other");
    }
  }
  void leave() { --depth_; }

  void begin_reference(std::string_view name, std::size_t offset) {
    references_.push_back({std::string(name), offset, std::nullopt});
  }
  void begin_arguments() { references_.back().operands_before = operands_.size(); }
  void end_reference() {
    const Reference reference = std::move(references_.back());
    references_.pop_back();
    if (reference.operands_before) {
      call(reference);
    } else {
      symbol(reference);
    }
  }

  void unary(Operator op, std::size_t offset) {
    const Operand left = pop();
    if (left.number) {
      operands_.push_back({result_of<double>({op, 0, 0, 0.0, 0}, &*left.number, nullptr), 0});
    } else {
      emit({op, left.slot, 0, 0.0, offset});
    }
  }

  void binary(Operator op, std::size_t offset) {
    const Operand right = pop();
    const Operand left = pop();
    if (left.number && right.number) {
      operands_.push_back(
          {result_of<double>({op, 0, 0, 0.0, 0}, &*left.number, &*right.number), 0});
    } else if (const auto shorter = with_number(op, left, right, offset)) {
      emit(*shorter);
    } else {
      emit({op, slot_of(left, offset), slot_of(right, offset), 0.0, offset});
    }
  }

  std::size_t finish() { return slot_of(pop(), 0); }
  std::vector<Formula::Operation> take() { return std::move(operations_); }

 private:
  Operand pop() {
    const Operand top = operands_.back();
    operands_.pop_back();
    return top;
  }

  void symbol(const Reference& reference) {
    const auto at = std::find(symbols_.begin(), symbols_.end(), reference.name);
    if (at != symbols_.end()) {
      operands_.push_back(
          {std::nullopt, static_cast<std::uint8_t>(std::distance(symbols_.begin(), at))});
    } else if (reference.name == "pi") {
      operands_.push_back({std::numbers::pi, 0});
    } else {
      throw FormulaError(reference.offset, unknown_symbol(reference.name));
    }
  }

  std::string unknown_symbol(const std::string& name) const {
    if (find_function(name) != nullptr) return name + " is a function: expected " + name + "(...)";
    const std::vector<std::string> known(symbols_.begin(), symbols_.end());
    const std::string meant = nearest(name, known);
    std::string list;
    for (const std::string& each : known) list += (list.empty() ? "" : ", ") + each;
    return "unknown symbol " + name +
           (meant.empty() ? "; expected one of " + list : ": did you mean " + meant + "?");
  }

  void call(const Reference& reference) {
    const Function* function = find_function(reference.name);
    if (function == nullptr) {
      std::vector<std::string> names;
      for (const Function& each : functions) names.emplace_back(each.name);
      const std::string meant = nearest(reference.name, names);
      throw FormulaError(reference.offset,
                         "unknown function " + reference.name +
                             (meant.empty() ? "; expected one of " + formula_functions()
                                            : ": did you mean " + meant + "?"));
    }
    const std::size_t given = operands_.size() - *reference.operands_before;
    if (given != function->arguments) {
      throw FormulaError(reference.offset, reference.name + " takes " +
                                               counted(function->arguments, "argument") +
                                               ", found " + std::to_string(given));
    }
    if (given == 2) {
      binary(function->op, reference.offset);
    } else {
      unary(function->op, reference.offset);
    }
  }

  // The operation with a number in place of one operand, where there is one.
  static std::optional<Formula::Operation> with_number(Operator op, const Operand& left,
                                                       const Operand& right, std::size_t offset) {
    const auto made = [offset](Operator shorter, const Operand& operand, double number) {
      return Formula::Operation{shorter, operand.slot, 0, number, offset};
    };
    if (right.number) {
      const double c = *right.number;
      if (op == Operator::add) return made(Operator::add_number, left, c);
      if (op == Operator::subtract) return made(Operator::add_number, left, -c);
      if (op == Operator::multiply) return made(Operator::times_number, left, c);
      if (op == Operator::divide) return made(Operator::over_number, left, c);
      if (op == Operator::power) {
        const bool whole = c == std::floor(c) && c >= 2.0 && c <= largest_whole_power;
        return made(whole ? Operator::whole_power : Operator::number_power, left, c);
      }
    }
    if (left.number) {
      const double c = *left.number;
      if (op == Operator::add) return made(Operator::add_number, right, c);
      if (op == Operator::subtract) return made(Operator::number_minus, right, c);
      if (op == Operator::multiply) return made(Operator::times_number, right, c);
      if (op == Operator::divide) return made(Operator::number_over, right, c);
    }
    return std::nullopt;
  }

  std::uint8_t slot_of(const Operand& operand, std::size_t offset) {
    if (!operand.number) return operand.slot;
    emit({Operator::constant, 0, 0, *operand.number, offset});
    return pop().slot;
  }

  // Appends an operation, unless its result is there already.
  void emit(const Formula::Operation& operation) {
    const auto same =
        std::find_if(operations_.begin(), operations_.end(),
                     [&](const Formula::Operation& each) { return each.same_as(operation); });
    if (same == operations_.end() && operations_.size() == max_formula_operations) {
      throw FormulaError(operation.offset, "has more than " +
                                               std::to_string(max_formula_operations) +
                                               " operations: split it into several terms");
    }
    const auto position = static_cast<std::size_t>(std::distance(operations_.begin(), same));
    operands_.push_back({std::nullopt, static_cast<std::uint8_t>(symbols_.size() + position)});
    if (same == operations_.end()) operations_.push_back(operation);
  }

  std::span<const std::string> symbols_;
  std::vector<Operand> operands_;
  std::vector<Reference> references_;
  std::vector<Formula::Operation> operations_;
  std::size_t depth_ = 0;
};

// ---- Grammar -----------------------------------------------------------------------------------

namespace grammar {

namespace p = tao::pegtl;

struct blank : p::star<p::space> {};
template <char c>
struct mark : p::seq<p::one<c>, blank> {};

struct exponent : p::seq<p::one<'e', 'E'>, p::opt<p::one<'+', '-'>>, p::plus<p::digit>> {};
struct decimals : p::seq<p::one<'.'>, p::star<p::digit>> {};
struct fraction : p::seq<p::one<'.'>, p::plus<p::digit>> {};
struct number
    : p::seq<p::sor<p::seq<p::plus<p::digit>, p::opt<decimals>>, fraction>, p::opt<exponent>> {};
struct name : p::identifier {};

struct operand;
struct sum;
struct open : mark<'('> {};
struct close : mark<')'> {};
struct open_arguments : mark<'('> {};
struct arguments : p::if_must<open_arguments, p::list_must<sum, mark<','>>, close> {};
struct reference : p::seq<name, blank, p::opt<arguments>> {};
struct parenthesised : p::if_must<open, sum, close> {};
struct raised : p::if_must<mark<'^'>, operand> {};
struct power : p::seq<p::sor<p::seq<number, blank>, reference, parenthesised>, p::opt<raised>> {};
struct negated : p::if_must<mark<'-'>, operand> {};
struct plus_sign : p::if_must<mark<'+'>, operand> {};
struct operand : p::sor<negated, plus_sign, power> {};
struct times : p::if_must<mark<'*'>, operand> {};
struct over : p::if_must<mark<'/'>, operand> {};
struct product : p::seq<operand, p::star<p::sor<times, over>>> {};
struct increased : p::if_must<mark<'+'>, product> {};
struct decreased : p::if_must<mark<'-'>, product> {};
struct sum : p::seq<product, p::star<p::sor<increased, decreased>>> {};
struct end : p::eof {};
struct first : sum {};
struct whole : p::seq<blank, p::must<first>, p::must<end>> {};

template <class Rule>
inline constexpr const char* expected = nullptr;
constexpr const char* an_operand = "expected a number, a symbol, a function or a parenthesis";
template <>
inline constexpr const char* expected<operand> = an_operand;
template <>
inline constexpr const char* expected<product> = an_operand;
template <>
inline constexpr const char* expected<sum> = an_operand;
template <>
inline constexpr const char* expected<first> = an_operand;
template <>
inline constexpr const char* expected<p::list_must<sum, mark<','>>> = an_operand;
template <>
inline constexpr const char* expected<close> = "expected an operator or )";
template <>
inline constexpr const char* expected<end> = "expected an operator (+ - * / ^) or the end";

template <class Rule>
struct Control : p::normal<Rule> {
  template <class Input, class... States>
  [[noreturn]] static void raise(const Input& in, States&&... /*states*/) {
    throw FormulaError(in.position().byte,
                       expected<Rule> != nullptr ? expected<Rule> : "is not a formula");
  }
};

template <class Rule>
struct Action : p::nothing<Rule> {};

template <Operator op>
struct Binary {
  template <class Input>
  static void apply(const Input& in, Builder& builder) {
    builder.binary(op, in.position().byte);
  }
};
template <>
struct Action<increased> : Binary<Operator::add> {};
template <>
struct Action<decreased> : Binary<Operator::subtract> {};
template <>
struct Action<times> : Binary<Operator::multiply> {};
template <>
struct Action<over> : Binary<Operator::divide> {};
template <>
struct Action<raised> : Binary<Operator::power> {};

template <>
struct Action<negated> {
  template <class Input>
  static void apply(const Input& in, Builder& builder) {
    builder.unary(Operator::negate, in.position().byte);
  }
};
template <>
struct Action<number> {
  template <class Input>
  static void apply(const Input& in, Builder& builder) {
    builder.number(in.string_view(), in.position().byte);
  }
};
template <>
struct Action<name> {
  template <class Input>
  static void apply(const Input& in, Builder& builder) {
    builder.begin_reference(in.string_view(), in.position().byte);
  }
};
template <>
struct Action<open> {
  template <class Input>
  static void apply(const Input& in, Builder& builder) {
    builder.enter(in.position().byte);
  }
};
template <>
struct Action<open_arguments> {
  template <class Input>
  static void apply(const Input& in, Builder& builder) {
    builder.enter(in.position().byte);
    builder.begin_arguments();
  }
};
template <>
struct Action<close> {
  static void apply0(Builder& builder) { builder.leave(); }
};
template <>
struct Action<reference> {
  static void apply0(Builder& builder) { builder.end_reference(); }
};

}  // namespace grammar

}  // namespace

std::string formula_functions() {
  std::string list;
  for (const Function& each : functions) {
    list += (list.empty() ? "" : ", ") + std::string(each.name);
  }
  return list;
}

bool is_formula_function(std::string_view name) { return find_function(name) != nullptr; }

Formula::Formula(std::string_view text, std::span<const std::string> symbols)
    : symbol_count_(symbols.size()) {
  if (symbols.size() > max_formula_symbols) {
    throw FormulaError(0, "more than " + std::to_string(max_formula_symbols) + " symbols");
  }
  if (text.size() > max_formula_length) {
    throw FormulaError(max_formula_length,
                       "is longer than " + std::to_string(max_formula_length) + " characters");
  }
  Builder builder(symbols);
  tao::pegtl::memory_input in(text.data(), text.size(), "");
  tao::pegtl::parse<grammar::whole, grammar::Action, grammar::Control>(in, builder);
  result_ = builder.finish();
  operations_ = builder.take();
  for (std::size_t symbol = 0; symbol < symbol_count_; ++symbol) {
    if (uses(symbol)) used_.push_back(static_cast<std::uint8_t>(symbol));
  }
}

bool Formula::uses(std::size_t symbol) const {
  const bool operand = std::any_of(operations_.begin(), operations_.end(), [&](const auto& o) {
    const bool binary = o.op == Operator::add || o.op == Operator::subtract ||
                        o.op == Operator::multiply || o.op == Operator::divide ||
                        o.op == Operator::power || o.op == Operator::min || o.op == Operator::max;
    return o.op != Operator::constant && (o.left == symbol || (binary && o.right == symbol));
  });
  return operand || result_ == symbol;
}

template <class T>
T Formula::value(const T* const* symbols) const {
  static_assert(std::is_trivially_destructible_v<T>);
  // Without initial values, which would take as long as a formula of ordinary length.
  alignas(T) std::array<std::byte, max_slots * sizeof(T)> memory;
  T* const slot = reinterpret_cast<T*>(memory.data());
  for (const std::uint8_t symbol : used_) new (slot + symbol) T(*symbols[symbol]);
  T* next = slot + symbol_count_;
  for (const Operation& operation : operations_) {
    new (next++) T(result_of(operation, slot + operation.left, slot + operation.right));
  }
  return slot[result_];
}

template double Formula::value(const double* const*) const;
template Dual Formula::value(const Dual* const*) const;

}  // namespace stickslip::physics
