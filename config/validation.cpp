// SPDX-License-Identifier: Apache-2.0
#include "config/validation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>

#include "config/calibration.h"
#include "config/formula_check.h"
#include "config/formula_table.h"
#include "config/key_tables.h"
#include "config/names.h"
#include "config/toml_nodes.h"
#include "physics/frame.h"
#include "physics/sensor_chain.h"
#include "physics/spelling.h"

namespace stickslip::config {

std::vector<std::string> names_within(std::span<const Key> keys, std::string_view prefix) {
  std::vector<std::string> names;
  const auto add = [&names](std::string name) {
    if (std::find(names.begin(), names.end(), name) == names.end())
      names.push_back(std::move(name));
  };
  for (const Key& key : keys) {
    for (const std::string& path : paths_of(key)) {
      if (prefix.empty()) {
        add(path.substr(0, path.find('.')));
      } else if (path.size() > prefix.size() && path.starts_with(prefix) &&
                 path[prefix.size()] == '.') {
        const std::string rest = path.substr(prefix.size() + 1);
        add(rest.substr(0, rest.find('.')));
      }
    }
  }
  return names;
}

std::string fault_label(const toml::table& fault) {
  const auto kind = fault["kind"].value<std::string_view>();
  const bool known = kind && value_in(names<FaultKind>, *kind);
  return known ? joined_path("fault", *kind) : "fault";
}

namespace {

constexpr std::size_t max_faults = 256;  // each is checked in every cycle

bool is_table_of(std::span<const Key> keys, std::string_view path) {
  return !names_within(keys, path).empty();
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

std::vector<std::string> names_of(const toml::table& table) {
  std::vector<std::string> names;
  for (const auto& [name, each] : table) names.emplace_back(name.str());
  return names;
}

/// Validates one table and the tables in it.
class Check {
 public:
  Check(std::span<const Key> keys, const toml::table& root, std::string label, std::string name,
        std::vector<Problem>& problems)
      : keys_(keys),
        root_(root),
        label_(std::move(label)),
        name_(std::move(name)),
        problems_(problems) {}

  /// `others_are_parameters`: unknown keys are parameters of an effect.
  void run(bool others_are_parameters = false) {
    others_are_parameters_ = others_are_parameters;
    walk(root_, "");
    for (const Key& key : keys_) conditions(key);
  }

 private:
  void problem(const Place& place, const std::string& message) {
    problems_.push_back({name_, place.line, place.column, one_line(message)});
  }
  void problem(const toml::node& at, const std::string& message) {
    problem(place_of(at.source()), message);
  }
  std::string full(std::string_view path) const { return joined_path(label_, path); }

  void walk(const toml::table& table, std::string_view prefix) {
    for (const auto& [name, node] : table) {
      const std::string path = joined_path(prefix, name.str());
      // A quoted name with a dot is a single name.
      const bool plain = name.str().find('.') == std::string_view::npos;
      const Key* key = plain ? find_key(keys_, path) : nullptr;
      if (key != nullptr) {
        value(node, *key, path);
      } else if (plain && is_table_of(keys_, path)) {
        if (const toml::table* inner = node.as_table()) {
          walk(*inner, path);
        } else {
          wrong_.insert(path);
          problem(node, full(path) + ": expected a table, [" + full(path) + "], found " +
                            found_text(node));
        }
      } else if (others_are_parameters_) {
        static constexpr Key any{.path = "", .sentence = "", .type = Type::parameter};
        value(node, any, path);
      } else {
        const toml::table* inner = node.as_table();
        unknown(name, path, prefix, inner != nullptr && !inner->is_inline());
      }
    }
  }

  void unknown(const toml::key& name, const std::string& path, std::string_view prefix,
               bool table) {
    const auto names = names_within(keys_, prefix);
    std::string message = (table ? "unknown table " : "unknown key ") + full(path);
    const std::string meant = physics::nearest(name.str(), names);
    if (!meant.empty()) {
      meant_.insert(joined_path(prefix, meant));
      message += ": did you mean " + meant + "?";
    } else if (const std::string elsewhere = path_elsewhere(name.str()); !elsewhere.empty()) {
      meant_.insert(elsewhere);
      message += ": " + std::string(name.str()) + " belongs to [" +
                 std::string(parent_of(elsewhere)) + "]";
    } else {
      message += "; expected one of " + listed(names);
    }
    problem(place_of(name.source()), message);
  }

  /// Path of the only key of that name in another table; empty if there is none.
  std::string path_elsewhere(std::string_view name) const {
    std::string path;
    for (const Key& key : keys_) {
      if (last_name(key.path) != name || parent_of(key.path).empty()) continue;
      if (!path.empty() || key.path.find('*') != std::string_view::npos) return {};
      path = key.path;
    }
    return path;
  }

  void expected(const toml::node& node, const Key& key, const std::string& path) {
    wrong_.insert(path);
    problem(node, full(path) + ": expected " + expectation(key) + ", found " + found_text(node));
  }

  void value(const toml::node& node, const Key& key, const std::string& path) {
    switch (key.type) {
      case Type::choice:
        return choice(node, key, path);
      case Type::parameter:
        return parameter(node, key, path);
      case Type::filters:
        return filters(node, key, path);
      case Type::envelope:
        return envelope(node, key, path);
      case Type::lines:
        return lines(node, key, path);
      case Type::terms:
        return terms(node, key, path);
      case Type::numbers:
        return numbers(node, key, path);
      case Type::parameters:
        return check_named_parameters(node, formula_report(label_));
      case Type::states:
        return check_named_states(node, formula_report(label_));
      case Type::span:
        return span(node, key, path);
      case Type::faults:
        return faults(node, key, path);
      case Type::texts:
        return texts(node, key, path);
      case Type::integers:
        return integers(node, key, path);
      case Type::covariance:
        return covariance(node, key, path);
      case Type::crosstalk:
        return crosstalk(node, key, path);
      case Type::calibration:
        return calibration(node, key, path);
      case Type::tables:
        return tables(node, key, path);
      default:
        if (!fits(node, key)) expected(node, key, path);
    }
  }

  /// True if the value of a type that has a single kind of problem is right.
  static bool fits(const toml::node& node, const Key& key) {
    switch (key.type) {
      case Type::number:
        return in_range(node, key);
      case Type::integer:
        return node.is_integer() && in_range(node, key);
      case Type::boolean:
        return node.is_boolean();
      case Type::text:
      case Type::file:
        return node.is_string() && !node.value<std::string_view>()->empty();
      case Type::date: {
        const auto text = node.value_exact<std::string_view>();
        return text && utc_seconds(*text);
      }
      case Type::range: {
        const auto pair = pair_in(&node);
        return pair && (*pair)[0] < (*pair)[1];
      }
      default:
        return true;
    }
  }

  static bool in_range(const toml::node& node, const Key& key) {
    const auto number = number_in(&node);
    return number && std::isfinite(*number) &&
           (key.above_low ? *number > key.low : *number >= key.low) && *number <= key.high;
  }

  void choice(const toml::node& node, const Key& key, const std::string& path) {
    const auto text = node.value_exact<std::string_view>();
    if (text && std::find(key.choices.begin(), key.choices.end(), *text) != key.choices.end())
      return;
    wrong_.insert(path);
    std::string message =
        full(path) + ": expected " + expectation(key) + ", found " + found_text(node);
    if (text) {
      const std::string meant = physics::nearest(*text, {key.choices.begin(), key.choices.end()});
      if (!meant.empty()) message += ": did you mean \"" + meant + "\"?";
    }
    problem(node, message);
  }

  void parameter(const toml::node& node, const Key& key, const std::string& path) {
    const toml::table* table = node.as_table();
    if (table == nullptr) {
      if (!in_range(node, key)) expected(node, key, path);
      return;
    }
    for (const auto& [name, inner] : *table) {
      if (name.str() != "value" && name.str() != "sigma") {
        wrong_.insert(path);
        problem(place_of(name.source()), "unknown key " + std::string(name.str()) + " in " +
                                             full(path) + ": expected " + expectation(key));
      }
    }
    if (const toml::node* value = table->get("value")) {
      if (!in_range(*value, key)) expected(*value, key, path);
    } else {
      wrong_.insert(path);
      problem(node, full(path) + ": lacks its value: expected " + expectation(key));
    }
    if (const toml::node* sigma = table->get("sigma")) {
      const auto number = number_in(sigma);
      if (!number || !std::isfinite(*number) || *number < 0.0) {
        wrong_.insert(path);
        problem(*sigma, full(path) +
                            ": sigma is a standard deviation, a number of 0 or more, found " +
                            found_text(*sigma));
      }
    } else {
      wrong_.insert(path);
      problem(node, full(path) +
                        ": lacks its sigma; a value that is known exactly is written as a "
                        "plain number");
    }
  }

  void filters(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    std::int64_t sections = 0;
    for (const toml::node& each : *list) {
      if (const toml::table* filter = each.as_table()) {
        Check(keys_of<physics::Filter>(), *filter, full(path), name_, problems_).run();
        const auto order =
            std::clamp<std::int64_t>((*filter)["order"].value_or<std::int64_t>(1), 1, 8);
        sections += (order + 1) / 2;
      } else {
        expected(each, key, path);
      }
    }
    constexpr auto most = static_cast<std::int64_t>(physics::max_filter_sections);
    if (sections > most) {
      problem(node,
              full(path) + ": together more than " + std::to_string(2 * most) +
                  " poles (odd orders count as the next even one), which is no sensor's chain");
    }
  }

  void envelope(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->size() < 2) {
      problem(node,
              full(path) + ": needs two points or more, found " + std::to_string(list->size()));
    }
    std::optional<double> before;
    for (const toml::node& each : *list) {
      if (const auto point = pair_in(&each)) {
        envelope_point(*each.as_array(), path, before);
        before = (*point)[0];
      } else {
        problem(each,
                full(path) + ": expected a point, [time_s, amplitude], found " + found_text(each));
      }
    }
  }

  /// `before`: time of the point before; empty for the first.
  void envelope_point(const toml::array& point, const std::string& path,
                      std::optional<double> before) {
    const toml::node& time = *point.get(0);
    const toml::node& amplitude = *point.get(1);
    if (*number_in(&amplitude) < 0.0) {
      problem(amplitude,
              full(path) + ": an amplitude is 0 or more, found " + found_text(amplitude));
    }
    if (!before && *number_in(&time) != 0.0) {
      problem(time, full(path) + ": the first time has to be 0, found " + found_text(time));
    } else if (before && *number_in(&time) <= *before) {
      problem(time, full(path) + ": times have to increase, found " + found_text(time));
    }
  }

  void lines(const toml::node& node, const Key& key, const std::string& path) {
    constexpr std::size_t max_lines = 200;
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->empty() || list->size() > max_lines) {
      problem(node, full(path) + ": expected 1 to " + std::to_string(max_lines) + " lines, found " +
                        std::to_string(list->size()));
    }
    for (const toml::node& each : *list) {
      const toml::array* line = each.as_array();
      bool valid = line != nullptr && line->size() == 3;
      for (std::size_t i = 0; valid && i < 3; ++i) {
        const auto number = number_in(line->get(i));
        valid = number && std::isfinite(*number);
      }
      if (!valid) {
        problem(each, full(path) + ": expected a line, [frequency_hz, amplitude, phase_deg], " +
                          "found " + found_text(each));
        continue;
      }
      if (*number_in(line->get(0)) <= 0.0) {
        problem(*line->get(0),
                full(path) + ": a frequency is above 0 [Hz], found " + found_text(*line->get(0)));
      }
      if (*number_in(line->get(1)) < 0.0) {
        problem(*line->get(1),
                full(path) + ": an amplitude is 0 or more, found " + found_text(*line->get(1)));
      }
    }
  }

  void terms(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    for (const toml::node& each : *list) {
      if (const toml::table* term = each.as_table()) {
        const auto id = (*term)["id"].value<std::string_view>();
        const std::string label = id ? joined_path(path, *id) : path;
        if (key.path == "candidate" || states_formula(names_of(*term))) {
          formula(*term, label);
        } else {
          Check(keys_of<physics::Term>(), *term, label, name_, problems_).run(true);
        }
      } else {
        expected(each, key, path);
      }
    }
  }

  FormulaReport formula_report(const std::string& label) {
    return [this, label](const Place& place, const std::string& within, const std::string& why) {
      problem(place, (within.empty() ? label : joined_path(label, within)) + ": " + why);
    };
  }

  void formula(const toml::table& table, const std::string& label) {
    const std::size_t before = problems_.size();
    Check(keys_of<physics::FormulaDeclaration>(), table, label, name_, problems_).run();
    if (problems_.size() != before) return;
    physics::FormulaSurroundings around;
    around.dimensionless = root_["dimensionless"].value_or(false);
    // A file of candidates says nothing of the model.
    if (root_.contains("oscillator")) around.loaded = root_.contains("normal_load");
    check_formula(table, around, formula_report(label));
  }

  void span(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr || list->size() != 2) return expected(node, key, path);
    const toml::node& from = *list->get(0);
    const toml::node& to = *list->get(1);
    if (in_range(from, key) && in_range(to, key) && *number_in(&from) < *number_in(&to)) return;
    wrong_.insert(path);
    problem(node, full(path) + ": expected " + expectation(key) + ", found [" + found_text(from) +
                      ", " + found_text(to) + "]");
  }

  void faults(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->size() > max_faults) {
      problem(*list->get(max_faults), full(path) + ": more than " + std::to_string(max_faults) +
                                          " in one script, found " + std::to_string(list->size()) +
                                          ": one fault can be repeated with every_s");
    }
    for (const toml::node& each : *list) {
      if (const toml::table* fault = each.as_table()) {
        const auto kind = (*fault)["kind"].value<std::string_view>().value_or("");
        const auto keys = fault_keys_of(kind);
        Check(keys, *fault, fault_label(*fault), name_, problems_).run();
      } else {
        expected(each, key, path);
      }
    }
  }

  void tables(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->size() > key.most) {
      problem(*list->get(key.most), full(path) + ": more than " + std::to_string(key.most) +
                                        " tables, found " + std::to_string(list->size()));
    }
    for (const toml::node& each : *list) {
      if (const toml::table* table = each.as_table()) {
        Check(key.columns(), *table, full(path), name_, problems_).run();
      } else {
        expected(each, key, path);
      }
    }
  }

  void calibration(const toml::node& node, const Key& key, const std::string& path) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return expected(node, key, path);
    Check(keys_of<ChannelCalibration>(), *table, full(path), name_, problems_).run();
  }

  void texts(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    for (const toml::node& each : *list) {
      if (!each.is_string() || each.value<std::string_view>()->empty()) expected(each, key, path);
    }
  }

  void integers(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr || list->empty()) return expected(node, key, path);
    for (const toml::node& each : *list) {
      if (!each.is_integer()) expected(each, key, path);
    }
  }

  void covariance(const toml::node& node, const Key& key, const std::string& path) {
    const auto found = covariance_in(&node);
    if (!found) return expected(node, key, path);
    // Roots, since the product of two tiny variances may underflow.
    constexpr double rounding = 1.0 + 1.0e-9;
    const bool possible = found->offset >= 0.0 && found->gain >= 0.0 &&
                          std::abs(found->offset_gain) <=
                              std::sqrt(found->offset) * std::sqrt(found->gain) * rounding;
    if (!possible) {
      wrong_.insert(path);
      problem(node, full(path) +
                        ": is no covariance: variances are 0 or more, and the one in the middle is "
                        "at most the root of their product");
    }
  }

  void numbers(const toml::node& node, const Key& key, const std::string& path) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return expected(node, key, path);
    for (const auto& [name, value] : *table) {
      const std::string inner = joined_path(path, name.str());
      const auto number = number_in(&value);
      if (value.is_table()) {
        numbers(value, key, inner);
      } else if (!number || !std::isfinite(*number)) {
        wrong_.insert(path);
        problem(value, full(inner) + ": expected a number, found " + found_text(value));
      }
    }
  }

  void crosstalk(const toml::node& node, const Key& key, const std::string& path) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return expected(node, key, path);
    std::vector<std::string> stems;
    for (const ChannelInfo& channel : channel_table) stems.emplace_back(channel.stem);
    for (const auto& [name, value] : *table) {
      const auto number = number_in(&value);
      if (std::find(stems.begin(), stems.end(), name.str()) == stems.end()) {
        const std::string meant = physics::nearest(name.str(), stems);
        problem(place_of(name.source()), "unknown channel " + std::string(name.str()) + " in " +
                                             full(path) +
                                             (meant.empty() ? "; expected one of " + listed(stems)
                                                            : ": did you mean " + meant + "?"));
      } else if (!number || !std::isfinite(*number)) {
        problem(value, full(path) + "." + std::string(name.str()) +
                           ": expected a number [SI/SI], found " + found_text(value));
      }
    }
  }

  /// True if the condition of a key holds; empty if that cannot be determined.
  std::optional<bool> holds(std::string_view condition) const {
    if (condition.empty()) return true;
    const auto equals = condition.find('=');
    const std::string_view path = condition.substr(0, equals);
    if (wrong_.contains(std::string(path)) || is_meant(path)) return std::nullopt;
    const std::string value = value_of(path);
    if (value.empty()) return std::nullopt;
    const auto wanted = alternatives_in(condition.substr(equals + 1));
    return std::find(wanted.begin(), wanted.end(), value) != wanted.end();
  }

  /// Choice, or true or false, at a path, or its default; empty if unknown.
  std::string value_of(std::string_view path) const {
    const toml::node* node = node_at(root_, path);
    if (node == nullptr) {
      const Key& key = *find_key(keys_, path);
      if (!key.without.empty()) return std::string(key.without);
      return key.need == Need::optional ? absence_of(key) : std::string();
    }
    if (const auto flag = node->value_exact<bool>()) return *flag ? "true" : "false";
    return node->value_exact<std::string>().value_or("");
  }

  /// True if a misspelt key or table was taken for this one, which is then not reported missing.
  bool is_meant(std::string_view path) const {
    for (; !path.empty(); path = parent_of(path)) {
      if (meant_.contains(std::string(path))) return true;
    }
    return false;
  }

  void conditions(const Key& key) {
    if (key.path.find('*') != std::string_view::npos) return;
    const toml::node* node = node_at(root_, key.path);
    const auto relevant = holds(key.when);
    if (!relevant) return;
    if (node != nullptr) {
      if (!*relevant && key.only_then) refuse(key, *node);
      return;
    }
    if (key.need == Need::optional || !*relevant || is_meant(key.path)) return;
    const std::string_view parent = parent_of(key.path);
    const toml::node* table = parent.empty() ? &root_ : node_at(root_, parent);
    if (table == nullptr && key.need == Need::in_table) return;
    if (table != nullptr && !table->is_table()) return;
    std::string message = full(key.path) + " is missing";
    if (!key.when.empty()) message += " with " + condition_text(key);
    message += ": expected " + expectation(key) + ". ";
    problem(nearest_place(parent), message + std::string(key.sentence));
  }

  void refuse(const Key& key, const toml::node& node) {
    problem(key_place(key.path, node), full(key.path) + " has no meaning with " +
                                           condition_text(key) + ": remove one of the two");
  }

  /// The key on which a condition depends, as in the file: `law = "coulomb"`.
  std::string condition_text(const Key& key) const {
    const std::string_view path = key.when.substr(0, key.when.find('='));
    const std::string value = value_of(path);
    const std::string quote = find_key(keys_, path)->type == Type::choice ? "\"" : "";
    const std::string_view name = parent_of(path) == parent_of(key.path) ? last_name(path) : path;
    return std::string(name) + " = " + quote + value + quote;
  }

  Place key_place(std::string_view path, const toml::node& node) const {
    const std::string_view parent = parent_of(path);
    const toml::node* around = parent.empty() ? &root_ : node_at(root_, parent);
    if (around != nullptr && around->is_table()) {
      const auto at = around->as_table()->find(last_name(path));
      if (at != around->as_table()->end()) return place_of(at->first.source());
    }
    return place_of(node.source());
  }

  Place nearest_place(std::string_view path) const {
    for (; !path.empty(); path = parent_of(path)) {
      const toml::node* node = node_at(root_, path);
      if (node != nullptr && node->source().begin.line > 0) return place_of(node->source());
    }
    // An inner table (a filter) has a place; the file itself begins at its first line.
    const Place root = place_of(root_.source());
    return root.line > 0 ? root : Place{1, 1};
  }

  std::span<const Key> keys_;
  const toml::table& root_;
  std::string label_;  // path of root_ in the file
  std::string name_;
  std::vector<Problem>& problems_;
  bool others_are_parameters_ = false;
  std::set<std::string> wrong_;  // paths with an invalid value
  std::set<std::string> meant_;  // paths that misspelt keys probably mean
};

}  // namespace

void validate(const toml::table& root, std::span<const Key> keys, const std::string& file,
              std::vector<Problem>& problems) {
  Check(keys, root, "", file, problems).run();
}

}  // namespace stickslip::config
