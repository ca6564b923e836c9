// SPDX-License-Identifier: Apache-2.0
#include "physics/formula_effect.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <utility>

#include "physics/catalogue.h"
#include "physics/formula_units.h"
#include "physics/number_text.h"
#include "physics/rig.h"

namespace stickslip::physics {

namespace {

// The symbols of every formula; its states and parameters follow.
enum Symbol : std::size_t { x, v, w, t, load_n, base, own, symbol_count };

constexpr std::array<std::string_view, symbol_count> symbol_names = {"x", "v", "w", "t",
                                                                     "N", "b", ""};
// Of the quantity that a formula replaces, by FormulaQuantity; a force is added and replaces none.
constexpr std::array<std::string_view, 4> own_names = {"", "mu", "N", "r"};
constexpr std::string_view not_a_name = "(none)";

bool is_name(std::string_view text) {
  const auto letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
  const auto inner = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  return !text.empty() && letter(text.front()) && std::all_of(text.begin(), text.end(), inner);
}

bool is_reserved(std::string_view name) {
  const auto among = [name](const auto& names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  return name == "pi" || among(symbol_names) || among(own_names) || is_formula_function(name);
}

// Where a whole word begins in a text that has it.
std::size_t place_of_word(std::string_view text, std::string_view word) {
  const auto inner = [&](std::size_t at) {
    return at < text.size() &&
           (std::isalnum(static_cast<unsigned char>(text[at])) != 0 || text[at] == '_');
  };
  for (std::size_t at = text.find(word); at != std::string_view::npos;
       at = text.find(word, at + 1)) {
    if (!(at > 0 && inner(at - 1)) && !inner(at + word.size())) return at;
  }
  return 0;
}

// Why a symbol has no meaning in a formula of that quantity; empty where it has one.
std::string objection(FormulaQuantity quantity, std::size_t symbol) {
  switch (quantity) {
    case FormulaQuantity::friction:
      if (symbol != v) break;
      return "friction depends on the velocity across the contact, w, not on that of the mass, v: "
             "write w";
    case FormulaQuantity::load:
      if (symbol != w) break;
      return "the normal load is known before the velocity across the contact, w: write v";
    case FormulaQuantity::reading:
      if (symbol >= own) break;
      return "a reading depends on the true reading r and on parameters only";
    case FormulaQuantity::force:
      break;
  }
  return {};
}

std::optional<Dimension> unit_of_quantity(FormulaQuantity quantity, std::optional<Channel> channel,
                                          const FormulaSurroundings& surroundings) {
  switch (quantity) {
    case FormulaQuantity::force:
    case FormulaQuantity::load:
      return dimension_of("N");
    case FormulaQuantity::friction:
      if (!surroundings.loaded) return std::nullopt;
      return dimension_of(*surroundings.loaded ? "1" : "N");
    case FormulaQuantity::reading:
      return dimension_of(info(*channel).unit);
  }
  return std::nullopt;
}

void check_names(const FormulaDeclaration& declaration) {
  if (find_effect(declaration.id) != nullptr) {
    throw FormulaRejection(
        "id", std::nullopt,
        "\"" + declaration.id + "\" is an effect of the catalogue: give the formula another id");
  }
  if (!is_name(declaration.id)) {
    throw FormulaRejection("id", std::nullopt,
                           "expected letters, digits and _, found \"" + declaration.id + "\"");
  }
  std::vector<std::string> names;
  const auto check = [&](const std::string& key, const std::string& name) {
    if (!is_name(name)) {
      throw FormulaRejection(key, std::nullopt, "expected a name of letters, digits and _");
    }
    if (is_reserved(name)) {
      throw FormulaRejection(key, std::nullopt,
                             name + " has a meaning of its own in formulas: choose another name");
    }
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      throw FormulaRejection(key, std::nullopt, "is the name of a parameter, too");
    }
    names.push_back(name);
  };
  for (const FormulaParameter& each : declaration.parameters) {
    check("parameters." + each.name, each.name);
  }
  for (const FormulaState& each : declaration.states) check("states." + each.name, each.name);
}

void check_room(const FormulaDeclaration& declaration) {
  const bool reading = declaration.quantity == FormulaQuantity::reading;
  const auto most =
      static_cast<std::size_t>(reading ? max_characteristic_parameters : max_effect_parameters);
  if (declaration.parameters.size() > most) {
    throw FormulaRejection("parameters", std::nullopt,
                           "expected at most " + std::to_string(most) + ", found " +
                               std::to_string(declaration.parameters.size()));
  }
  const auto most_states = static_cast<std::size_t>(reading ? 0 : max_formula_states);
  if (declaration.states.size() > most_states) {
    throw FormulaRejection("states", std::nullopt,
                           reading ? std::string("a reading has no states of its own")
                                   : "expected at most " + std::to_string(most_states) +
                                         ", found " + std::to_string(declaration.states.size()));
  }
}

// ---- Units -------------------------------------------------------------------------------------

class UnitsOfDeclaration {
 public:
  UnitsOfDeclaration(const FormulaDeclaration& declaration, const FormulaSurroundings& around)
      : declaration_(declaration),
        quantity_unit_(unit_of_quantity(declaration.quantity, declaration.channel, around)) {
    for (const std::string_view unit : {"m", "m/s", "m/s", "s", "N", "m/s^2"}) {
      units_.push_back(dimension_of(unit));
    }
    units_.push_back(quantity_unit_);
    for (const FormulaState& each : declaration.states) {
      units_.push_back(declared("states." + each.name + ".unit", each.unit));
    }
    for (const FormulaParameter& each : declaration.parameters) {
      units_.push_back(declared("parameters." + each.name + ".unit", each.unit));
    }
  }

  // False where no unit is given: a formula of plain numbers is not checked.
  bool given() const { return given_; }

  // Units of states follow from those of their rates.
  void follow(std::span<const Formula> rates) {
    for (std::size_t pass = 0; pass < rates.size(); ++pass) {
      for (std::size_t i = 0; i < rates.size(); ++i) {
        auto& unit = units_[symbol_count + i];
        if (unit) continue;
        const auto rate = unit_at("states." + declaration_.states[i].name + ".rate", rates[i]);
        if (rate) unit = per_second(*rate, -1.0);
      }
    }
  }

  void check_law(const std::string& key, const Formula& law) const {
    expect(key, unit_at(key, law), quantity_unit_);
  }
  void check_state(std::size_t i, const Formula& rate, const std::optional<Formula>& bound) const {
    const std::string key = "states." + declaration_.states[i].name;
    const auto& unit = units_[symbol_count + i];
    const auto expected = unit ? std::optional(per_second(*unit, 1.0)) : std::nullopt;
    expect(key + ".rate", unit_at(key + ".rate", rate), expected);
    if (bound) expect(key + ".within", unit_at(key + ".within", *bound), unit);
  }

  bool is_length(std::size_t state) const {
    return units_[symbol_count + state] == dimension_of("m");
  }

 private:
  static Dimension per_second(Dimension unit, double times) {
    unit.exponent[2] -= times;
    return unit;
  }

  std::optional<Dimension> declared(const std::string& key, const std::string& unit) {
    if (unit.empty()) return std::nullopt;
    given_ = true;
    const auto dimension = dimension_of(unit);
    if (!dimension) {
      throw FormulaRejection(key, std::nullopt,
                             "expected SI units without a prefix, as in \"N s/m\", \"1/m^2\" or "
                             "\"1\", found \"" +
                                 unit + "\"");
    }
    return dimension;
  }

  std::optional<Dimension> unit_at(const std::string& key, const Formula& formula) const {
    try {
      return dimension_of(formula, units_);
    } catch (const FormulaError& error) {
      throw FormulaRejection(key, error.offset(), error.what());
    }
  }

  static void expect(const std::string& key, const std::optional<Dimension>& found,
                     const std::optional<Dimension>& expected) {
    if (!found || !expected || *found == *expected) return;
    throw FormulaRejection(
        key, 0, "has the unit " + unit_text(*found) + ", expected " + unit_text(*expected));
  }

  const FormulaDeclaration& declaration_;
  std::optional<Dimension> quantity_unit_;
  std::vector<std::optional<Dimension>> units_;  // of all symbols
  bool given_ = false;
};

}  // namespace

std::string_view name_of(FormulaQuantity quantity) {
  constexpr std::array<std::string_view, 4> names = {"force", "friction", "load", "reading"};
  return names[static_cast<std::size_t>(quantity)];
}

Relation relation_of(FormulaQuantity quantity) {
  switch (quantity) {
    case FormulaQuantity::force:
      return Relation::force_balance;
    case FormulaQuantity::friction:
      return Relation::friction_law;
    case FormulaQuantity::load:
      return Relation::normal_load;
    case FormulaQuantity::reading:
      return Relation::sensor;
  }
  return Relation::force_balance;
}

std::shared_ptr<const FormulaEffect> FormulaEffect::make(
    FormulaDeclaration declaration, const std::map<std::string, Parameter>& start,
    const FormulaSurroundings& surroundings) {
  check_names(declaration);
  check_room(declaration);
  std::shared_ptr<FormulaEffect> effect(new FormulaEffect(std::move(declaration), start));
  effect->compile(surroundings);
  effect->make_card();
  return effect;
}

FormulaEffect::FormulaEffect(FormulaDeclaration declaration,
                             const std::map<std::string, Parameter>& start)
    : declaration_(std::move(declaration)) {
  symbols_.assign(symbol_names.begin(), symbol_names.end());
  // N is a symbol already; a name in parentheses is none.
  const std::string_view replaced = own_names[static_cast<std::size_t>(declaration_.quantity)];
  symbols_[own] = replaced.empty() || replaced == "N" ? not_a_name : replaced;
  for (const FormulaState& each : declaration_.states) symbols_.push_back(each.name);
  for (const FormulaParameter& each : declaration_.parameters) {
    symbols_.push_back(each.name);
    const auto found = start.find(each.name);
    start_.push_back(found == start.end() ? Parameter{} : found->second);
  }
}

Formula FormulaEffect::compiled(const std::string& key, const std::string& text) const {
  try {
    return {text, symbols_};
  } catch (const FormulaError& error) {
    throw FormulaRejection(key, error.offset(), error.what());
  }
}

void FormulaEffect::compile(const FormulaSurroundings& surroundings) {
  std::string key(name_of(declaration_.quantity));
  if (declaration_.channel) key += '.' + std::string(info(*declaration_.channel).stem);
  law_ = compiled(key, declaration_.text);
  for (std::size_t symbol = 0; symbol < symbol_count; ++symbol) {
    if (!law_->uses(symbol)) continue;
    const std::string why = objection(declaration_.quantity, symbol);
    if (!why.empty()) {
      throw FormulaRejection(key, place_of_word(declaration_.text, symbols_[symbol]), why);
    }
  }
  for (const FormulaState& each : declaration_.states) {
    rates_.push_back(compiled("states." + each.name + ".rate", each.rate));
    if (each.within.empty()) {
      bounds_.emplace_back();
      continue;
    }
    const std::string at = "states." + each.name + ".within";
    bounds_.emplace_back(compiled(at, each.within));
    for (std::size_t symbol = 0; symbol < symbol_count + declaration_.states.size(); ++symbol) {
      if (!bounds_.back()->uses(symbol)) continue;
      throw FormulaRejection(at, place_of_word(each.within, symbols_[symbol]),
                             "a bound depends on parameters only");
    }
  }
  UnitsOfDeclaration units(declaration_, surroundings);
  units.follow(rates_);
  for (std::size_t i = 0; i < rates_.size(); ++i) lengths_.push_back(units.is_length(i));
  if (surroundings.dimensionless || !units.given()) return;
  units.check_law(key, *law_);
  for (std::size_t i = 0; i < rates_.size(); ++i) units.check_state(i, rates_[i], bounds_[i]);
}

void FormulaEffect::make_card() {
  constexpr double far = 1.0e12;
  for (std::size_t i = 0; i < declaration_.parameters.size(); ++i) {
    const FormulaParameter& each = declaration_.parameters[i];
    parameters_.push_back({.name = each.name,
                           .unit = each.unit.empty() ? std::string_view("SI") : each.unit,
                           .meaning = "a parameter of the formula",
                           .low = -far,
                           .high = far,
                           .fixed_default = std::nullopt,
                           .start_sigma = start_[i].sigma});
  }
  equation_ = std::string(name_of(declaration_.quantity));
  if (declaration_.channel) equation_ += '.' + std::string(info(*declaration_.channel).stem);
  equation_ += " = " + declaration_.text;
  for (const FormulaState& each : declaration_.states) {
    equation_ += ", " + each.name + "' = " + each.rate;
  }
  name_ = "formula " + declaration_.id;
  sentence_ = "The formula " + declaration_.id + " of the model file.";
  card_ = {.id = declaration_.id,
           .relation = relation_of(declaration_.quantity),
           .name = name_,
           .sentence = sentence_,
           .equation = equation_,
           .parameters = parameters_,
           .experiment = "runs in which what the formula depends on varies widely",
           .rivals = {},
           .strength = strength()};
}

bool FormulaEffect::can_be_missing_from(const Model& model) const {
  switch (declaration_.quantity) {
    case FormulaQuantity::force:
      return model.oscillator.excitation != Excitation::imposed;
    case FormulaQuantity::friction:
      return model.friction.law != FrictionLaw::none;
    case FormulaQuantity::load:
      return model.normal_load && model.normal_load->law != NormalLoadLaw::measured;
    case FormulaQuantity::reading:
      return true;
  }
  return false;
}

std::vector<std::vector<double>> FormulaEffect::starts(const Scales& /*scales*/) const {
  // A length or a speed within a formula may be off by a factor from which a fit does not return.
  constexpr double factor = 3.0;
  std::vector<std::vector<double>> out;
  for (const double times : {1.0, 1.0 / factor, factor}) {
    std::vector<double>& start = out.emplace_back();
    for (std::size_t i = 0; i < start_.size(); ++i) {
      const bool scaled = card_.strength != i && !(start_[i].sigma > 0.0);
      start.push_back(scaled ? times * start_[i].value : start_[i].value);
    }
    if (out.size() > 1 && out.back() == out.front()) {
      out.pop_back();
      break;
    }
  }
  return out;
}

std::string FormulaEffect::statement(std::span<const double> p, const Place& /*place*/) const {
  std::string text = "The formula " + declaration_.id + " is part of the physics: " + equation_;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    text +=
        (i == 0 ? " with " : ", ") + std::string(parameters_[i].name) + " = " + number_text(p[i]);
    if (!declaration_.parameters[i].unit.empty() && declaration_.parameters[i].unit != "1") {
      text += " " + declaration_.parameters[i].unit;
    }
  }
  return text + ".";
}

unsigned FormulaEffect::hooks() const {
  switch (declaration_.quantity) {
    case FormulaQuantity::force:
      return hook::force;
    case FormulaQuantity::friction:
      return law_->uses(w) ? hook::slip_friction : hook::friction;
    case FormulaQuantity::load:
      return hook::load;
    case FormulaQuantity::reading:
      return hook::reading;
  }
  return 0;
}

StateSize FormulaEffect::state_size(int index, std::span<const double> /*p*/,
                                    const Scales& scales) const {
  const auto i = static_cast<std::size_t>(index);
  const double declared = declaration_.states[i].size;
  const double size = declared > 0.0 ? declared : (lengths_[i] ? scales.displacement_m : 1.0);
  return {size, size};
}

template <class T>
T FormulaEffect::value_of_formula(const Formula& formula, const OperatingPoint<T>& at,
                                  const T& replaced, const T* p, const T* s) const {
  std::array<const T*, max_formula_symbols> symbol;
  const T time(at.time_s);
  const T acceleration(at.base_acceleration_m_s2);
  symbol[x] = &at.x;
  symbol[v] = &at.v;
  symbol[w] = &at.slip;
  symbol[t] = &time;
  symbol[load_n] = declaration_.quantity == FormulaQuantity::load ? &replaced : &at.load;
  symbol[base] = &acceleration;
  symbol[own] = &replaced;
  const T** next = symbol.data() + symbol_count;
  for (std::size_t i = 0; i < rates_.size(); ++i) *next++ = s + i;
  for (std::size_t i = 0; i < parameters_.size(); ++i) *next++ = p + i;
  return formula.value(symbol.data());
}

template double FormulaEffect::value_of_formula(const Formula&, const OperatingPoint<double>&,
                                                const double&, const double*, const double*) const;
template Dual FormulaEffect::value_of_formula(const Formula&, const OperatingPoint<Dual>&,
                                              const Dual&, const Dual*, const Dual*) const;

// The formula at one of a few points without any symmetry; `unchanged`: without the effect.
double FormulaEffect::law_at(std::size_t point, std::span<const double> p,
                             double& unchanged) const {
  const auto some = [point](std::size_t k) {
    return std::sin(1.0 + 2.3 * static_cast<double>(point) + 1.7 * static_cast<double>(k));
  };
  OperatingPoint<double> at;
  at.x = 0.01 * some(0);
  at.v = 0.3 * some(1);
  at.slip = 0.3 * some(2);
  at.time_s = 5.0 + some(3);
  at.load = 1.5 + some(4);
  at.base_acceleration_m_s2 = some(5);
  const std::array<double, max_formula_states> states = {some(6), some(7)};
  const bool replaces = declaration_.quantity != FormulaQuantity::force;
  const double before = declaration_.quantity == FormulaQuantity::load ? at.load : 1.5 + some(8);
  unchanged = replaces ? before : 0.0;
  return value_of_formula(*law_, at, before, p.data(), states.data());
}

// The first parameter to which the effect is proportional, wherever the rig is.
std::optional<std::size_t> FormulaEffect::strength() const {
  constexpr std::size_t points = 8;
  std::vector<double> p;
  for (const Parameter& each : start_) p.push_back(each.value != 0.0 ? 1.2 * each.value : 1.2);
  for (std::size_t i = 0; i < p.size(); ++i) {
    bool proportional = true;
    for (std::size_t point = 0; point < points; ++point) {
      double unchanged = 0.0;
      std::vector<double> twice = p;
      twice[i] *= 2.0;
      const double once = law_at(point, p, unchanged) - unchanged;
      const double doubled = law_at(point, twice, unchanged) - unchanged;
      const double rounding = 1.0e-12 * (std::abs(unchanged) + std::abs(once));
      proportional = proportional && std::abs(doubled - 2.0 * once) <= rounding;
    }
    if (proportional) return i;
  }
  return std::nullopt;
}

}  // namespace stickslip::physics
